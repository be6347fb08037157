"""Evidence about rule programs: tables of scenes with expected answers, coverage and mutation."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
