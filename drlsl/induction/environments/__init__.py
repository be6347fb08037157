"""Environments with failures of their own: labels by looking ahead, and rules learnt behind LogicShield."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
