"""Driving in recorded traffic: scenes, the shield, the world and its environments."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
