from .attacker import SCENES, SEED, Attack, Hit, Orders, attack

__all__ = [
    "SCENES",
    "SEED",
    "Attack",
    "Hit",
    "Orders",
    "attack",
]
