"""Episodes as they were driven, frame by frame and with the rules' reasons: recorded, written, read back."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
