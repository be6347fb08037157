"""The operations that lowered programs call, on NumPy arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from drlsl.logic.core import NODES, Operation

Array: TypeAlias = npt.NDArray[Any]
Mask: TypeAlias = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Picked:
    """Some rows of a relation: their places and whether they exist, each of shape (rows, scenes)."""

    index: Array
    valid: Mask


class Selected:
    """Rows of any scenes along one axis, in the order of rows."""

    __slots__ = ("_place", "_scene", "_shape")

    def __init__(self, place: Array, shape: tuple[int, ...]) -> None:
        scenes = shape[1]
        self._place = place  # among all rows of all scenes
        self._shape = shape
        self._scene = place & (scenes - 1) if scenes & (scenes - 1) == 0 else place % scenes

    def gather(self, value: Array) -> Array:
        """Return the values of these rows."""
        if value.shape == self._shape:
            return value.ravel().take(self._place)
        if value.shape[1] == 1:
            return value[:, 0].take(self._place // self._shape[1])
        return np.broadcast_to(value, self._shape).ravel().take(self._place)

    def spread(self, value: Array) -> Array:
        """Return the values of these rows' scenes."""
        return value if np.size(value) == 1 else value.take(self._scene)

    def exists(self, cond: Mask | None) -> Mask:
        """Return the scenes with a row that meets the condition."""
        result = np.zeros(self._shape[1], dtype=np.bool_)
        result[self._scene if cond is None else self._scene[cond]] = True
        return result

    def least(self, cond: Mask | None, value: Array) -> Array:
        """Return the least value in each scene."""
        return self._reduced(np.minimum, _highest(value), cond, value)

    def greatest(self, cond: Mask | None, value: Array) -> Array:
        """Return the greatest value in each scene."""
        return self._reduced(np.maximum, -_highest(value), cond, value)

    def _reduced(self, reduce: np.ufunc, start: Any, cond: Mask | None, value: Array) -> Array:
        result = np.full(self._shape[1], start)
        if np.size(value) == 1:
            value = np.broadcast_to(value, self._scene.shape)
        if cond is None:
            reduce.at(result, self._scene, value)
        else:
            reduce.at(result, self._scene[cond], value[cond])
        return result


class Ops:
    """The operations that the generated text calls."""

    true: Final = np.True_
    false: Final = np.False_
    inf: Final = np.inf
    minimum: Final = staticmethod(np.minimum)
    maximum: Final = staticmethod(np.maximum)
    absolute: Final = staticmethod(np.absolute)
    sqrt: Final = staticmethod(np.sqrt)
    sign: Final = staticmethod(np.sign)
    choose: Final = staticmethod(np.where)
    divide: Final = staticmethod(np.divide)
    floor_divide: Final = staticmethod(np.floor_divide)
    remainder: Final = staticmethod(np.remainder)

    def __init__(self, dtype: np.dtype[Any], scenes: int) -> None:
        self.dtype = dtype
        self.scenes = scenes
        self._every_scene = np.arange(scenes)

    # reductions of rows: axis counts from the outermost loop

    def exists(self, mask: Mask, axis: int) -> Mask:
        """Return whether some row is marked."""
        if mask.shape[axis] == 1:
            only: Mask = mask[(slice(None),) * axis + (0,)]
            return only
        result: Mask = np.logical_or.reduce(mask, axis=axis)
        return result

    def count(self, mask: Mask, axis: int) -> Array:
        """Return the number of marked rows."""
        result: Array = np.count_nonzero(mask, axis=axis)
        return result

    def first(self, mask: Mask, axis: int) -> Array:
        """Return the place of the first row that is marked."""
        result: Array = mask.argmax(axis=axis)
        return result

    def least(self, mask: Mask, value: Array, axis: int) -> Array:
        """Return the least value of the rows that are marked."""
        if mask.ndim == 2 and mask.shape == np.shape(value) and 6 * np.count_nonzero(mask) < mask.size:
            rows = self.select(mask)
            return rows.least(None, rows.gather(value))
        result: Array = np.minimum.reduce(np.where(mask, value, _highest(value)), axis=axis)
        return result

    def greatest(self, mask: Mask, value: Array, axis: int) -> Array:
        """Return the greatest value of the rows that are marked."""
        result: Array = np.maximum.reduce(np.where(mask, value, -_highest(value)), axis=axis)
        return result

    def where_least(self, mask: Mask, value: Array, axis: int) -> Array:
        """Return the place of the first of the marked rows with the least value."""
        result: Array = np.argmin(np.where(mask, value, _highest(value)), axis=axis)
        return result

    def where_greatest(self, mask: Mask, value: Array, axis: int) -> Array:
        """Return the place of the first of the marked rows with the greatest value."""
        result: Array = np.argmax(np.where(mask, value, -_highest(value)), axis=axis)
        return result

    def total(self, mask: Mask, value: Array, start: Array, axis: int) -> Array:
        """Return `start` plus the marked values, added in order: np.add.reduce may use another order."""
        parts = np.moveaxis(np.where(mask, value, np.zeros((), dtype=np.asarray(value).dtype)), axis, 0)
        shape = np.broadcast_shapes(parts.shape[1:], np.shape(start))
        terms = np.empty((parts.shape[0] + 1, *shape), dtype=parts.dtype)
        terms[0], terms[1:] = start, parts
        sums: Array = np.add.accumulate(terms, axis=0)[-1]
        return sums

    # rows

    def select(self, mask: Mask) -> Selected:
        """Return the marked rows of all scenes along one axis."""
        if mask.shape[1] != self.scenes:
            mask = np.broadcast_to(mask, (mask.shape[0], self.scenes))
        return Selected(mask.ravel().nonzero()[0], mask.shape)

    def pick(self, mask: Mask) -> Picked:
        """Return the marked rows, moved together: as many as in the scene with most of them."""
        most = int(np.add.reduce(mask, axis=0, dtype=np.int16).max(initial=1))
        if most == 1:
            return Picked(mask.argmax(axis=0)[None], np.logical_or.reduce(mask, axis=0)[None])
        index = np.argsort(~mask, axis=0, kind="stable")[:most]
        return Picked(index, np.take_along_axis(mask, index, axis=0))

    def take(self, column: Array, index: Array) -> Array:
        """Return the values of a column at places that differ by scene."""
        result: Array = column[index, self._every_scene if column.shape[-1] == self.scenes else 0]
        return result

    def positions(self, valid: Mask, start: int) -> Array:
        """Return the places of the rows that a loop visits."""
        return np.arange(start, start + valid.shape[0])[:, None]

    def stack(self, *values: Array) -> Array:
        """Return values of the scenes alone as the rows of one array."""
        result = np.empty((len(values), self.scenes), dtype=np.result_type(*values))
        for row, value in zip(result, values, strict=True):
            row[...] = value
        return result

    # numbers

    def constants(self, cond: Mask, then: float, els: float) -> Array:
        """Return one constant or the other by scene and row."""
        result: Array = np.where(cond, self.dtype.type(then), self.dtype.type(els))
        return result

    def within(self, value: Array, bound: float) -> Mask:
        """Return whether values are at most `bound` away from 0, and in the range of their kind."""
        if value.dtype.kind == "f":
            result: Mask = np.absolute(value) <= min(bound, float(np.finfo(value.dtype).max))
            return result
        return (value >= -int(bound)) & (value <= int(bound))

    def to_float(self, value: Array) -> Array:
        """Return integers as floats."""
        return np.asarray(value).astype(self.dtype)

    def floor(self, value: Array) -> Array:
        """Return the integers not above."""
        return np.floor(value).astype(np.int64)

    def ceiling(self, value: Array) -> Array:
        """Return the integers not below."""
        return np.ceil(value).astype(np.int64)

    def truncate(self, value: Array) -> Array:
        """Return the integers toward zero."""
        return np.trunc(value).astype(np.int64)

    def rounded(self, value: Array) -> Array:
        """Return the nearest integers, a half rounded away from zero."""
        whole = np.trunc(value)
        rest = value - whole
        return (whole + (rest >= 0.5) - (rest <= -0.5)).astype(np.int64)

    def truncated(self, left: Array, right: Array) -> Array:
        """Return integer division toward zero."""
        quotient = np.floor_divide(np.abs(left), np.abs(right))
        return np.where((left < 0) == (right < 0), quotient, -quotient)

    def function(self, name: str, *values: Array) -> Array:
        """Apply an operation to each number: as the interpreter does, for the last bit's sake."""
        row = NODES[name]
        made = np.asarray(np.frompyfunc(row.compute, row.arity, 1)(*values))
        return made.astype(np.int64 if row.kind == "whole" else self.dtype)

    def apply(self, row: Operation, *values: Array) -> Array:
        """Apply an operation of the table."""
        if row.arrays:
            return np.asarray(getattr(self, row.arrays)(*values))
        if row.infix is None:
            return self.function(row.node, *values)
        return np.asarray(row.compute(*values) if not row.divides else np.divide(*values))


def _highest(value: Array) -> Any:
    """Return a number above every valid value."""
    kind = np.asarray(value).dtype
    if kind == np.float64:
        return np.inf
    return np.iinfo(kind).max if kind.kind == "i" else kind.type(np.inf)
