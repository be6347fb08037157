"""The operations that lowered programs call, on Torch tensors.

On the processor they give the bits that `numpy_ops` gives: no operation here is fused with another, sums are
added row by row, and a division is never a product with the reciprocal. No result's shape depends on the
facts, and no value comes back to Python, so a device is never waited for: rows are masked where NumPy would
pick them out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import reduce
from typing import Final, TypeAlias

import numpy as np
import torch
from torch import Tensor

from drlsl.logic.core import NODES

Number: TypeAlias = Tensor | float
"""A tensor, or a constant of the rules."""

Constants: TypeAlias = dict[tuple[float, torch.dtype], Tensor]


@dataclass(frozen=True, slots=True)
class Picked:
    """Rows of a relation: their places of shape (rows, 1), and whether they exist."""

    index: Tensor
    valid: Tensor


class Ops:
    """The operations that the generated text calls, for one number of scenes."""

    inf: Final = math.inf
    absolute: Final = staticmethod(torch.abs)
    sign: Final = staticmethod(torch.sign)

    def __init__(self, dtype: torch.dtype, device: torch.device, scenes: int, constants: Constants) -> None:
        self.dtype = dtype
        self.device = device
        self.scenes = scenes
        self._constants = constants  # those already on the device, kept from call to call
        self._every_scene = torch.arange(scenes, device=device)

    @property
    def true(self) -> Tensor:
        """Truth."""
        return self._constant(True, torch.bool)

    @property
    def false(self) -> Tensor:
        """Falsehood."""
        return self._constant(False, torch.bool)

    def _constant(self, value: float, dtype: torch.dtype) -> Tensor:
        known = self._constants.get((value, dtype))
        if known is None:
            known = self._constants[value, dtype] = torch.full((), value, dtype=dtype, device=self.device)
        return known

    def _tensor(self, value: Number) -> Tensor:
        """Return a value as a tensor, which Torch would make a float32 of a Python float."""
        if isinstance(value, Tensor):
            return value
        return self._constant(value, self.dtype if isinstance(value, float) else torch.int64)

    # reductions of rows: axis counts from the outermost loop

    def exists(self, mask: Tensor, axis: int) -> Tensor:
        """Return whether some row is marked."""
        if mask.shape[axis] == 1:
            return mask.select(axis, 0)
        # several times as fast as `any`
        return mask.view(torch.uint8).amax(axis).view(torch.bool)

    def count(self, mask: Tensor, axis: int) -> Tensor:
        """Return the number of marked rows."""
        return mask.sum(axis)

    def first(self, mask: Tensor, axis: int) -> Tensor:
        """Return the place of the first marked row; any place if none is marked."""
        last = mask.shape[axis] - 1
        places = torch.arange(last + 1, device=self.device).reshape(-1, *[1] * (mask.ndim - 1 - axis))
        return torch.where(mask, places, self._constant(last, torch.int64)).amin(axis)

    def least(self, mask: Tensor, value: Number, axis: int) -> Tensor:
        """Return the least value of the rows that are marked."""
        return self._marked(mask, value, 1).amin(axis)

    def greatest(self, mask: Tensor, value: Number, axis: int) -> Tensor:
        """Return the greatest value of the rows that are marked."""
        return self._marked(mask, value, -1).amax(axis)

    def where_least(self, mask: Tensor, value: Number, axis: int) -> Tensor:
        """Return the place of the first of the marked rows with the least value."""
        marked = self._marked(mask, value, 1)
        return self.first(marked == marked.amin(axis, keepdim=True), axis)

    def where_greatest(self, mask: Tensor, value: Number, axis: int) -> Tensor:
        """Return the place of the first of the marked rows with the greatest value."""
        marked = self._marked(mask, value, -1)
        return self.first(marked == marked.amax(axis, keepdim=True), axis)

    def _marked(self, mask: Tensor, value: Number, sign: int) -> Tensor:
        """Return the values of marked rows; for the others one above (or below) every valid value."""
        given = self._tensor(value)
        return torch.where(mask, given, self._constant(self._beyond(given.dtype, sign), given.dtype))

    def _beyond(self, dtype: torch.dtype, sign: int) -> float:
        return sign * (math.inf if dtype.is_floating_point else torch.iinfo(dtype).max)

    def total(self, mask: Tensor, value: Number, start: Number, axis: int) -> Tensor:
        """Return `start` plus the values of the marked rows, added in order."""
        given = self._tensor(value)
        parts = torch.where(mask, given, self._constant(0, given.dtype))
        return reduce(torch.add, parts.unbind(axis), self._tensor(start))

    # rows

    def select(self, mask: Tensor) -> Selected:
        """Return the marked rows of all scenes."""
        return Selected(self, mask)

    def pick(self, mask: Tensor) -> Picked:
        """Return the marked rows."""
        return Picked(self.positions(mask, 0), mask)

    def take(self, column: Tensor, index: Tensor | int) -> Tensor:
        """Return the values of a column at places that differ by scene."""
        if column.shape[-1] == 1:
            return column[:, 0][index]
        return column[index, self._every_scene]

    def positions(self, valid: Tensor, start: int) -> Tensor:
        """Return the places of the rows that a loop visits."""
        return torch.arange(start, start + valid.shape[0], device=self.device)[:, None]

    def stack(self, *values: Number) -> Tensor:
        """Return values of the scenes alone as the rows of one array."""
        given = [self._tensor(value) for value in values]
        dtype = reduce(torch.promote_types, (value.dtype for value in given))
        return torch.stack([value.to(dtype).expand(self.scenes) for value in given])

    # numbers

    def minimum(self, left: Number, right: Number) -> Tensor:
        """Return the lesser of two."""
        if isinstance(left, Tensor):
            return torch.minimum(left, right) if isinstance(right, Tensor) else left.clamp(max=right)
        return self._tensor(right).clamp(max=left)

    def maximum(self, left: Number, right: Number) -> Tensor:
        """Return the greater of two."""
        if isinstance(left, Tensor):
            return torch.maximum(left, right) if isinstance(right, Tensor) else left.clamp(min=right)
        return self._tensor(right).clamp(min=left)

    def sqrt(self, value: Tensor) -> Tensor:
        """Return the square root; on a processor not by Torch, whose library errs in the last bit."""
        if self.device.type != "cpu":
            return value.sqrt()
        with np.errstate(invalid="ignore"):
            return torch.from_numpy(np.asarray(np.sqrt(value.numpy())))

    def choose(self, cond: Tensor, then: Number, els: Number) -> Tensor:
        """Return `then` if the condition holds, else `els`."""
        return torch.where(cond, self._tensor(then), self._tensor(els))

    constants = choose

    def within(self, value: Tensor, bound: float) -> Tensor:
        """Return whether values are at most `bound` away from 0, and in the range of their kind."""
        if value.is_floating_point():
            return value.abs() <= min(bound, torch.finfo(value.dtype).max)
        return (value >= -int(bound)) & (value <= int(bound))

    def divide(self, left: Number, right: Number) -> Tensor:
        """Return the quotient; for Python numbers Torch takes the reciprocal, which rounds twice."""
        return self._tensor(left) / self._tensor(right)

    def floor_divide(self, left: Number, right: Number) -> Tensor:
        """Return integer division downward; any number for a zero divisor, where Torch raises an error."""
        dividend, divisor = self._tensor(left), self._tensor(right)
        quotient = torch.div(dividend, self._divisor(divisor), rounding_mode="floor")
        return torch.where(divisor == -1, -dividend, quotient)

    def remainder(self, left: Number, right: Number) -> Tensor:
        """Return the remainder of `floor_divide`."""
        return torch.remainder(self._tensor(left), self._divisor(self._tensor(right)))

    def truncated(self, left: Number, right: Number) -> Tensor:
        """Return integer division toward zero."""
        dividend, divisor = self._tensor(left), self._tensor(right)
        quotient = self.floor_divide(dividend.abs(), divisor.abs())
        return torch.where((dividend < 0) == (divisor < 0), quotient, -quotient)

    def _divisor(self, value: Tensor) -> Tensor:
        """Return a divisor at which no processor traps: 1 for 0, and for -1, which may overflow."""
        return value.masked_fill((value == 0) | (value == -1), 1)

    def to_float(self, value: Tensor) -> Tensor:
        """Return integers as floats."""
        return value.to(self.dtype)

    def floor(self, value: Tensor) -> Tensor:
        """Return the integers not above."""
        return value.floor().to(torch.int64)

    def ceiling(self, value: Tensor) -> Tensor:
        """Return the integers not below."""
        return value.ceil().to(torch.int64)

    def truncate(self, value: Tensor) -> Tensor:
        """Return the integers toward zero."""
        return value.trunc().to(torch.int64)

    def rounded(self, value: Tensor) -> Tensor:
        """Return the nearest integers, as `numbers.rounded` finds them."""
        whole = value.trunc()
        rest = value - whole
        return whole.to(torch.int64) + (rest >= 0.5).to(torch.int64) - (rest <= -0.5).to(torch.int64)

    def function(self, name: str, *values: Number) -> Tensor:
        """Apply an operation to each number: on the processor as the interpreter does, to the last bit.

        On any other device the device computes functions of floats, whose last bits may differ.
        """
        row, given = NODES[name], [self._tensor(value) for value in values]
        whole = row.kind == "whole"
        if self.device.type != "cpu" and not whole and hasattr(torch, name):
            result: Tensor = getattr(torch, name)(*given)
            return result
        apply = np.frompyfunc(row.compute, row.arity, 1)
        with np.errstate(all="ignore"):
            made = np.asarray(apply(*(value.cpu().numpy() for value in given)))
        found = torch.from_numpy(made.astype(np.int64 if whole else np.float64))
        return found.to(self.device, torch.int64 if whole else self.dtype)


class Selected:
    """All rows, of which only the marked ones count."""

    __slots__ = ("_mask", "_ops")

    def __init__(self, ops: Ops, mask: Tensor) -> None:
        self._ops = ops
        self._mask = mask

    def gather(self, value: Tensor) -> Tensor:
        """Return the values of these rows."""
        return value

    def spread(self, value: Tensor) -> Tensor:
        """Return the values of these rows' scenes."""
        return value

    def exists(self, cond: Tensor | None) -> Tensor:
        """Return the scenes with a row that meets the condition."""
        return self._ops.exists(self._meeting(cond), 0)

    def least(self, cond: Tensor | None, value: Number) -> Tensor:
        """Return the least value in each scene."""
        return self._ops.least(self._meeting(cond), value, 0)

    def greatest(self, cond: Tensor | None, value: Number) -> Tensor:
        """Return the greatest value in each scene."""
        return self._ops.greatest(self._meeting(cond), value, 0)

    def _meeting(self, cond: Tensor | None) -> Tensor:
        return self._mask if cond is None else self._mask & cond
