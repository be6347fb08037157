"""The Q-network: observation in, one value per action out."""

import itertools
from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn
from torch.nn import functional


class QNetwork(nn.Module):
    """Fully connected layers with ReLU between them.

    Source: section "Network and Hyperparameters" (256-256-3).
    """

    def __init__(
        self, observation_size: int, hidden: Sequence[int], action_count: int, generator: torch.Generator
    ) -> None:
        super().__init__()
        sizes = itertools.pairwise([observation_size, *hidden, action_count])
        layers = [_linear(inputs, outputs, generator) for inputs, outputs in sizes]
        self.layers = nn.ModuleList(layers)
        # Calling a module per layer doubles the time for one observation; the tensors are trained in place.
        self.weights_and_biases = tuple((layer.weight, layer.bias) for layer in layers)

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Q-values. Shape: (..., S) to (..., A)."""
        return _forward(self.weights_and_biases, observations)


def _forward(layers: Sequence[tuple[torch.Tensor, torch.Tensor]], values: torch.Tensor) -> torch.Tensor:
    for weight, bias in layers[:-1]:
        values = functional.linear(values, weight, bias).relu_()
    return functional.linear(values, *layers[-1])


def _linear(inputs: int, outputs: int, generator: torch.Generator) -> nn.Linear:
    """A layer drawn as PyTorch draws its own, but from the generator handed in."""
    layer = nn.Linear(inputs, outputs)
    bound = inputs**-0.5
    for parameter in layer.parameters():
        nn.init.uniform_(parameter, -bound, bound, generator=generator)
    return layer


class Policy:
    """Q-values of one observation at a time, without a graph; it follows the network as that is trained."""

    def __init__(self, network: QNetwork, device: torch.device) -> None:
        self._layers = network.weights_and_biases
        self._device = device

    @torch.inference_mode()
    def values(self, observation: NDArray[np.float32]) -> NDArray[np.float32]:
        """Q-values of an observation. Shape: (S,) to (A,).

        Raises:
            ValueError: the observation is not finite.
        """
        if not np.isfinite(observation).all():
            raise ValueError(f"the observation is not finite: {observation}")
        values = _forward(self._layers, torch.from_numpy(observation).to(self._device))
        result: NDArray[np.float32] = values.cpu().numpy()
        return result
