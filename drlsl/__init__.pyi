from .driving import Action, Decision, Scene, Shield

__all__ = [
    "Action",
    "Decision",
    "Scene",
    "Shield",
]
