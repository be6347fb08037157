"""Adam on one vector of parameters."""

from collections.abc import Mapping
from typing import Any, Final

import torch
from torch.optim.adam import adam

BETA_1: Final = 0.9
BETA_2: Final = 0.999
EPSILON: Final = 1e-8
"""PyTorch's defaults, and so the paper's as far as it tells."""


class Adam:
    """PyTorch's fused Adam by its functional form, without the bookkeeping of the optimiser class.

    The class would make an update 4% slower (docs/training.md, Speed). `parameters` are changed in place by
    each `step` against `gradient`.
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
        adam(
            [self._parameters],
            [self._gradient],
            [self._mean],
            [self._square],
            [],
            [self._steps],
            fused=True,
            lr=self.learning_rate,
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
