"""Safe reinforcement learning for highway driving, shielded by readable Prolog rules."""

import lazy_loader

from drlsl.moved import say_where
from drlsl.registration import register_with_gymnasium, register_with_ipython

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

register_with_gymnasium()
register_with_ipython()
say_where()
