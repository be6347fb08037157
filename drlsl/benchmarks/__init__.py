"""How fast the rules, the environments, training and the engine are; `drlsl bench` prints it."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
