"""Learning in bfloat16 on a processor: all that stands between two products is a pass of machine code.

In bfloat16 the products take less than half of an update by PyTorch, whose every small operation beside them
is a call and a pass through memory of its own: docs/training.md, Speed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray

from drlsl.learning.layers import Layer
from drlsl.lowering.backends import Halves1, Halves2, Integers1, Singles1, Singles2, machine_code


class CompiledPass:
    """The gradient of the loss of a network that learns in bfloat16, as `loss.find_gradient` computes it.

    The first and the last layer are of float32, those between them of bfloat16. Sums are of float32 until
    they are whole, so the last bits differ from PyTorch's. What lies between two layers is written into the
    same memory each time, and so stays in the processor's cache.
    """

    def __init__(self, layers: Sequence[Layer], slopes: Sequence[Layer], rows: int) -> None:
        """Make the memory for minibatches of so many rows; gradients are written into `slopes`."""
        self.rows = rows
        self._layers, self._slopes = layers, slopes
        *widths, actions = (len(layer.bias) for layer in layers)
        self._first = _Memory(rows, widths[0], torch.float32)
        self._halves = [_Memory(rows, width, torch.bfloat16) for width in widths]
        """What the layers of bfloat16 take, and what the last of them gives."""
        self._inputs = _Memory(rows, widths[-1], torch.float32)
        """What the last layer takes."""
        self._values = _Memory(rows, actions, torch.float32)
        self._half_slopes = [_Memory(rows, width, torch.bfloat16) for width in widths]
        """The loss's derivatives in what is in `halves`."""
        self._first_slopes = _Memory(rows, widths[0], torch.float32)
        self._loss, self._line = np.zeros(1, np.float32), np.zeros((2, widths[-1]), np.float32)
        # A layer's weights lie in rows of the longer side: of the last one's, a row for each action.
        last, last_slopes = layers[-1], slopes[-1]
        self._weights = array_of(last.weight.mT)
        self._weight_slopes, self._bias_slopes = array_of(last_slopes.weight.mT), array_of(last_slopes.bias)
        self._sums = [array_of(layer.bias) for layer in slopes[:-1]]

    def find_gradient(
        self, observations: torch.Tensor, actions: torch.Tensor, targets: torch.Tensor
    ) -> float:
        """Write the gradient, and return the loss. Shapes: (B, S), (B,) and (B,).

        Raises:
            IndexError: there is no such action.
        """
        self._run(observations)
        known = machine_code(go_back_to_halves)(
            self._values.array,
            array_of(actions.contiguous()),
            array_of(targets.contiguous()),
            self._inputs.array,
            self._weights,
            self._weight_slopes,
            self._bias_slopes,
            self._half_slopes[-1].array,
            self._sums[-1],
            self._line,
            self._loss,
        )
        if not known:
            raise IndexError(f"expected actions from 0 to {len(self._weights) - 1}, got {actions.tolist()}")
        self._go_back(observations)
        return float(self._loss[0])

    def _run(self, observations: torch.Tensor) -> None:
        """Write the Q-values, and what is between the layers."""
        first, *inner, last = self._layers
        torch.addmm(first.bias, observations, first.weight, out=self._first.values)
        machine_code(activate_in_halves)(self._first.array, self._halves[0].array)
        for index, layer in enumerate(inner):
            given = self._halves[index].values if index == 0 else self._halves[index].values.relu_()
            torch.addmm(layer.bias, given, layer.weight, out=self._halves[index + 1].values)
        machine_code(activate_in_singles)(self._halves[-1].array, self._inputs.array)
        torch.addmm(last.bias, self._inputs.values, last.weight, out=self._values.values)

    def _go_back(self, observations: torch.Tensor) -> None:
        """Write the gradient of all layers but the last, whose inputs' derivatives are known."""
        for index in reversed(range(1, len(self._half_slopes))):
            halves, slopes = self._halves[index - 1], self._half_slopes[index]
            before = self._half_slopes[index - 1]
            torch.mm(halves.values.t(), slopes.values, out=self._slopes[index].weight)
            torch.mm(slopes.values, self._layers[index].weight.t(), out=before.values)
            if index > 1:
                before.values.mul_(halves.values.sign())
                torch.sum(before.values, 0, out=self._slopes[index - 1].bias)
        machine_code(go_back_to_singles)(
            self._half_slopes[0].array, self._halves[0].array, self._first_slopes.array, self._sums[0]
        )
        torch.mm(observations.t(), self._first_slopes.values, out=self._slopes[0].weight)


class _Memory:
    """Memory for rows of numbers, as a tensor and as an array of them, or of the bits of bfloat16."""

    def __init__(self, rows: int, width: int, kind: torch.dtype) -> None:
        self.values = torch.zeros(rows, width, dtype=kind)
        self.array = array_of(self.values)


def array_of(values: torch.Tensor) -> NDArray[Any]:
    """Return the numbers of a tensor, or the bits of those of bfloat16, in the same memory."""
    numbers = values.view(torch.uint16) if values.dtype == torch.bfloat16 else values
    array: NDArray[Any] = numbers.numpy()
    return array


def can_compile(layers: Sequence[Layer]) -> bool:
    """Return whether a pass can be made for layers: on a processor, with Numba, and with few actions."""
    return (
        layers[0].bias.device.type == "cpu"
        and layers[-1].weight.mT.is_contiguous()
        and all(machine_code(one) is not one for one in _FUNCTIONS)
    )


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


def go_back_to_halves(
    values: Singles2,
    actions: Integers1,
    targets: Singles1,
    inputs: Singles2,
    weights: Singles2,
    weight_slopes: Singles2,
    bias_slopes: Singles1,
    result: Halves2,
    sums: Halves1,
    scratch: Singles2,
    loss: Singles1,
) -> bool:
    """Write the loss, the last layer's gradient, and the derivatives before its inputs' ReLU in bfloat16.

    Of each row's values that of one action counts. `weights`: a row for each action. `sums`: of the
    derivatives over the rows. `scratch`: two rows as wide as those of `inputs`. Returns False if there is no
    such action: machine code looks where it is told.

    Source: Eq. 1.
    """
    width = inputs.shape[1]
    line, totals = scratch[0], scratch[1]
    bits, total_bits = line.view(np.uint32), totals.view(np.uint32)
    totals[:] = 0.0
    weight_slopes[:] = 0.0
    bias_slopes[:] = 0.0
    total, scale = 0.0, np.float32(2.0 / len(values))
    for row in range(len(values)):
        action = actions[row]
        if not 0 <= action < len(weights):
            return False
        error = values[row, action] - targets[row]
        total += np.float64(error) * np.float64(error)
        slope = error * scale
        bias_slopes[action] += slope
        for column in range(width):
            weight_slopes[action, column] += slope * inputs[row, column]
        for column in range(width):
            passed = inputs[row, column] > 0.0
            line[column] = slope * weights[action, column] if passed else np.float32(0.0)
            totals[column] += line[column]
        for column in range(width):
            result[row, column] = rounded(bits[column])
    for column in range(width):
        sums[column] = rounded(total_bits[column])
    loss[0] = total / len(values)
    return True


def go_back_to_singles(slopes: Halves2, activated: Halves2, result: Singles2, sums: Singles1) -> None:
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


_FUNCTIONS: Final = (activate_in_halves, activate_in_singles, go_back_to_halves, go_back_to_singles)
