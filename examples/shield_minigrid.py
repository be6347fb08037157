"""Walk past lava behind the rules that ship (pip install minigrid): python examples/shield_minigrid.py."""

import gymnasium
import numpy as np

from drlsl.shield.environments import shield_minigrid

EPISODES = 50


def burns(*, shielded: bool) -> int:
    """Return how often a random walk steps into lava."""
    env = shield_minigrid(gymnasium.make("minigrid:MiniGrid-LavaGapS7-v0"))
    env.action_space.seed(0)
    burnt = 0
    for episode in range(EPISODES):
        _, info = env.reset(seed=episode)
        over = False
        while not over:
            mask = info["action_mask"] if shielded else np.ones_like(info["action_mask"])
            _, reward, terminated, truncated, info = env.step(env.action_space.sample(mask))
            over = terminated or truncated
        burnt += terminated and reward == 0
    return burnt


without, shielded = burns(shielded=False), burns(shielded=True)
print(f"lava ends {without} walks of {EPISODES} without the rules, {shielded} with them")
