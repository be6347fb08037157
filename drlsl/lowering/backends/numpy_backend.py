"""Lowered programs on NumPy arrays: thousands of scenes in one call."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final, TypeAlias

import numpy as np

from drlsl.lowering.backends.arrays import ArrayPrinter
from drlsl.lowering.backends.batch_program import (
    BatchAnswer,
    BatchResult,
    Kind,
    Layout,
    Precision,
    Rows,
    TextProgram,
)
from drlsl.lowering.backends.batch_program import Table as BatchTable
from drlsl.lowering.backends.numpy_ops import Array, Mask, Ops
from drlsl.lowering.frontend import Lowered
from drlsl.lowering.ir import INT_BOUND

__all__ = ["ArrayAnswer", "ArrayProgram", "ArrayResult", "Rows", "Table", "compile_numpy", "numpy_source"]

CHUNK: Final = 2048
"""Number of scenes answered together: more do not fit the processor's cache."""

_LARGE_BLOCK: Final = 1 << 24
_PIECE: Final = 1 << 13

ArrayAnswer: TypeAlias = BatchAnswer[Array]
ArrayResult: TypeAlias = BatchResult[Array]


def compile_numpy(lowered: Lowered, dtype: Precision = "float64") -> ArrayProgram:
    """Return the program that answers all queries for many scenes.

    With float64 the answers equal the interpreter's, with float32 only nearly.

    Raises:
        NotLowerable: a query's answer has no form as an array.
    """
    return ArrayProgram(lowered, dtype)


def numpy_source(lowered: Lowered) -> str:
    """Return the text of the function over arrays."""
    return ArrayPrinter(lowered).module()


class ArrayProgram(TextProgram[Array]):
    """A lowered program, ready for NumPy arrays."""

    def __init__(self, lowered: Lowered, dtype: Precision) -> None:
        super().__init__(lowered, dtype, _kinds)
        # glibc learns from the first large block that is freed to keep freed memory; without that the arrays
        # of each call cost a quarter of its time in page faults.
        np.empty(_LARGE_BLOCK, dtype=np.uint8)

    def _table(self, layout: Layout, rows: Rows) -> Table:
        return Table(layout, rows)

    def _chunk(self, tables: Mapping[Any, BatchTable], scenes: int) -> ArrayResult:
        with np.errstate(all="ignore"):  # an operation may fail in rows that no rule reads
            return super()._chunk(tables, scenes)

    def _ops(self, scenes: int) -> Ops:
        return Ops(self._kinds["float"], scenes)

    def _most_scenes(self, scenes: int) -> int:
        return CHUNK

    def _empty(self, shape: tuple[int, ...], kind: Kind) -> Array:
        return np.empty(shape, dtype=self._kinds[kind])

    def _joined(self, parts: Sequence[Array]) -> Array:
        return np.concatenate(parts)


def _kinds(dtype: Precision) -> Mapping[Kind, np.dtype[Any]]:
    return {"bool": np.dtype(np.bool_), "int": np.dtype(np.int64), "float": np.dtype(dtype)}


class Table(BatchTable):
    """The columns of one relation that are read, as NumPy arrays."""

    __slots__ = ()

    def __init__(self, layout: Layout, rows: Rows) -> None:
        with np.errstate(all="ignore"):  # values that do not fit are found by checking
            super().__init__(layout, rows)
            self.look()

    def _is_of(self, column: Array, kind: Kind) -> bool:
        return is_of(column.dtype, kind)

    def _converted(self, column: Array, kind: Kind) -> Array:
        return np.ascontiguousarray(column, dtype=self._kinds[kind])

    def _all_there(self, height: int) -> Mask:
        return np.ones((height, 1), dtype=np.bool_)

    def _with_rows(self, column: Array, missing: int) -> Array:
        return np.concatenate([column, np.zeros((missing, column.shape[1]), dtype=column.dtype)])

    def _cut(self, column: Array, start: int, stop: int) -> Array:
        return np.ascontiguousarray(super()._cut(column, start, stop))

    def _gathered(self, column: Array, index: Array) -> Array:
        return column if column.shape[1] == 1 else column.take(index, axis=1)

    def _within(self, column: Array, kind: Kind) -> bool:
        if kind == "float":
            return _sum_of_squares(column) <= self._bound**2
        return bool(-INT_BOUND <= column.min() <= column.max() <= INT_BOUND)

    def _repeats(self, keys: Array) -> Mask:
        places = np.arange(keys.shape[0])[:, None]
        # missing rows get keys that no row has
        apart = np.where(self.valid, keys, np.iinfo(np.int64).min + places)
        ordered = np.sort(apart, axis=0)
        repeats: Mask = (ordered[1:] == ordered[:-1]).any(axis=0)
        return repeats


def is_of(dtype: np.dtype[Any], kind: Kind) -> bool:
    """Return whether an array's numbers are of that kind, or can be converted without a relevant loss."""
    return dtype.kind in "iuf" if kind == "float" else np.can_cast(dtype, np.int64, "safe")


def _sum_of_squares(column: Array) -> float:
    """Return the sum of all squares, in pieces too short for a linear algebra library to start threads."""
    flat = column.reshape(-1)
    pieces = (flat[start : start + _PIECE] for start in range(0, flat.size, _PIECE))
    return float(sum(piece.dot(piece) for piece in pieces))
