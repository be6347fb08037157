"""The Q-network: observation in, one value per action out."""

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from drlsl.config import NetworkConfig

SPREAD: Final = 0.5
"""A weight's spread to begin with, times the root of its layer's inputs. Source: Fortunato et al., 2018."""


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
    no gradient: `backward` writes it into `gradient`, laid out as the parameters.

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
        self.gradient = torch.zeros(count, device=device)
        self.layers = tuple(_layers(self.sizes, self.parameters))
        self._slopes = tuple(_layers(self.sizes, self.gradient))
        for layer in self.layers:
            _draw(layer, generator)

    def draw_noise(self) -> None:
        """Take other weights for what follows; here there is no noise in them."""

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
    ) -> None:
        """Write a loss's gradient in the parameters into `gradient`.

        Autograd gives the same gradient (tests/learning/test_network.py), at 1.6 times the cost of a whole
        update: docs/training.md, Speed.

        Args:
            observations: what `forward` was given.
            outputs: what it gave.
            slopes: the loss's derivative in each Q-value. Shape: (B, A).
        """
        for index in reversed(range(len(self.layers))):
            inputs = outputs[index - 1] if index else observations
            torch.mm(inputs.t(), slopes, out=self._slopes[index].weight)
            torch.sum(slopes, 0, out=self._slopes[index].bias)
            if index:
                # ReLU's derivative: 1 wherever it gave more than 0, else 0.
                slopes = torch.mm(slopes, self.layers[index].weight.t()).mul_(inputs.sign())

    def get_state(self) -> dict[str, torch.Tensor]:
        """The parameters by layer, named and laid out as PyTorch's Linear has them."""
        return _state(self.layers)

    def set_state(self, state: Mapping[str, torch.Tensor]) -> None:
        """Take over what `get_state` gave.

        Raises:
            ValueError: the state belongs to a network of another shape.
        """
        _check(self.get_state(), state)
        _take(self.layers, state)


class NoisyQNetwork(QNetwork):
    """A network whose weights are drawn anew, each around its mean with a spread that is learnt too.

    The weights in use are mean + spread · noise. `parameters` holds all means and then all spreads, each laid
    out as the weights are. The noise of a weight is that of its input times that of its output, as the paper
    has it for speed: far fewer numbers are drawn than there are weights. Until `draw_noise` there is none.

    Source: Fortunato et al., "Noisy networks for exploration", 2018, factorised noise.
    """

    def __init__(
        self,
        observation_size: int,
        hidden: Sequence[int],
        action_count: int,
        generator: torch.Generator,
        device: torch.device,
    ) -> None:
        super().__init__(observation_size, hidden, action_count, generator, device)
        self._generator = generator
        self._weights, self._weights_gradient = self.parameters, self.gradient
        count = len(self._weights)
        self.parameters, self.gradient = torch.zeros(2, 2 * count, device=device)
        self._mean, self._spread = torch.split(self.parameters, count)
        self._mean.copy_(self._weights)
        self._noise = torch.zeros(count, device=device)
        self._noise_layers = tuple(_layers(self.sizes, self._noise))
        for layer in _layers(self.sizes, self._spread):
            for part in layer:
                part.fill_(SPREAD * layer.weight.shape[0] ** -0.5)

    def draw_noise(self) -> None:
        """Draw all weights anew."""
        ends = sum(self.sizes[:-1]) + sum(self.sizes[1:])
        drawn = torch.randn(ends, generator=self._generator).to(self._noise.device)
        # Source: Fortunato et al., f(x) = sgn(x) √|x|.
        parts = torch.split(drawn.sign() * drawn.abs().sqrt(), [*self.sizes[:-1], *self.sizes[1:]])
        depth = len(self._noise_layers)
        for layer, inputs, outputs in zip(self._noise_layers, parts[:depth], parts[depth:], strict=True):
            torch.outer(inputs, outputs, out=layer.weight)
            layer.bias.copy_(outputs)
        self._use()

    def backward(
        self, observations: torch.Tensor, outputs: Sequence[torch.Tensor], slopes: torch.Tensor
    ) -> None:
        """Write a loss's gradient in means and spreads into `gradient`; see `QNetwork.backward`."""
        super().backward(observations, outputs, slopes)
        mean, spread = torch.split(self.gradient, len(self._mean))
        mean.copy_(self._weights_gradient)
        torch.mul(self._weights_gradient, self._noise, out=spread)

    def get_state(self) -> dict[str, torch.Tensor]:
        """Means and spreads by layer, named and laid out as PyTorch's Linear has them."""
        return _state(_layers(self.sizes, self._mean)) | _state(_layers(self.sizes, self._spread), "spread.")

    def set_state(self, state: Mapping[str, torch.Tensor]) -> None:
        """Take over what `get_state` gave; the weights in use are the means until `draw_noise`.

        Raises:
            ValueError: the state belongs to a network of another shape.
        """
        _check(self.get_state(), state)
        _take(_layers(self.sizes, self._mean), state)
        _take(_layers(self.sizes, self._spread), state, "spread.")
        self._noise.zero_()
        self._use()

    def _use(self) -> None:
        torch.addcmul(self._mean, self._spread, self._noise, out=self._weights)


def make_network(
    config: NetworkConfig,
    observation_size: int,
    action_count: int,
    generator: torch.Generator,
    device: torch.device,
) -> QNetwork:
    """The network of a configuration, untrained."""
    kind = NoisyQNetwork if config.noisy else QNetwork
    return kind(observation_size, config.hidden, action_count, generator, device)


def _state(layers: Iterable[Layer], prefix: str = "") -> dict[str, torch.Tensor]:
    state = {}
    for index, layer in enumerate(layers):
        state[f"{prefix}layers.{index}.weight"] = layer.weight.t().contiguous().cpu().clone()
        state[f"{prefix}layers.{index}.bias"] = layer.bias.cpu().clone()
    return state


def _take(layers: Iterable[Layer], state: Mapping[str, torch.Tensor], prefix: str = "") -> None:
    for index, layer in enumerate(layers):
        layer.weight.copy_(state[f"{prefix}layers.{index}.weight"].t())
        layer.bias.copy_(state[f"{prefix}layers.{index}.bias"])


def _check(mine: Mapping[str, torch.Tensor], theirs: Mapping[str, torch.Tensor]) -> None:
    expected = {name: value.shape for name, value in mine.items()}
    found = {name: value.shape for name, value in theirs.items()}
    if expected != found:
        raise ValueError(f"parameters of shapes {found}, expected {expected}")


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
