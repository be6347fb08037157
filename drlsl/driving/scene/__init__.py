"""A moment of traffic: one scene or many, the facts that describe it to the rules, and the actions."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
