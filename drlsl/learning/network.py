"""The Q-network: observations in, one value per action out.

Any module learns by autograd (module_network.py). The paper's network has its gradient written out here,
because by autograd an update takes 1.4 times as long: docs/training.md, Speed. In bfloat16 on a processor
compiled_pass.py computes it.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from drlsl.driving.drivers import Situations
from drlsl.errors import UserError
from drlsl.learning import architectures
from drlsl.learning.adam import Adam, CompiledAdam, Optimiser
from drlsl.learning.architectures import SPREAD
from drlsl.learning.compiled_pass import CompiledPass, can_compile
from drlsl.learning.config import NetworkConfig, Precision
from drlsl.learning.divergence import check_values
from drlsl.learning.layers import Layer, count_parameters, layers_of
from drlsl.learning.loss import find_gradient
from drlsl.learning.module_network import ModuleNetwork, RandomStream, checked_module
from drlsl.learning.network_factory import call_factory


class Network(Protocol):
    """The interface that an agent needs of a network."""

    @property
    def steady(self) -> bool:
        """True if its values in learning depend on nothing but its weights and the observations."""

    def optimiser(self) -> Optimiser:
        """Make the optimiser of this network."""

    def learn_in(self, precision: Precision) -> None:
        """Choose the precision of its products in learning, which is float32 to begin with."""

    def draw_noise(self) -> None:
        """Draw the noise of the weights anew, if there is any."""

    def values(self, observations: torch.Tensor) -> torch.Tensor:
        """Return Q-values to act by. Shape: (B, S) to (B, A)."""

    def next_values(self, observations: torch.Tensor) -> torch.Tensor:
        """Return Q-values to learn from, in the precision of learning. Shape: (B, S) to (B, A)."""

    def as_module(self) -> nn.Module:
        """Return a module with the same values. Shape: (B, S) to (B, A)."""

    def find_gradient(
        self, observations: torch.Tensor, actions: torch.Tensor, targets: torch.Tensor
    ) -> float:
        """Compute the gradient of the loss, for the optimiser's next step, and return the loss.

        Shapes: (B, S), (B,) and (B,).
        """

    def copy_from(self, other: Any) -> None:
        """Take over the values of another network of its kind."""

    def get_state(self) -> dict[str, Any]:
        """Return all that its values depend on, in plain types and tensors."""

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Take over what `get_state` gave.

        Raises:
            ValueError: the state belongs to another network.
        """


class _InnerLayers:
    """The layers between hidden ones, and their gradient, rounded to bfloat16."""

    def __init__(self, sizes: Sequence[int], parameters: torch.Tensor, gradient: torch.Tensor) -> None:
        first, last = sizes[:2], sizes[-2:]
        inner = slice(count_parameters(first), len(parameters) - count_parameters(last))
        self._parameters, self._gradient = parameters[inner], gradient[inner]
        self._rounded = self._parameters.bfloat16()
        self._rounded_gradient = self._gradient.bfloat16()
        self.layers = tuple(layers_of(sizes[1:-1], self._rounded))
        self.slopes = tuple(layers_of(sizes[1:-1], self._rounded_gradient))

    def round_weights(self) -> None:
        """Make the layers those of the parameters of now."""
        self._rounded.copy_(self._parameters)

    def write_gradient(self) -> None:
        """Write their gradient into the network's."""
        self._gradient.copy_(self._rounded_gradient)


class QNetwork:
    """Fully connected layers with ReLU between them, their parameters in one vector.

    With one vector, the optimiser and the copy into the target network are one call each. Autograd is not
    used: `backward` writes the gradient into `gradient`, laid out as the parameters. Learning in bfloat16,
    the layers between hidden ones take and give numbers of that type, rounded from the parameters, which stay
    of float32.

    Source: section "Network and Hyperparameters" (256-256-3).
    """

    steady = True

    def __init__(
        self,
        observation_size: int,
        hidden: Sequence[int],
        action_count: int,
        generator: torch.Generator,
        device: torch.device,
    ) -> None:
        self.sizes = (observation_size, *hidden, action_count)
        parameters = torch.zeros(count_parameters(self.sizes), device=device)
        self._lie_in(parameters, torch.zeros_like(parameters))
        self._begin(generator)

    def _begin(self, generator: torch.Generator) -> None:
        """Draw the first parameters."""
        for layer in self.layers:
            _draw(layer, generator)

    def _lie_in(self, parameters: torch.Tensor, gradient: torch.Tensor) -> None:
        self.parameters, self.gradient = parameters, gradient
        self.layers = self._used = tuple(layers_of(self.sizes, parameters))
        self._whole_slopes = self._slopes = tuple(layers_of(self.sizes, gradient))
        self._inner: _InnerLayers | None = None
        self._compiles = False
        self._pass: CompiledPass | None = None
        self._weights, self._weights_gradient = parameters, gradient

    def move(self, parameters: torch.Tensor, gradient: torch.Tensor) -> None:
        """Move to other memory, vectors of the same length, to learn there in float32.

        An optimiser made before does not follow.
        """
        parameters.copy_(self.parameters)
        self._lie_in(parameters, gradient)

    def optimiser(self) -> Adam:
        """Make the optimiser of this network."""
        kind = CompiledAdam if self._compiles else Adam
        return kind(self.parameters, self.gradient)

    def learn_in(self, precision: Precision) -> None:
        """Choose the precision of its products in learning; without layers between hidden ones, float32."""
        self._inner, self._used, self._slopes = None, self.layers, self._whole_slopes
        if precision == "bfloat16" and len(self.layers) > 2:
            self._inner = inner = _InnerLayers(self.sizes, self._weights, self._weights_gradient)
            self._used = (self.layers[0], *inner.layers, self.layers[-1])
            self._slopes = (self._slopes[0], *inner.slopes, self._slopes[-1])
        self._compiles, self._pass = self._inner is not None and can_compile(self._used), None

    def draw_noise(self) -> None:
        """Do nothing: there is no noise in these weights."""

    def copy_from(self, other: "QNetwork") -> None:
        """Take over the parameters of a network of the same shape."""
        self.parameters.copy_(other.parameters)

    def values(self, observations: torch.Tensor) -> torch.Tensor:
        """Return Q-values to act by. Shape: (B, S) to (B, A)."""
        return _outputs(self.layers, observations)[-1]

    def next_values(self, observations: torch.Tensor) -> torch.Tensor:
        """Return Q-values to learn from, in the precision of learning. Shape: (B, S) to (B, A)."""
        return self.forward(observations)[-1]

    def as_module(self) -> nn.Module:
        """Return linear layers of PyTorch with ReLU between them, on the processor."""
        parts: list[nn.Module] = []
        for layer in self.layers:
            linear = nn.Linear(*layer.weight.shape)
            linear.load_state_dict({"weight": layer.weight.t(), "bias": layer.bias})
            parts += [linear, nn.ReLU()]
        return nn.Sequential(*parts[:-1])

    def forward(self, observations: torch.Tensor) -> list[torch.Tensor]:
        """Return the output of each layer, hidden layers after their ReLU; the Q-values are last.

        Shape: (B, S) to (B, width) for each layer, (B, A) for the last.
        """
        if self._inner is not None:
            self._inner.round_weights()
        return _outputs(self._used, observations)

    def find_gradient(
        self, observations: torch.Tensor, actions: torch.Tensor, targets: torch.Tensor
    ) -> float:
        """Write the gradient of the loss into `gradient`, and return the loss.

        Shapes: (B, S), (B,) and (B,).
        """
        if not self._compiles or self._inner is None:
            return find_gradient(self, observations, actions, targets)
        if self._pass is None or self._pass.rows != len(observations):
            self._pass = CompiledPass(self._used, self._slopes, len(observations))
        self._inner.round_weights()
        loss = self._pass.find_gradient(observations, actions, targets)
        self._finish_gradient()
        return loss

    def backward(
        self,
        observations: torch.Tensor,
        outputs: Sequence[torch.Tensor],
        slopes: torch.Tensor,
    ) -> None:
        """Write the gradient of a loss with respect to the parameters into `gradient`.

        Autograd gives the same gradient (tests/learning/test_network.py), but an update takes longer with it:
        docs/training.md, Speed.

        Args:
            observations: the input of `forward`.
            outputs: its result.
            slopes: the loss's derivative with respect to each Q-value. Shape: (B, A).
        """
        for index, layer in reversed(list(enumerate(self._used))):
            kind = layer.weight.dtype
            inputs, slopes = (outputs[index - 1] if index else observations).to(kind), slopes.to(kind)
            torch.mm(inputs.t(), slopes, out=self._slopes[index].weight)
            torch.sum(slopes, 0, out=self._slopes[index].bias)
            if index:
                # ReLU's derivative: 1 where its output is more than 0, else 0.
                slopes = torch.mm(slopes, layer.weight.t()).mul_(inputs.sign())
        self._finish_gradient()

    def _finish_gradient(self) -> None:
        """Write into `gradient` what is not yet there."""
        if self._inner is not None:
            self._inner.write_gradient()

    def get_state(self) -> dict[str, torch.Tensor]:
        """Return the parameters by layer, named and laid out as in PyTorch's Linear."""
        return _state(self.layers)

    def set_state(self, state: Mapping[str, torch.Tensor]) -> None:
        """Take over what `get_state` gave.

        Raises:
            ValueError: the state belongs to a network of another shape.
        """
        _check(self.get_state(), state)
        _take(self.layers, state)


class NoisyQNetwork(QNetwork):
    """A network with noisy weights: each is drawn around its mean with a spread that is learnt, too.

    The weights in use are mean + spread · noise. `parameters` holds all means and then all spreads, each laid
    out as the weights are. The noise of a weight is that of its input times that of its output, for speed, as
    in the paper: far fewer numbers are drawn than there are weights. Before `draw_noise` it is 0.

    Source: Fortunato et al., "Noisy networks for exploration", 2018, factorised noise.
    """

    steady = False

    def _begin(self, generator: torch.Generator) -> None:
        super()._begin(generator)
        self._generator = generator
        count, device = len(self._weights), self._weights.device
        self.parameters, self.gradient = torch.zeros(2, 2 * count, device=device)
        self._mean, self._spread = torch.split(self.parameters, count)
        self._mean.copy_(self._weights)
        self._noise = torch.zeros(count, device=device)
        self._noise_layers = tuple(layers_of(self.sizes, self._noise))
        for layer in layers_of(self.sizes, self._spread):
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

    def _finish_gradient(self) -> None:
        """Write the gradient with respect to means and spreads, from that of the weights in use."""
        super()._finish_gradient()
        mean, spread = torch.split(self.gradient, len(self._mean))
        mean.copy_(self._weights_gradient)
        torch.mul(self._weights_gradient, self._noise, out=spread)

    def get_state(self) -> dict[str, torch.Tensor]:
        """Return means and spreads by layer, named and laid out as in PyTorch's Linear."""
        return _state(layers_of(self.sizes, self._mean)) | _state(
            layers_of(self.sizes, self._spread), "spread."
        )

    def set_state(self, state: Mapping[str, torch.Tensor]) -> None:
        """Take over what `get_state` gave; the weights in use are the means until `draw_noise`.

        Raises:
            ValueError: the state belongs to a network of another shape.
        """
        _check(self.get_state(), state)
        _take(layers_of(self.sizes, self._mean), state)
        _take(layers_of(self.sizes, self._spread), state, "spread.")
        self._noise.zero_()
        self._use()

    def _use(self) -> None:
        torch.addcmul(self._mean, self._spread, self._noise, out=self._weights)


def make_networks(
    config: NetworkConfig,
    observation_size: int,
    action_count: int,
    generator: torch.Generator,
    device: torch.device,
) -> tuple[Network, Network]:
    """Make the network of a configuration, untrained, and a target network of equal values.

    Raises:
        UserError: the configuration's own factory cannot be found or called, or makes no Q-network.
    """
    if config.factory == "mlp":
        kind = NoisyQNetwork if config.noisy else QNetwork
        size = config.window * observation_size
        network, target = (kind(size, config.hidden, action_count, generator, device) for _ in range(2))
        target.copy_from(network)
        return network, target
    module = _module_network(config, observation_size, action_count, generator, device)
    return module, module.twin()


def _module_network(
    config: NetworkConfig,
    observation_size: int,
    action_count: int,
    generator: torch.Generator,
    device: torch.device,
) -> ModuleNetwork:
    """Return the network of a configuration as a module that learns by autograd."""
    name = f"network.factory {config.factory}"
    shape = (observation_size,) if config.window == 1 else (config.window, observation_size)
    stream = RandomStream(int(torch.randint(2**62, (), generator=generator)), device)
    with stream:
        made: object
        if config.built_in:
            shape = (config.window * observation_size,)
            made = architectures.dueling(shape[0], action_count, config.hidden, noisy=config.noisy)
        else:
            made = call_factory(config, observation_size, action_count)
        module = checked_module(made, name, shape, action_count)
    network = ModuleNetwork(module.to(device), name, shape, stream)
    if config.noisy and not network.noisy:
        raise UserError(f"{name}: network.noisy is set, but the module has no method reset_noise()")
    return network


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


def _check(mine: Mapping[str, torch.Tensor], theirs: Mapping[str, Any]) -> None:
    expected = {name: tuple(value.shape) for name, value in mine.items()}
    found = {name: tuple(getattr(value, "shape", ())) for name, value in theirs.items()}
    if expected != found:
        raise ValueError(f"the weights do not fit the network: found {found}, expected {expected}")


def _outputs(layers: Sequence[Layer], observations: torch.Tensor) -> list[torch.Tensor]:
    """Return the output of each layer, hidden ones after their ReLU."""
    outputs = []
    values = observations
    for layer in layers[:-1]:
        values = layer(values).relu_()
        outputs.append(values)
    return [*outputs, layers[-1](values)]


def _draw(layer: Layer, generator: torch.Generator) -> None:
    """Draw a layer's weights as PyTorch does, but from the given generator."""
    inputs, outputs = layer.weight.shape
    bound = inputs**-0.5
    layer.weight.copy_(torch.empty(outputs, inputs).uniform_(-bound, bound, generator=generator).t())
    layer.bias.copy_(torch.empty(outputs).uniform_(-bound, bound, generator=generator))


def check_finite(observations: NDArray[np.float32]) -> None:
    """Check that observations are finite.

    Raises:
        ValueError: one is not.
    """
    if not np.isfinite(observations).all():
        raise ValueError(f"an observation is not finite: {observations}")


class Policy:
    """The Q-values of observations; it follows the network while that is trained."""

    def __init__(self, network: Network, device: torch.device, window: int = 1) -> None:
        self._network = network
        self._device = device
        self.window = window
        """Number of observations in one row, the latest last."""

    @torch.inference_mode()
    def values(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return Q-values of N observations, or windows of them. Shape: (N, window · S) to (N, A).

        Raises:
            ValueError: an observation is not finite.
        """
        check_finite(observations)
        values = self._network.values(torch.from_numpy(observations).to(self._device))
        result: NDArray[np.float32] = values.cpu().numpy()
        return result

    def module(self) -> nn.Module:
        """Return a module with the same values: rows of observations in, Q-values out."""
        return self._network.as_module()

    def preferences(self, situations: Situations) -> NDArray[np.float32]:
        """Return the Q-values of what is seen, as a driver.

        Raises:
            DivergedError: one is not finite.
            ValueError: an observation is not finite.
        """
        values = self.values(situations.observations)
        check_values(values)
        return values
