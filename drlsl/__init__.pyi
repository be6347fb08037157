from .driving import Action, Decision, Scene, Shield
from .version import __version__

__all__ = [
    "Action",
    "Decision",
    "Scene",
    "Shield",
    "__version__",
]
