"""The effect of rounding on a proof: the margin within which it proves nothing."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
