"""DQN of AgileRL, which reads the mask of info."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import torch
from agilerl.algorithms import DQN
from agilerl.components.replay_buffer import ReplayBuffer
from agilerl.training.train_off_policy import train_off_policy

from tests.interop.taken import ID, SETTINGS, VECTOR

LIBRARY = "agilerl"


def train(seed: int, steps: int, *, vector: bool) -> None:
    """Train for some steps."""
    torch.manual_seed(seed)
    np.random.seed(seed)  # noqa: NPY002  (what AgileRL draws from)
    env: Any
    if vector:
        env = gymnasium.make_vec(ID, num_envs=VECTOR, **SETTINGS)
        observed, actions = env.single_observation_space, env.single_action_space
    else:
        env = gymnasium.make(ID, **SETTINGS)
        observed, actions = env.observation_space, env.action_space
    env.reset(seed=seed)
    agent = DQN(observed, actions, batch_size=32, learn_step=20)
    train_off_policy(
        env,
        ID,
        "DQN",
        [agent],
        ReplayBuffer(2000),
        max_steps=steps,
        evo_steps=steps,
        eval_steps=100,
        verbose=False,
    )
    env.close()


def bypass_get_action() -> None:
    """Ask the agent for an action without handing it the mask."""
    env = gymnasium.make(ID, **SETTINGS)
    agent = DQN(env.observation_space, env.action_space)
    torch.manual_seed(0)
    observation, _ = env.reset(seed=0)
    for _ in range(200):
        observation, _, terminated, truncated, _ = env.step(int(agent.get_action(observation, 0.5)[0]))
        if terminated or truncated:
            observation, _ = env.reset()


BYPASSES = {"agent.get_action without action_mask=": bypass_get_action}
