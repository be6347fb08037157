from .single import HighwayEnv as HighwayEnv
from .single import make_env as make_env
from .vector import HighwayVectorEnv as HighwayVectorEnv
from .vector import make_vec as make_vec

__all__ = [
    "HighwayEnv",
    "HighwayVectorEnv",
    "make_env",
    "make_vec",
]
