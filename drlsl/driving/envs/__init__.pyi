from .single import HighwayEnv, make_env
from .vector import HighwayVectorEnv, make_vec

__all__ = [
    "HighwayEnv",
    "HighwayVectorEnv",
    "make_env",
    "make_vec",
]
