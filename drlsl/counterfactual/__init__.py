"""The least changes of a scene for an action to be offered, or no longer."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
