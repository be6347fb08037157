"""The speed of the rules, the environments, training and the engine, for `drlsl bench`."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
