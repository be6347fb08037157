"""The work of an update between its products: by PyTorch, or as machine code where that is faster.

In bfloat16 the products take less than half of an update, and PyTorch makes a pass through memory for every
small operation beside them. On a processor, what stands between two of them is one pass each:
docs/training.md, Speed.
"""

from __future__ import annotations

from typing import Final, NamedTuple, Protocol

import numpy as np
import torch
from numpy.typing import NDArray

from drlsl.learning.config import Precision
from drlsl.lowering.backends import Halves1, Halves2, Integers1, Singles1, Singles2, machine_code


class Loss(NamedTuple):
    """A loss, and its derivative with respect to each Q-value."""

    value: torch.Tensor  # Shape: (...)
    slopes: torch.Tensor  # Shape: (..., B, A)


class Elementwise(Protocol):
    """What an update does beside its products and the step of its optimiser."""

    def activate(self, values: torch.Tensor, kind: torch.dtype) -> torch.Tensor:
        """Return ReLU of a layer's outputs, in the type of the next layer. Shape: (B, width) to the same.

        `values` may be overwritten.
        """

    def td_loss(self, values: torch.Tensor, actions: torch.Tensor, targets: torch.Tensor) -> Loss:
        """Return the mean squared error of the values of the actions taken. Shapes: (B, A), (B,), (B,).

        Raises:
            IndexError: there is no such action; RuntimeError by PyTorch.

        Source: Eq. 1.
        """

    def slopes_before(
        self, slopes: torch.Tensor, activated: torch.Tensor, bias: torch.Tensor
    ) -> torch.Tensor:
        """Return the loss's derivatives in a layer's outputs from those in what `activate` made of them.

        Their sum over the rows is written into `bias`, whose type they take. Shapes: (B, width), (B, width)
        and (width,) to (B, width). `slopes` may be overwritten.
        """


class ByPyTorch:
    """PyTorch's own operations, on any device and in any types."""

    def activate(self, values: torch.Tensor, kind: torch.dtype) -> torch.Tensor:
        """Return ReLU of a layer's outputs; see `Elementwise`."""
        return values.relu_().to(kind)

    def td_loss(self, values: torch.Tensor, actions: torch.Tensor, targets: torch.Tensor) -> Loss:
        """Return the mean squared errors of one network, or of each of several; see `Elementwise`.

        Shapes: (..., B, A), (..., B), (..., B).
        """
        taken = actions.unsqueeze(-1)
        errors = values.gather(-1, taken).sub_(targets.unsqueeze(-1))
        slopes = torch.zeros_like(values).scatter_(-1, taken, errors * (2.0 / errors.shape[-2]))
        return Loss(errors.square().mean(dim=(-2, -1)), slopes)

    def slopes_before(
        self, slopes: torch.Tensor, activated: torch.Tensor, bias: torch.Tensor
    ) -> torch.Tensor:
        """Return the derivatives in a layer's outputs; see `Elementwise`."""
        # ReLU's derivative: 1 where its output is more than 0, else 0.
        before = slopes.mul_(activated.sign()).to(bias.dtype)
        torch.sum(before, 0, out=bias)
        return before


class ByMachineCode(ByPyTorch):
    """Machine code for the loss, and where values pass from float32 to bfloat16 or back; on a processor."""

    def activate(self, values: torch.Tensor, kind: torch.dtype) -> torch.Tensor:
        """Return ReLU of a layer's outputs; see `Elementwise`."""
        if values.dtype == kind:
            return super().activate(values, kind)
        result = torch.empty_like(values, dtype=kind)
        if kind == torch.bfloat16:
            machine_code(activate_in_halves)(values.numpy(), _bits(result))
        else:
            machine_code(activate_in_singles)(_bits(values), result.numpy())
        return result

    def td_loss(self, values: torch.Tensor, actions: torch.Tensor, targets: torch.Tensor) -> Loss:
        """Return the mean squared error of the values of the actions taken; see `Elementwise`."""
        value, slopes = torch.empty(1), torch.empty(values.shape)
        known = machine_code(find_loss)(
            values.contiguous().numpy(),
            actions.contiguous().numpy(),
            targets.contiguous().numpy(),
            value.numpy(),
            slopes.numpy(),
        )
        if not known:
            raise IndexError(f"expected actions from 0 to {values.shape[1] - 1}, got {actions.tolist()}")
        return Loss(value, slopes)

    def slopes_before(
        self, slopes: torch.Tensor, activated: torch.Tensor, bias: torch.Tensor
    ) -> torch.Tensor:
        """Return the derivatives in a layer's outputs; see `Elementwise`."""
        if slopes.dtype == bias.dtype:
            return super().slopes_before(slopes, activated, bias)
        before = torch.empty_like(slopes, dtype=bias.dtype)
        if bias.dtype == torch.bfloat16:
            machine_code(slopes_in_halves)(slopes.numpy(), activated.numpy(), _bits(before), _bits(bias))
        else:
            machine_code(slopes_in_singles)(_bits(slopes), _bits(activated), before.numpy(), bias.numpy())
        return before


BY_PYTORCH: Final = ByPyTorch()


def fastest(precision: Precision, device: torch.device) -> Elementwise:
    """Return the faster way, machine code being ready to run; without Numba it is PyTorch's.

    In float32 it is PyTorch's, so that the numbers stay those of earlier versions.
    """
    if precision == "float32" or device.type != "cpu":
        return BY_PYTORCH
    return ByMachineCode() if all(machine_code(one) is not one for one in _FUNCTIONS) else BY_PYTORCH


def _bits(values: torch.Tensor) -> NDArray[np.uint16]:
    """Return the bits of numbers of bfloat16, in the same memory."""
    bits: NDArray[np.uint16] = values.view(torch.uint16).numpy()
    return bits


def rounded(bits: np.uint32) -> np.uint16:
    """Return the bits of the number of bfloat16 that is nearest to one of float32, of two the even one."""
    if bits & np.uint32(0x7FFFFFFF) > np.uint32(0x7F800000):
        return np.uint16(0x7FC0)  # Not a number stays none, whatever its other bits are.
    odd = (bits >> np.uint32(16)) & np.uint32(1)
    return np.uint16((bits + np.uint32(0x7FFF) + odd) >> np.uint32(16))


def activate_in_halves(values: Singles2, result: Halves2) -> None:
    """Write ReLU of numbers of float32 in bfloat16."""
    bits = values.view(np.uint32)
    for row in range(len(values)):
        for column in range(values.shape[1]):
            # Not a number is let through, to be seen in the loss.
            passed = not values[row, column] <= 0.0
            result[row, column] = rounded(bits[row, column]) if passed else np.uint16(0)


def activate_in_singles(values: Halves2, result: Singles2) -> None:
    """Write ReLU of numbers of bfloat16 in float32."""
    bits = result.view(np.uint32)
    for row in range(len(values)):
        for column in range(values.shape[1]):
            value = values[row, column]
            # From -0 to minus infinity.
            stopped = np.uint16(0x8000) <= value <= np.uint16(0xFF80)
            bits[row, column] = np.uint32(0) if stopped else np.uint32(value) << np.uint32(16)


def find_loss(
    values: Singles2, actions: Integers1, targets: Singles1, loss: Singles1, slopes: Singles2
) -> bool:
    """Write the mean squared error of the values of the actions taken, and its derivatives.

    Returns False if there is no such action: machine code looks where it is told to.
    """
    slopes[:] = 0.0
    total, scale = 0.0, np.float32(2.0 / len(values))
    for row in range(len(values)):
        action = actions[row]
        if not 0 <= action < values.shape[1]:
            return False
        error = values[row, action] - targets[row]
        total += np.float64(error) * np.float64(error)
        slopes[row, action] = error * scale
    loss[0] = total / len(values)
    return True


def slopes_in_halves(slopes: Singles2, activated: Singles2, result: Halves2, sums: Halves1) -> None:
    """Write the derivatives before ReLU in bfloat16, and their sum over the rows."""
    bits, totals = slopes.view(np.uint32), np.zeros(slopes.shape[1], np.float32)
    for row in range(len(slopes)):
        for column in range(slopes.shape[1]):
            if activated[row, column] > 0.0:
                totals[column] += slopes[row, column]
                result[row, column] = rounded(bits[row, column])
            else:
                result[row, column] = np.uint16(0)
    whole = totals.view(np.uint32)
    for column in range(len(whole)):
        sums[column] = rounded(whole[column])


def slopes_in_singles(slopes: Halves2, activated: Halves2, result: Singles2, sums: Singles1) -> None:
    """Write the derivatives before ReLU in float32, and their sum over the rows."""
    bits = result.view(np.uint32)
    sums[:] = 0.0
    for row in range(len(slopes)):
        for column in range(slopes.shape[1]):
            # ReLU gives 0 or more, so its bits are more than 0 where it is.
            slope = slopes[row, column] if activated[row, column] > np.uint16(0) else np.uint16(0)
            bits[row, column] = np.uint32(slope) << np.uint32(16)
        for column in range(slopes.shape[1]):
            sums[column] += result[row, column]


_FUNCTIONS: Final = (activate_in_halves, activate_in_singles, find_loss, slopes_in_halves, slopes_in_singles)
