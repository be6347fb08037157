"""The loss of temporal differences, and a network's gradient of it."""

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import torch


class Loss(NamedTuple):
    """A loss, and its derivative with respect to each Q-value."""

    value: torch.Tensor  # Shape: (...)
    slopes: torch.Tensor  # Shape: (..., B, A)


class Differentiable(Protocol):
    """A network that is run forwards and then backwards."""

    def forward(self, observations: torch.Tensor) -> Sequence[torch.Tensor]:
        """Return what `backward` needs, the Q-values last."""

    def backward(
        self, observations: torch.Tensor, outputs: Sequence[torch.Tensor], slopes: torch.Tensor
    ) -> None:
        """Compute a loss's gradient from its derivative in each Q-value, for the optimiser's next step."""


def td_loss(values: torch.Tensor, actions: torch.Tensor, targets: torch.Tensor) -> Loss:
    """Return the mean squared error of the values of the actions taken.

    Shapes: (..., B, A), (..., B), (..., B).

    Source: Eq. 1.
    """
    taken = actions.unsqueeze(-1)
    errors = values.gather(-1, taken).sub_(targets.unsqueeze(-1))
    slopes = torch.zeros_like(values).scatter_(-1, taken, errors * (2.0 / errors.shape[-2]))
    return Loss(errors.square().mean(dim=(-2, -1)), slopes)


def find_gradient(
    network: Differentiable, observations: torch.Tensor, actions: torch.Tensor, targets: torch.Tensor
) -> float:
    """Compute a network's gradient of the loss, and return the loss. Shapes: (B, S), (B,) and (B,)."""
    outputs = network.forward(observations)
    loss = td_loss(outputs[-1].detach(), actions, targets)
    network.backward(observations, outputs, loss.slopes)
    return loss.value.item()
