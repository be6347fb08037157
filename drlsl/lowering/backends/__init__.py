"""From the intermediate form to code: Python for one scene, NumPy, Numba and Torch for many."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
