"""DQN of TorchRL, whose actors read the mask of the observation."""

from __future__ import annotations

from typing import Any

import gymnasium
import torch
from tensordict.nn import TensorDictModule, TensorDictSequential
from torch import nn
from torchrl.data import Categorical, LazyTensorStorage, TensorDictReplayBuffer
from torchrl.envs import GymEnv, GymWrapper
from torchrl.envs.utils import check_env_specs
from torchrl.modules import EGreedyModule, QValueModule
from torchrl.objectives import DQNLoss

from tests.interop.taken import ID, SETTINGS, VECTOR

LIBRARY = "torchrl"


def _env(*, vector: bool) -> Any:
    if vector:
        envs = gymnasium.make_vec(
            ID, num_envs=VECTOR, mask_format="torchrl", autoreset_mode="Disabled", **SETTINGS
        )
        return GymWrapper(envs, categorical_action_encoding=True)
    return GymEnv(ID, mask_format="torchrl", categorical_action_encoding=True, **SETTINGS)


def _policies(mask_in_actor: str | None, mask_in_exploration: str | None) -> tuple[Any, Any]:
    net = nn.Sequential(nn.Linear(21, 32), nn.ReLU(), nn.Linear(32, 3))
    values = TensorDictModule(net, in_keys=["observation"], out_keys=["action_value"])
    spec = Categorical(3)
    actor = TensorDictSequential(values, QValueModule(spec=spec, action_mask_key=mask_in_actor))
    exploration = EGreedyModule(spec=spec, eps_init=0.5, eps_end=0.5, action_mask_key=mask_in_exploration)
    return actor, TensorDictSequential(actor, exploration)


def train(seed: int, steps: int, *, vector: bool) -> None:
    """Train for some steps, collecting 100 between two updates."""
    torch.manual_seed(seed)
    env = _env(vector=vector)
    env.set_seed(seed)
    actor, explorer = _policies("action_mask", "action_mask")
    loss = DQNLoss(actor, action_space="categorical", delay_value=False)
    adam = torch.optim.Adam(actor.parameters(), lr=1e-3)
    memory = TensorDictReplayBuffer(storage=LazyTensorStorage(2000), batch_size=64)
    each = 100 // (VECTOR if vector else 1)
    started = env.reset()
    for _ in range(0, steps, 100):
        with torch.no_grad():
            driven = env.rollout(
                each, explorer, auto_reset=False, tensordict=started, break_when_any_done=False
            )
        started = driven[..., -1]["next"].exclude("reward", "action")
        started = env.maybe_reset(started)
        memory.extend(driven.reshape(-1))
        found = loss(memory.sample())
        adam.zero_grad()
        found["loss"].backward()
        adam.step()
    env.close()


def check() -> None:
    """Check the specs of both environments as TorchRL does."""
    for vector in (False, True):
        check_env_specs(_env(vector=vector))


def _roll(mask_in_actor: str | None, mask_in_exploration: str | None) -> None:
    torch.manual_seed(0)
    env = _env(vector=False)
    env.set_seed(0)
    with torch.no_grad():
        env.rollout(200, _policies(mask_in_actor, mask_in_exploration)[1], break_when_any_done=False)


BYPASSES = {
    "EGreedyModule without action_mask_key": lambda: _roll("action_mask", None),
    "QValueModule without action_mask_key": lambda: _roll(None, "action_mask"),
    "env.rollout without a policy": lambda: _env(vector=False).rollout(200, break_when_any_done=False),
}
