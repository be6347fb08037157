"""PPO of RLlib, with the masking module of its examples."""

from __future__ import annotations

from typing import Any

import gymnasium
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.core.rl_module.rl_module import RLModuleSpec
from ray.rllib.examples.rl_modules.classes.action_masking_rlm import ActionMaskingTorchRLModule
from ray.tune.registry import register_env

from tests.interop.taken import ID, SETTINGS, VECTOR

LIBRARY = "ray"


def _algorithm(seed: int, count: int, steps: int, *, masked: bool) -> Any:
    settings = {**SETTINGS, "mask_format": "rllib"} if masked else SETTINGS
    register_env("highway", lambda _: gymnasium.make(ID, **settings))
    config = (
        PPOConfig()
        .environment("highway")
        .env_runners(num_env_runners=0, num_envs_per_env_runner=count)
        .training(train_batch_size_per_learner=steps, minibatch_size=min(125, steps), num_epochs=1)
        .debugging(seed=seed)
    )
    if masked:
        config = config.rl_module(
            rl_module_spec=RLModuleSpec(
                module_class=ActionMaskingTorchRLModule,
                model_config={"head_fcnet_hiddens": [32], "head_fcnet_activation": "relu"},
            )
        )
    return config.build_algo()


def train(seed: int, steps: int, *, vector: bool) -> None:
    """Train for some steps, in two iterations."""
    algorithm = _algorithm(seed, VECTOR if vector else 1, steps // 2, masked=True)
    for _ in range(2):
        algorithm.train()
    algorithm.stop()


def bypass_plain() -> None:
    """Train without the masking module."""
    algorithm = _algorithm(0, 1, 250, masked=False)
    algorithm.train()
    algorithm.stop()


BYPASSES = {"any algorithm on plain observations": bypass_plain}
