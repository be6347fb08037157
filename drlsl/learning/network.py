"""The Q-network: observation in, one value per action out."""

import itertools
from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn


class QNetwork(nn.Module):
    """Fully connected layers with ReLU between them.

    Source: section "Network and Hyperparameters" (256-256-3).
    """

    def __init__(
        self, observation_size: int, hidden: Sequence[int], action_count: int, generator: torch.Generator
    ) -> None:
        super().__init__()
        sizes = itertools.pairwise([observation_size, *hidden, action_count])
        self.layers = nn.ModuleList(_linear(inputs, outputs, generator) for inputs, outputs in sizes)

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Q-values. Shape: (..., S) to (..., A)."""
        *hidden, last = self.layers
        values = observations
        for layer in hidden:
            values = torch.relu(layer(values))
        result: torch.Tensor = last(values)
        return result


def _linear(inputs: int, outputs: int, generator: torch.Generator) -> nn.Linear:
    """A layer drawn as PyTorch draws its own, but from the generator handed in."""
    layer = nn.Linear(inputs, outputs)
    bound = inputs**-0.5
    for parameter in layer.parameters():
        nn.init.uniform_(parameter, -bound, bound, generator=generator)
    return layer


class Policy:
    """Q-values of one observation at a time, without a graph."""

    def __init__(self, network: QNetwork, device: torch.device) -> None:
        self._network = network
        self._device = device

    @torch.inference_mode()
    def values(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Q-values of an observation. Shape: (S,) to (A,).

        Raises:
            ValueError: the observation is not finite.
        """
        if not np.isfinite(observation).all():
            raise ValueError(f"the observation is not finite: {observation}")
        values: NDArray[np.float32] = (
            self._network(torch.from_numpy(observation).to(self._device)).cpu().numpy()
        )
        return values
