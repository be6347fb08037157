"""A loop as CleanRL writes them, with Gymnasium alone: Q-learning of a linear function."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

from tests.interop.taken import ID, SETTINGS, VECTOR

LIBRARY = "gymnasium"


def train(seed: int, steps: int, *, vector: bool) -> None:
    """Train for some steps, with a share of random actions."""
    rng = np.random.default_rng(seed)
    count = VECTOR if vector else 1
    env: Any
    env = gymnasium.make_vec(ID, num_envs=count, **SETTINGS) if vector else gymnasium.make(ID, **SETTINGS)
    env.action_space.seed(seed)
    observation, info = env.reset(seed=seed)
    weights = np.zeros((observation.shape[-1], 3))
    for _ in range(0, steps, count):
        mask = info["action_mask"]
        if rng.random() < 0.5:
            action = env.action_space.sample(mask=tuple(mask) if vector else mask)
        else:
            action = np.where(mask, observation @ weights, -np.inf).argmax(axis=-1)
        following, reward, terminated, truncated, info = env.step(action)
        best = np.where(info["action_mask"], following @ weights, -np.inf).max(axis=-1)
        value = np.take_along_axis(np.atleast_2d(observation @ weights), np.atleast_2d(action).T, axis=1)[
            :, 0
        ]
        error = np.atleast_1d(reward + 0.9 * ~np.asarray(terminated) * best) - value
        np.add.at(weights.T, np.atleast_1d(action), 1e-4 * error[:, None] * np.atleast_2d(observation))
        if not vector and (terminated or truncated):
            following, info = env.reset()
        observation = following
    env.close()


def bypass_sample() -> None:
    """Sample without the mask."""
    env = gymnasium.make(ID, **SETTINGS)
    env.action_space.seed(0)
    env.reset(seed=0)
    for _ in range(200):
        if any(env.step(env.action_space.sample())[2:4]):
            env.reset()


BYPASSES = {"action_space.sample() without mask=": bypass_sample}
