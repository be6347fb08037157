from .config import EnvConfig, Section
from .envs import HighwayEnv, HighwayVectorEnv, make_env, make_vec
from .scene import Action, Road, Scene, Vehicle, facts_of
from .shield import Decision, Shield
from .stress_test import POLICIES, Counts, StressReport, record, stress

__all__ = [
    "POLICIES",
    "Action",
    "Counts",
    "Decision",
    "EnvConfig",
    "HighwayEnv",
    "HighwayVectorEnv",
    "Road",
    "Scene",
    "Section",
    "Shield",
    "StressReport",
    "Vehicle",
    "facts_of",
    "make_env",
    "make_vec",
    "record",
    "stress",
]
