"""MaskablePPO of sb3-contrib."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from sb3_contrib import MaskablePPO
from stable_baselines3 import DQN
from stable_baselines3.common.evaluation import evaluate_policy

from drlsl.masks import Sb3VecEnv
from tests.interop.taken import ID, SETTINGS, VECTOR

LIBRARY = "sb3-contrib"


def _model(seed: int, *, vector: bool) -> MaskablePPO:
    env: Any
    if vector:
        env = Sb3VecEnv(gymnasium.make_vec(ID, num_envs=VECTOR, autoreset_mode="SameStep", **SETTINGS))
    else:
        env = gymnasium.make(ID, **SETTINGS)
    steps = 256 // (VECTOR if vector else 1)
    return MaskablePPO("MlpPolicy", env, n_steps=steps, batch_size=64, n_epochs=2, seed=seed, device="cpu")


def train(seed: int, steps: int, *, vector: bool) -> None:
    """Train for some steps."""
    _model(seed, vector=vector).learn(steps)


def bypass_evaluate() -> None:
    """Judge a model by Stable-Baselines3's own function."""
    env = gymnasium.make(ID, **SETTINGS)
    evaluate_policy(_model(0, vector=False), env, n_eval_episodes=3, deterministic=False, warn=False)


def bypass_dqn() -> None:
    """Train with an algorithm that has no masks."""
    env = gymnasium.make(ID, **SETTINGS)
    DQN("MlpPolicy", env, seed=0, device="cpu", learning_starts=100).learn(300)


class _Empty(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Says that no action is offered."""

    def action_masks(self) -> Any:
        return np.zeros(3, dtype=np.bool_)


def bypass_empty_mask() -> None:
    """Train where the mask is all false."""
    env = _Empty(gymnasium.make(ID, **SETTINGS))
    MaskablePPO("MlpPolicy", env, n_steps=128, batch_size=64, n_epochs=1, seed=0, device="cpu").learn(128)


BYPASSES = {
    "evaluate_policy of stable_baselines3": bypass_evaluate,
    "DQN (and every algorithm but MaskablePPO)": bypass_dqn,
    "MaskablePPO with a mask that is all false": bypass_empty_mask,
}
