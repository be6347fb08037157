from .driving import Action, Decision, Road, Scene, Shield, Vehicle, facts_of
from .shield import LogicShield, LogicVectorShield, of_each
from .traffic import Direction, Lane
from .version import __version__

__all__ = [
    "Action",
    "Decision",
    "Direction",
    "Lane",
    "LogicShield",
    "LogicVectorShield",
    "Road",
    "Scene",
    "Shield",
    "Vehicle",
    "__version__",
    "facts_of",
    "of_each",
]
