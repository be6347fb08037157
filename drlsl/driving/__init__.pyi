from .config import EnvConfig as EnvConfig
from .envs import HighwayEnv as HighwayEnv
from .envs import HighwayVectorEnv as HighwayVectorEnv
from .envs import make_env as make_env
from .envs import make_vec as make_vec
from .scene import Action as Action
from .scene import Scene as Scene
from .shield import Decision as Decision
from .shield import Shield as Shield
from .stress_test import POLICIES as POLICIES
from .stress_test import Counts as Counts
from .stress_test import StressReport as StressReport
from .stress_test import stress as stress

__all__ = [
    "POLICIES",
    "Action",
    "Counts",
    "Decision",
    "EnvConfig",
    "HighwayEnv",
    "HighwayVectorEnv",
    "Scene",
    "Shield",
    "StressReport",
    "make_env",
    "make_vec",
    "stress",
]
