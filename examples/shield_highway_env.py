"""Drive highway-env at random, with the rules that ship and without: pip install highway-env==1.12.1

python examples/shield_highway_env.py --env merge-v0 --episodes 50
"""

import argparse

import gymnasium
import highway_env  # noqa: F401  # registers its environments
import numpy as np

from drlsl.shield.environments import shield_crossing, shield_straight_road

CROSSINGS = ("roundabout-v0", "intersection-v0")

parser = argparse.ArgumentParser()
parser.add_argument("--env", default="highway-fast-v0")
parser.add_argument("--episodes", type=int, default=20)
wanted = parser.parse_args()

shield = shield_crossing if wanted.env in CROSSINGS else shield_straight_road
env = shield(gymnasium.make(wanted.env))
crashes = {}
for mask in (False, True):
    rng, crashes[mask] = np.random.default_rng(0), 0
    for episode in range(wanted.episodes):
        _, info = env.reset(seed=episode)
        over = False
        while not over:
            actions = np.flatnonzero(info["action_mask"]) if mask else np.arange(env.action_space.n)
            *_, terminated, truncated, info = env.step(rng.choice(actions))
            over = terminated or truncated
        crashes[mask] += env.unwrapped.vehicle.crashed
print(f"crashes in {wanted.episodes} episodes: {crashes[False]} without the rules, {crashes[True]} with them")
