"""Drivers: whoever chooses among the actions, learnt or not."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
