"""The Q-network: observation in, one value per action out."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray


class Layer(NamedTuple):
    """A fully connected layer, as views of a network's vector of parameters."""

    weight: torch.Tensor  # Shape: (inputs, outputs)
    bias: torch.Tensor  # Shape: (outputs,)

    def __call__(self, values: torch.Tensor) -> torch.Tensor:
        """Shape: (B, inputs) to (B, outputs)."""
        return torch.addmm(self.bias, values, self.weight)


class QNetwork:
    """Fully connected layers with ReLU between them, their parameters in one vector.

    One vector, because the optimiser and the copy into the target network are then one call each. It asks for
    no gradient: `backward` gives it.

    Source: section "Network and Hyperparameters" (256-256-3).
    """

    def __init__(
        self,
        observation_size: int,
        hidden: Sequence[int],
        action_count: int,
        generator: torch.Generator,
        device: torch.device,
    ) -> None:
        self.sizes = (observation_size, *hidden, action_count)
        count = sum(inputs * outputs + outputs for inputs, outputs in itertools.pairwise(self.sizes))
        self.parameters = torch.zeros(count, device=device)
        self.layers = self.layers_of(self.parameters)
        for layer in self.layers:
            _draw(layer, generator)

    def layers_of(self, vector: torch.Tensor) -> tuple[Layer, ...]:
        """A vector of parameters, or of their gradient, seen as layers."""
        return tuple(_layers(self.sizes, vector))

    def forward(self, observations: torch.Tensor) -> list[torch.Tensor]:
        """What each layer gives, hidden layers after their ReLU; the Q-values are last.

        Shape: (B, S) to (B, width) for each layer, (B, A) for the last.
        """
        outputs = []
        values = observations
        for layer in self.layers[:-1]:
            values = layer(values).relu_()
            outputs.append(values)
        return [*outputs, self.layers[-1](values)]

    def backward(
        self,
        observations: torch.Tensor,
        outputs: Sequence[torch.Tensor],
        slopes: torch.Tensor,
        gradient: Sequence[Layer],
    ) -> None:
        """Write a loss's gradient in the parameters into `gradient`.

        Autograd gives the same gradient (tests/learning/test_network.py), at 1.6 times the cost of a whole
        update: docs/training.md, Speed.

        Args:
            observations: what `forward` was given.
            outputs: what it gave.
            slopes: the loss's derivative in each Q-value. Shape: (B, A).
            gradient: layers of a vector, see `layers_of`; overwritten.
        """
        for index in reversed(range(len(self.layers))):
            inputs = outputs[index - 1] if index else observations
            torch.mm(inputs.t(), slopes, out=gradient[index].weight)
            torch.sum(slopes, 0, out=gradient[index].bias)
            if index:
                slopes = torch.mm(slopes, self.layers[index].weight.t())
                # ReLU's derivative: 0 wherever it gave 0.
                slopes = torch.ops.aten.threshold_backward(slopes, inputs, 0)

    def get_state(self) -> dict[str, torch.Tensor]:
        """The parameters by layer, named and laid out as PyTorch's Linear has them."""
        state = {}
        for index, layer in enumerate(self.layers):
            state[f"layers.{index}.weight"] = layer.weight.t().contiguous().cpu().clone()
            state[f"layers.{index}.bias"] = layer.bias.cpu().clone()
        return state

    def set_state(self, state: Mapping[str, torch.Tensor]) -> None:
        """Take over what `get_state` gave.

        Raises:
            ValueError: the state belongs to a network of another shape.
        """
        mine = {name: value.shape for name, value in self.get_state().items()}
        theirs = {name: value.shape for name, value in state.items()}
        if mine != theirs:
            raise ValueError(f"parameters of shapes {theirs}, expected {mine}")
        for index, layer in enumerate(self.layers):
            layer.weight.copy_(state[f"layers.{index}.weight"].t())
            layer.bias.copy_(state[f"layers.{index}.bias"])


def _layers(sizes: Sequence[int], vector: torch.Tensor) -> Iterator[Layer]:
    start = 0
    for inputs, outputs in itertools.pairwise(sizes):
        middle = start + inputs * outputs
        stop = middle + outputs
        # With its longer side laid out in rows, a narrow layer's gradient costs a fifth.
        weight = vector[start:middle].view(min(inputs, outputs), max(inputs, outputs))
        yield Layer(weight if inputs < outputs else weight.t(), vector[middle:stop])
        start = stop


def _draw(layer: Layer, generator: torch.Generator) -> None:
    """Draw a layer as PyTorch draws its own, but from the generator handed in."""
    inputs, outputs = layer.weight.shape
    bound = inputs**-0.5
    layer.weight.copy_(torch.empty(outputs, inputs).uniform_(-bound, bound, generator=generator).t())
    layer.bias.copy_(torch.empty(outputs).uniform_(-bound, bound, generator=generator))


class Policy:
    """Q-values of observations; it follows the network as that is trained."""

    def __init__(self, network: QNetwork, device: torch.device) -> None:
        self._network = network
        self._device = device

    @torch.inference_mode()
    def values(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """Q-values of N observations. Shape: (N, S) to (N, A).

        Raises:
            ValueError: an observation is not finite.
        """
        if not np.isfinite(observations).all():
            raise ValueError(f"an observation is not finite: {observations}")
        values = self._network.forward(torch.from_numpy(observations).to(self._device))[-1]
        result: NDArray[np.float32] = values.cpu().numpy()
        return result
