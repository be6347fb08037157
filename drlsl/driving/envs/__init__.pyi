from .merge import MERGING, MergeEnv, MergeVectorEnv
from .single import HighwayEnv, Spaces, make_env, spaces_of
from .vector import HighwayVectorEnv, make_vec

__all__ = [
    "MERGING",
    "HighwayEnv",
    "HighwayVectorEnv",
    "MergeEnv",
    "MergeVectorEnv",
    "Spaces",
    "make_env",
    "make_vec",
    "spaces_of",
]
