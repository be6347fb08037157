"""Moving pictures of a drive: the road around the ego, what it is offered, and why not the rest."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
