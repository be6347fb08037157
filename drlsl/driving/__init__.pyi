from .config import EnvConfig, Section
from .envs import HighwayEnv, HighwayVectorEnv, make_env, make_vec
from .scene import Action, Road, Scene, Vehicle, facts_of
from .shield import Decision, Shield
from .stress_test import (
    POLICIES,
    ContactRecord,
    Counts,
    LaneChange,
    StressReport,
    record,
    spread_stress,
    stress,
)

__all__ = [
    "POLICIES",
    "Action",
    "ContactRecord",
    "Counts",
    "Decision",
    "EnvConfig",
    "HighwayEnv",
    "HighwayVectorEnv",
    "LaneChange",
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
    "spread_stress",
    "stress",
]
