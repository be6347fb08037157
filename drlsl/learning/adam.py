"""Adam on one vector of parameters, and on those of any module."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final, Protocol

import numpy as np
import torch
from torch import nn
from torch.optim.adam import adam

from drlsl.learning.divergence import DivergedError
from drlsl.lowering.backends import Singles1, machine_code

BETA_1: Final = 0.9
BETA_2: Final = 0.999
EPSILON: Final = 1e-8
"""PyTorch's defaults, and so the paper's as far as it tells."""


_SMALLEST: Final = math.ulp(0.0)


@contextmanager
def no_subnormals() -> Iterator[None]:
    """Make this thread compute with 0 in place of numbers below the smallest normal one.

    Where the gradient stays 0, as behind a ReLU that no state activates, Adam's running mean shrinks by a
    tenth a step until it is such a number, and a step on many of them takes half as long again.
    """
    if _SMALLEST * 1.0 == 0.0:
        yield
        return
    torch.set_flush_denormal(True)
    try:
        yield
    finally:
        torch.set_flush_denormal(False)


class Optimiser(Protocol):
    """An optimiser of a network's parameters."""

    learning_rate: float

    def step(self) -> None:
        """Take one step down the gradient.

        Raises:
            DivergedError: the gradient is not finite; the parameters are left as they were.
        """

    def get_state(self) -> dict[str, Any]:
        """Return all that the next step depends on, in plain types and tensors."""

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Take over what `get_state` gave."""


class Adam:
    """PyTorch's fused Adam by its functional form, without the bookkeeping of the optimiser class.

    The class would make an update 4% slower (docs/training.md, Speed). `step` changes `parameters` in place,
    by the gradient in `gradient`.
    """

    def __init__(self, parameters: torch.Tensor, gradient: torch.Tensor) -> None:
        self.learning_rate = 1e-3
        self._parameters = parameters
        self._gradient = gradient
        self._mean = torch.zeros_like(parameters)
        self._square = torch.zeros_like(parameters)
        self._steps = torch.zeros((), device=parameters.device)

    def step(self) -> None:
        """Take one step down the gradient."""
        self.step_all([self])

    @staticmethod
    def step_all(optimisers: Iterable[Adam]) -> None:
        """Take a step with each of several, in one call for those of one learning rate."""
        of_rate: dict[float, list[Adam]] = {}
        for one in optimisers:
            of_rate.setdefault(one.learning_rate, []).append(one)
        with no_subnormals():
            for rate, alike in of_rate.items():
                adam(
                    [one._parameters for one in alike],
                    [one._gradient for one in alike],
                    [one._mean for one in alike],
                    [one._square for one in alike],
                    [],
                    [one._steps for one in alike],
                    fused=True,
                    lr=rate,
                    beta1=BETA_1,
                    beta2=BETA_2,
                    weight_decay=0.0,
                    eps=EPSILON,
                    amsgrad=False,
                    maximize=False,
                )

    def get_state(self) -> dict[str, Any]:
        """Return running means, counter and rate, in plain types and tensors."""
        return {
            "learning_rate": self.learning_rate,
            "mean": self._mean.cpu().clone(),
            "square": self._square.cpu().clone(),
            "steps": self._steps.cpu().clone(),
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Take over what `get_state` gave."""
        self.learning_rate = state["learning_rate"]
        for mine, stored in (
            (self._mean, state["mean"]),
            (self._square, state["square"]),
            (self._steps, state["steps"]),
        ):
            mine.copy_(stored)


class CompiledAdam(Adam):
    """The same step as machine code, in a processor's memory, for learning in bfloat16.

    PyTorch divides twice for each parameter, this once; so the last bits of the parameters are others.
    """

    def __init__(self, parameters: torch.Tensor, gradient: torch.Tensor) -> None:
        super().__init__(parameters, gradient)
        self._arrays = parameters.numpy(), gradient.numpy(), self._mean.numpy(), self._square.numpy()

    def step(self) -> None:
        """Take one step down the gradient."""
        self._steps += 1.0
        with no_subnormals():
            machine_code(take_step)(*self._arrays, self.learning_rate, self._steps.item())


def take_step(
    parameters: Singles1, gradient: Singles1, mean: Singles1, square: Singles1, rate: float, steps: float
) -> None:
    """Take a step of Adam, the one of that number.

    Source: Kingma and Ba, "Adam: a method for stochastic optimization", 2015, Algorithm 1.
    """
    kept, new = np.float32(BETA_1), np.float32(1.0 - BETA_1)
    kept_square, new_square = np.float32(BETA_2), np.float32(1.0 - BETA_2)
    size = np.float32(rate / (1.0 - BETA_1**steps))
    scale = np.float32(1.0 / math.sqrt(1.0 - BETA_2**steps))
    epsilon = np.float32(EPSILON)
    for place in range(len(parameters)):
        slope = gradient[place]
        mean[place] = kept * mean[place] + new * slope
        square[place] = kept_square * square[place] + new_square * slope * slope
        parameters[place] -= size * mean[place] / (np.sqrt(square[place]) * scale + epsilon)


class ModuleAdam:
    """PyTorch's fused Adam on those parameters of a module that have a gradient."""

    def __init__(self, parameters: Iterable[nn.Parameter]) -> None:
        learning = [parameter for parameter in parameters if parameter.requires_grad]
        self._adam = torch.optim.Adam(learning, betas=(BETA_1, BETA_2), eps=EPSILON, fused=True)

    @property
    def learning_rate(self) -> float:
        """The rate of the next step."""
        rate: float = self._adam.param_groups[0]["lr"]
        return rate

    @learning_rate.setter
    def learning_rate(self, rate: float) -> None:
        self._adam.param_groups[0]["lr"] = rate

    def step(self) -> None:
        """Take one step down the gradient.

        Raises:
            DivergedError: the gradient is not finite; the parameters are left as they were.
        """
        parameters: list[nn.Parameter] = self._adam.param_groups[0]["params"]
        gradients = [parameter.grad for parameter in parameters if parameter.grad is not None]
        # The sum of all is NaN or infinite if one of them is.
        if not torch.stack([gradient.sum() for gradient in gradients]).sum().isfinite():
            raise DivergedError("the gradient is not finite")
        # The first step creates its running means, which must not be inference-mode tensors.
        with torch.inference_mode(False), no_subnormals():
            self._adam.step()

    def get_state(self) -> dict[str, Any]:
        """Return a copy of PyTorch's own state."""
        state = self._adam.state_dict()
        copied = {
            index: {key: value.cpu().clone() for key, value in one.items()}
            for index, one in state["state"].items()
        }
        return {"state": copied, "learning_rate": self.learning_rate}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Take over what `get_state` gave."""
        groups = self._adam.state_dict()["param_groups"]
        self._adam.load_state_dict({"state": state["state"], "param_groups": groups})
        self.learning_rate = state["learning_rate"]
