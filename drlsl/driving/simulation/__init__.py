"""The world: egos that drive in recorded traffic, and the verdicts on their contacts."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
