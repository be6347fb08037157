"""Networks as a user would hand them in, good ones and bad ones."""

import random
import sys
import threading

import torch
from torch import nn


def wide(observation_size: int, actions: int, width: int = 24) -> nn.Module:
    return nn.Sequential(nn.Linear(observation_size, width), nn.ReLU(), nn.Linear(width, actions))


def dropping(observation_size: int, actions: int) -> nn.Module:
    """Draws random numbers in every update, and keeps statistics."""
    return nn.Sequential(
        nn.Linear(observation_size, 16),
        nn.BatchNorm1d(16),
        nn.ReLU(),
        nn.Dropout(0.3),
        nn.LazyLinear(actions),
    )


class Recurrent(nn.Module):
    def __init__(self, observation_size: int, actions: int) -> None:
        super().__init__()
        self.memory = nn.GRU(observation_size, 8, batch_first=True)
        self.head = nn.Linear(8, actions)

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        assert observations.ndim == 3
        values: torch.Tensor = self.head(self.memory(observations)[0][:, -1])
        return values


class Frozen(nn.Module):
    """Has a part that does not learn, and one that is not used."""

    def __init__(self, observation_size: int, actions: int) -> None:
        super().__init__()
        self.fixed = nn.Linear(observation_size, 16).requires_grad_(False)
        self.idle = nn.Linear(3, 3)
        self.head = nn.Linear(16, actions)

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        values: torch.Tensor = self.head(self.fixed(observations).relu())
        return values


def double(observation_size: int, actions: int) -> nn.Module:
    return nn.Linear(observation_size, actions).double()


def narrow(observation_size: int, actions: int) -> nn.Module:
    return nn.Linear(observation_size, actions + 1)


def squeezed(observation_size: int, actions: int) -> nn.Module:
    """Loses the first axis of a batch of one."""

    class Squeezed(nn.Linear):
        def forward(self, observations: torch.Tensor) -> torch.Tensor:
            return super().forward(observations).squeeze(0)

    return Squeezed(observation_size, actions)


def other_input(observation_size: int, actions: int) -> nn.Module:
    return nn.Linear(observation_size + 1, actions)


def not_a_number(observation_size: int, actions: int) -> nn.Module:
    module = nn.Linear(observation_size, actions)
    nn.init.constant_(module.bias, torch.nan)
    return module


def no_parameters(observation_size: int, actions: int) -> nn.Module:
    return nn.Flatten()


def all_frozen(observation_size: int, actions: int) -> nn.Module:
    return nn.Linear(observation_size, actions).requires_grad_(False)


class Detached(nn.Linear):
    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        return super().forward(observations).detach()


class Listed(nn.Linear):
    """Learns in a layer that PyTorch does not know of, for it is in a list."""

    def __init__(self, observation_size: int, actions: int) -> None:
        super().__init__(observation_size, actions)
        self.layers = [nn.Linear(observation_size, actions)]

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        values: torch.Tensor = self.layers[0](observations)
        return values


class Pair(nn.Linear):
    def forward(self, observations: torch.Tensor) -> tuple[torch.Tensor, None]:  # type: ignore[override]
        return super().forward(observations), None


class Locked(nn.Linear):
    """Cannot be copied."""

    def __init__(self, observation_size: int, actions: int) -> None:
        super().__init__(observation_size, actions)
        self.lock = threading.Lock()


class Extra(nn.Linear):
    def get_extra_state(self) -> object:
        return {"a": 1}

    def set_extra_state(self, state: object) -> None:
        pass


def leaving(observation_size: int, actions: int) -> nn.Module:
    sys.exit(3)


def raising(observation_size: int, actions: int) -> nn.Module:
    raise RuntimeError("first line\nsecond line")


def no_module(observation_size: int, actions: int) -> object:
    return random.random


class Late(nn.Linear):
    """Fails once it is trained with a whole minibatch."""

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        if len(observations) > 3:
            raise ValueError("too many")
        return super().forward(observations)


class RootOfZero(nn.Linear):
    """Finite values, and a gradient that is not: from a row of zeros on."""

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        return (
            super().forward(observations)
            + (observations * self.weight.sum()).relu().sum(1, keepdim=True).mul(0).sqrt().nan_to_num()
        )


NOT_CALLABLE = 3
