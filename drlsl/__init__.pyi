from .driving import Action as Action
from .driving import Decision as Decision
from .driving import Scene as Scene
from .driving import Shield as Shield

__all__ = ["Action", "Decision", "Scene", "Shield"]
