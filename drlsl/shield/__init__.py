"""Shields of any environment: rules that say which of its actions are offered, run by any tier."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
