"""A rule program for use without Python: JavaScript, C99 or plain ISO Prolog, each with its own check."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
