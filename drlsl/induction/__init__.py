"""Rules for lane changes, learnt from driving: labels by simulation, an exact search, and a file to sign."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
