"""The shield: the rules' decision about a scene, by the interpreter or by faster tiers."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
