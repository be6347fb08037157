"""Merge from an on-ramp at random, with the rules and without: python examples/merge.py --episodes 20"""

import argparse

import gymnasium
import numpy as np

import drlsl  # noqa: F401  # registers its environments

parser = argparse.ArgumentParser()
parser.add_argument("--episodes", type=int, default=20)
wanted = parser.parse_args()

env = gymnasium.make("drlsl/Merge-v0", recording="merge-test")
for masked in (False, True):
    rng = np.random.default_rng(0)
    merged = 0
    for episode in range(wanted.episodes):
        _, info = env.reset(seed=episode)
        over = truncated = False
        while not over:
            actions = np.flatnonzero(info["action_mask"]) if masked else np.arange(env.action_space.n)
            *_, terminated, truncated, info = env.step(rng.choice(actions))
            over = terminated or truncated
        merged += truncated
    print(f"merged in {merged} of {wanted.episodes} episodes, {'with' if masked else 'without'} the rules")
