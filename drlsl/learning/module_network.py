"""A Q-network from any PyTorch module, learning by autograd."""

import copy
from collections.abc import Mapping, Sequence
from typing import Any, Final, Self

import torch
from torch import nn

from drlsl.errors import UserError
from drlsl.files import users_code
from drlsl.learning.adam import ModuleAdam
from drlsl.learning.config import Precision
from drlsl.learning.loss import find_gradient

ROWS: Final = (1, 3)
"""Number of observations that a module is tested with before training."""

NEAR: Final = {"rtol": 1e-3, "atol": 1e-4}
"""Tolerance between the values of a rebuilt module and those that were saved."""


class RandomStream:
    """A separate state of PyTorch's global random numbers, in use while a module computes.

    As a context manager it replaces the state of PyTorch's global generators.
    """

    def __init__(self, seed: int, device: torch.device) -> None:
        self._devices = [torch.cuda.current_device()] if device.type == "cuda" else []
        generators = [torch.Generator(), *(torch.Generator(device) for _ in self._devices)]
        self._states = [generator.manual_seed(seed).get_state() for generator in generators]

    def __enter__(self) -> None:
        # Not fork_rng: what it does besides would take as long as a layer.
        self._outer = self._global_states()
        self._put(self._states)

    def __exit__(self, *exception: object) -> None:
        self._states = self._global_states()
        self._put(self._outer)

    def _global_states(self) -> list[torch.Tensor]:
        return [torch.get_rng_state(), *(torch.cuda.get_rng_state(one) for one in self._devices)]

    def _put(self, states: Sequence[torch.Tensor]) -> None:
        torch.set_rng_state(states[0])
        for device, state in zip(self._devices, states[1:], strict=True):
            torch.cuda.set_rng_state(state, device)

    def get_state(self) -> list[torch.Tensor]:
        """Return the state of the stream."""
        return [state.clone() for state in self._states]

    def set_state(self, states: Sequence[torch.Tensor]) -> None:
        """Take over what `get_state` gave; on a device that was not saved, the stream keeps its state."""
        self._states = [*states[: len(self._states)], *self._states[len(states) :]]


class ModuleNetwork:
    """A module that learns by autograd, and the stream of random numbers that it draws from.

    It is in training mode for an update and in evaluation mode when it acts, unless it explores by its own
    noise: if the module, or parts of it, have a method `reset_noise`, that is called before every step and
    every update, and the module acts in training mode, too.
    """

    steady = False
    """What a module depends on is its own affair."""

    def __init__(self, module: nn.Module, name: str, shape: Sequence[int], stream: RandomStream) -> None:
        """Wrap a module whose observations have a shape, (S,) or (window, S); `name` is for messages."""
        self.module = module
        self._parameters = list(module.parameters())
        self._name = name
        self._shape = tuple(shape)
        self._stream = stream
        self._noise = _parts_with_noise(module)
        self._drawn = False
        self._precision: Precision = "float32"

    @property
    def noisy(self) -> bool:
        """True if it explores by noise of its own."""
        return bool(self._noise)

    def twin(self) -> Self:
        """Return an equal network, with a module of its own and the same stream.

        Raises:
            UserError: the module cannot be copied.
        """
        return type(self)(_copied(self.module, self._name), self._name, self._shape, self._stream)

    def copy_from(self, other: Self) -> None:
        """Take over the values of another network of its kind."""
        self.module.load_state_dict(other.module.state_dict())

    def optimiser(self) -> ModuleAdam:
        """Make the optimiser of this network."""
        return ModuleAdam(self._parameters)

    def learn_in(self, precision: Precision) -> None:
        """Choose the precision of its products in learning, by PyTorch's autocast."""
        self._precision = precision

    def draw_noise(self) -> None:
        """Draw the noise of the parts that have it."""
        if self._noise:
            with torch.inference_mode(False), torch.no_grad(), self._stream:
                for part in self._noise:
                    with users_code(f"{self._name}: its reset_noise() fails"):
                        part.reset_noise()
            self._drawn = True

    def values(self, observations: torch.Tensor) -> torch.Tensor:
        """Return Q-values to act by. Shape: (B, S) to (B, A)."""
        self._set_mode(training=self._drawn)
        return self._run(observations, learning=False)

    def next_values(self, observations: torch.Tensor) -> torch.Tensor:
        """Return Q-values to learn from, in the precision of learning. Shape: (B, S) to (B, A)."""
        self._set_mode(training=self._drawn)
        return self._run(observations, learning=False, precision=self._precision)

    def as_module(self) -> nn.Module:
        """Return the module, in the mode of evaluation and on the processor, for rows of observations."""
        module = _copied(self.module, self._name).eval().cpu()
        return nn.Sequential(nn.Unflatten(1, self._shape), module) if len(self._shape) > 1 else module

    def find_gradient(
        self, observations: torch.Tensor, actions: torch.Tensor, targets: torch.Tensor
    ) -> float:
        """Write the gradient of the loss into the parameters' own, and return the loss.

        Shapes: (B, S), (B,) and (B,).
        """
        return find_gradient(self, observations, actions, targets)

    def forward(self, observations: torch.Tensor) -> list[torch.Tensor]:
        """Return the Q-values, from which `backward` starts. Shape: (B, S) to (B, A)."""
        self._set_mode(training=True)
        return [self._run(observations, learning=True, precision=self._precision)]

    def backward(
        self, observations: torch.Tensor, outputs: Sequence[torch.Tensor], slopes: torch.Tensor
    ) -> None:
        """Write a loss's gradient, whose derivative in each Q-value is `slopes`, into the parameters' own."""
        for parameter in self._parameters:
            parameter.grad = None
        with torch.inference_mode(False), users_code(f"{self._name}: its backward pass fails"):
            torch.autograd.backward(outputs[-1], slopes.clone())

    def get_state(self) -> dict[str, Any]:
        """Return the module's state, its values for a few observations, and its random numbers."""
        weights = {key: value.cpu().clone() for key, value in self.module.state_dict().items()}
        return {"weights": weights, "answers": self._answers(), "random": self._stream.get_state()}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Take over what `get_state` gave; until `draw_noise` there is none.

        Raises:
            ValueError: the state belongs to another module, or to one that gave other values.
        """
        expected = {key: (value.shape, value.dtype) for key, value in self.module.state_dict().items()}
        weights = state.get("weights", {})
        found = {key: (value.shape, value.dtype) for key, value in weights.items()}
        if expected != found:
            unlike = sorted(key for key in expected | found if expected.get(key) != found.get(key))
            raise ValueError(f"the weights do not fit the network: {', '.join(unlike) or 'there are none'}")
        self.module.load_state_dict(weights)
        self._drawn = False
        self._stream.set_state(state["random"])
        if not torch.allclose(self._answers(), state["answers"], equal_nan=True, **NEAR):
            raise ValueError(
                f"{self._name} makes another network than when the weights were saved: it gives other "
                "values with them; put its code back as it was"
            )

    def _answers(self) -> torch.Tensor:
        """Return the module's values for a few fixed observations and noise, in evaluation mode."""
        rows, size = ROWS[-1], torch.Size(self._shape).numel()
        device = self._parameters[0].device
        # Spread over [0, 1] by multiples of the golden ratio, the same with every version of PyTorch.
        observations = (torch.arange(rows * size, dtype=torch.float64) * 0.6180339887).frac().float()
        self._set_mode(training=False)
        with RandomStream(0, device), torch.no_grad():
            return self._called(observations.to(device)).cpu().clone()

    def _set_mode(self, *, training: bool) -> None:
        if self.module.training != training:
            self.module.train(training)

    def _run(
        self, observations: torch.Tensor, *, learning: bool, precision: Precision = "float32"
    ) -> torch.Tensor:
        kind = observations.device.type
        rounding = torch.autocast(kind, torch.bfloat16, enabled=precision == "bfloat16")
        # Tensors that a module keeps from a pass in inference mode would be useless to autograd.
        with torch.inference_mode(False), torch.set_grad_enabled(learning), self._stream, rounding:
            return self._called(observations).float()

    def _called(self, observations: torch.Tensor) -> torch.Tensor:
        with users_code(f"{self._name}: its forward pass fails"):
            values: torch.Tensor = self.module(observations.view(-1, *self._shape))
        return values


def checked_module(made: object, name: str, shape: Sequence[int], actions: int) -> nn.Module:
    """Return the module that a factory made, after testing that it can be trained as a Q-network.

    Raises:
        UserError: it is no module, has no trainable parameters or any not of float32, cannot be copied, or
            does not give finite values of shape (B, `actions`) that depend on them.
    """
    if not isinstance(made, nn.Module):
        raise UserError(f"{name}: expected a torch.nn.Module, got a {type(made).__name__}")
    made.eval()
    _refuse_other_types(made, name)
    for rows in ROWS:
        with torch.no_grad():
            _rehearse(made, name, torch.rand(rows, *shape), actions)
    double = _copied(made, name).train()
    values = _rehearse(double, name, torch.rand(ROWS[-1], *shape), actions)
    if not values.requires_grad:
        raise UserError(f"{name}: its values depend on no parameter that learns")
    with users_code(f"{name}: its backward pass fails"):
        torch.autograd.backward(values, torch.ones_like(values))
    if all(parameter.grad is None for parameter in double.parameters()):
        raise UserError(f"{name}: its values depend on none of its parameters (are all layers attributes?)")
    return made


def _refuse_other_types(module: nn.Module, name: str) -> None:
    if not any(parameter.requires_grad for parameter in module.parameters()):
        raise UserError(f"{name}: the module has no parameters that learn")
    for key, parameter in module.named_parameters():
        if parameter.dtype != torch.float32:
            raise UserError(f"{name}: parameter {key} is {parameter.dtype}, expected torch.float32")
    for key, value in module.state_dict().items():
        if not isinstance(value, torch.Tensor):
            raise UserError(f"{name}: state_dict() holds a {type(value).__name__} as {key}, expected tensors")


def _rehearse(module: nn.Module, name: str, observations: torch.Tensor, actions: int) -> torch.Tensor:
    """Run a module once and return its values, if they are usable."""
    shape = tuple(observations.shape)
    with users_code(f"{name}: its forward pass fails on observations of shape {shape}"):
        values = module(observations)
    expected = (len(observations), actions)
    if not isinstance(values, torch.Tensor) or values.shape != expected or values.dtype != torch.float32:
        got = f"a {type(values).__name__}"
        if isinstance(values, torch.Tensor):
            got = f"{values.dtype} of shape {tuple(values.shape)}"
        raise UserError(f"{name}: expected values of torch.float32 and shape {expected}, got {got}")
    if not values.isfinite().all():
        raise UserError(f"{name}: gives values that are not finite, such as {values.tolist()[0]}")
    return values


def _copied(module: nn.Module, name: str) -> nn.Module:
    with users_code(f"{name}: cannot be copied, as the target network must be"):
        return copy.deepcopy(module)


def _parts_with_noise(module: nn.Module) -> list[Any]:
    """Return the module itself if it has noise to draw, else its parts that do."""
    parts = [part for part in module.modules() if callable(getattr(part, "reset_noise", None))]
    return parts[:1] if parts[:1] == [module] else parts
