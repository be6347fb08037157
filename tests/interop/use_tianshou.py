"""DQN of Tianshou, whose collectors read the mask of the observation."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import torch
from tianshou.algorithm import DQN
from tianshou.algorithm.modelfree.dqn import DiscreteQLearningPolicy
from tianshou.algorithm.optim import AdamOptimizerFactory
from tianshou.data import Collector, VectorReplayBuffer
from tianshou.env import DummyVectorEnv
from tianshou.utils.net.common import Net
from tianshou.utils.torch_utils import policy_within_training_step, torch_train_mode

from tests.interop.taken import ID, SETTINGS, VECTOR

LIBRARY = "tianshou"


def _collector(seed: int, count: int) -> tuple[Any, Any]:
    torch.manual_seed(seed)
    np.random.seed(seed)  # noqa: NPY002  (what Tianshou draws from)
    envs = DummyVectorEnv([lambda: gymnasium.make(ID, mask_format="tianshou", **SETTINGS)] * count)
    envs.seed(seed)
    actions: Any = envs.action_space[0]
    actions.seed(seed)
    policy = DiscreteQLearningPolicy(
        model=Net(state_shape=(21,), action_shape=3, hidden_sizes=[32]),
        action_space=actions,
        eps_training=0.5,
        eps_inference=0.5,
    )
    algorithm: Any = DQN(policy=policy, optim=AdamOptimizerFactory(lr=1e-3), target_update_freq=50)
    return algorithm, Collector(algorithm, envs, VectorReplayBuffer(2000, count))


def train(seed: int, steps: int, *, vector: bool) -> None:
    """Train for some steps, collecting 100 between two updates."""
    algorithm, collector = _collector(seed, VECTOR if vector else 1)
    collector.reset(gym_reset_kwargs={"seed": seed})
    with policy_within_training_step(algorithm.policy):
        for _ in range(0, steps, 100):
            collector.collect(n_step=100)
            with torch_train_mode(algorithm.policy):
                algorithm.update(buffer=collector.buffer, sample_size=64)


def bypass_random() -> None:
    """Fill the memory with random actions, as Tianshou's examples begin."""
    _, collector = _collector(0, 1)
    collector.reset(gym_reset_kwargs={"seed": 0})
    collector.collect(n_step=200, random=True)


def bypass_key() -> None:
    """Give the mask under another key than Tianshou's: not read."""
    env = gymnasium.make(ID, mask_format="pettingzoo", **SETTINGS)
    model = _Observation(Net(state_shape=(21,), action_shape=3, hidden_sizes=[32]))
    space: Any = env.action_space
    policy = DiscreteQLearningPolicy(model=model, action_space=space, eps_inference=0.5)
    algorithm: Any = DQN(policy=policy, optim=AdamOptimizerFactory(lr=1e-3))
    collector: Any = Collector(algorithm, DummyVectorEnv([lambda: env]))
    collector.reset(gym_reset_kwargs={"seed": 0})
    collector.collect(n_step=200)


class _Observation(torch.nn.Module):
    """A network that finds the observation in a dict."""

    def __init__(self, net: Any) -> None:
        super().__init__()
        self.net = net

    def forward(self, obs: Any, state: Any = None, info: Any = None) -> Any:
        return self.net(obs.observation, state)


BYPASSES = {
    "Collector.collect(random=True)": bypass_random,
    "a mask under another key than mask": bypass_key,
}
