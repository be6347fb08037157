from .attacker import SCENES, SEED, Attack, Hit, Orders, attack
from .closeness import Closeness

__all__ = [
    "SCENES",
    "SEED",
    "Attack",
    "Closeness",
    "Hit",
    "Orders",
    "attack",
]
