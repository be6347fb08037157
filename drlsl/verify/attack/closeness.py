"""Distances of scenes from making a condition of a lowered program true, in arrays, to guide a search.

Distances are 0 if the condition holds, and add up over its failing parts: a comparison counts by the amount
by which it fails, from 0 to 1, any other failing part as 1. Each loop of the program is an axis, the last
axis is the scenes'.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from typing import Any, Final, TypeAlias

import numpy as np

from drlsl.logic.core import NODES
from drlsl.logic.terms import Atom
from drlsl.lowering.backends import Array, Ops, Rows
from drlsl.lowering.ir import Node, relation_of

Facts: TypeAlias = Mapping[tuple[str, int], Rows]

_HARDLY: Final = 1e-12
"""The distance of a comparison that fails by an amount of 0, such as 1 < 1."""


class Closeness:
    """The distances of N scenes from conditions over their facts."""

    def __init__(self, facts: Facts, scenes: int, code: Callable[[str], int]) -> None:
        self._code = code
        self._scenes = np.arange(scenes)
        self._ops = Ops(np.dtype(np.float64), scenes)
        self._columns: dict[tuple[str, int], list[Array]] = {}
        self._valid: dict[tuple[str, int], Array] = {}
        for key, rows in facts.items():
            columns = [np.atleast_2d(np.asarray(column).T) for column in rows.columns]
            self._columns[key] = columns
            shape = np.broadcast_shapes(columns[0].shape, (1, scenes))
            valid = np.ones(shape, dtype=np.bool_) if rows.valid is None else np.asarray(rows.valid).T
            self._valid[key] = valid
        self._axis: dict[Node, int] = {}
        self._done: dict[Any, Array] = {}

    def distance(self, node: Node, *, wanted: bool = True) -> Array:
        """Return each scene's distance from making `node` true, or false, shape (N,): 0 where it is."""
        with np.errstate(all="ignore"):
            return _flat(self._far(node, wanted), len(self._scenes))

    # ---------------------------------------------------------------- memory

    def _once(self, what: str, node: Node, make: Callable[[Node], Array]) -> Array:
        place = (what, node, *[self._axis[loop] for loop in node.loops])
        known = self._done.get(place)
        if known is None:
            known = self._done[place] = make(node)
        return known

    # ---------------------------------------------------------------- truth

    def _far(self, node: Node, wanted: bool) -> Array:
        """Return the distance of `node` from being true, or false."""
        while node.op == "not":
            node, wanted = node.args[0], not wanted
        return self._once("near" if wanted else "far", node, self._near if wanted else self._beyond)

    def _near(self, node: Node) -> Array:
        return self._make_far(node, True)

    def _beyond(self, node: Node) -> Array:
        return self._make_far(node, False)

    def _holds(self, node: Node) -> Array:
        holds: Array = self._far(node, True) == 0
        return holds

    def _make_far(self, node: Node, wanted: bool) -> Array:
        match node.op:
            case "const":
                return np.array([0.0 if node.data is wanted else 1.0])
            case "and" | "or":
                return self._junction(node, wanted)
            case "any":
                return self._some(node, wanted)
            case "lt":
                left, right = (self._value(arg) for arg in node.args)
                return _shortfall(left < right, left - right, wanted)
            case "eq":
                return self._equal(node, wanted)
            case "within":
                value = self._value(node.args[0])
                return _shortfall(self._ops.within(value, node.data), np.abs(value) - node.data, wanted)
        raise AssertionError(f"no condition: {node.op}")

    def _junction(self, node: Node, wanted: bool) -> Array:
        parts = [self._far(arg, wanted) for arg in node.args]
        join = np.add if (node.op == "and") is wanted else np.minimum
        result = parts[0]
        for part in parts[1:]:
            result = join(result, part)
        return result

    def _equal(self, node: Node, wanted: bool) -> Array:
        left, right = (self._value(arg) for arg in node.args)
        if left.dtype.kind == "f":
            return _shortfall(left == right, np.abs(left - right), wanted)
        return np.where((left == right) == wanted, 0.0, 1.0)

    def _some(self, node: Node, wanted: bool) -> Array:
        """Return the distance of the closest row that a quantifier visits; or of all rows together."""
        with self._visiting(node) as (axis, missing):
            far = self._far(node.args[1], wanted)
        if wanted:
            return np.asarray(np.min(missing + far, axis=axis, keepdims=True))
        return np.asarray(np.sum(np.where(missing > 0, 0.0, far), axis=axis, keepdims=True))

    # ---------------------------------------------------------------- rows

    @contextmanager
    def _visiting(self, node: Node) -> Iterator[tuple[int, Array]]:
        """Give a quantifier's loop an axis; yield it, and by row the distance from visiting it."""
        # levels distinguish loops that rules nest; loops in conditions on rows may share a level
        taken = {self._axis[other] for other in node.free}
        level = next(level for level in range(len(taken) + 1) if level not in taken)
        loop = node.args[0]
        with self._at(loop, level):
            yield -(level + 2), self._once(f"visit {level}", loop.args[0], partial(self._missing, level))

    def _missing(self, level: int, rows: Node) -> Array:
        """Return by row, on the axis of a level, the distance from visiting it."""
        relation = relation_of(rows)
        far = np.zeros(1)
        while rows.op == "where":
            rows, inner, cond = rows.args
            with self._at(inner, level):
                far = far + self._far(cond, True)
        there = self._valid[relation.name, relation.arity]
        if rows.op == "others":
            there = there & (np.arange(there.shape[0]) > 0)[:, None]
        return self._along(np.where(there, 0.0, 1.0), level) + far

    @contextmanager
    def _at(self, loop: Node, level: int) -> Iterator[None]:
        """Have a loop on an axis; an enclosing quantifier may use the same loop on another axis."""
        outer = self._axis.get(loop)
        self._axis[loop] = level
        yield
        if outer is None:
            del self._axis[loop]
        else:
            self._axis[loop] = outer

    def _along(self, rows: Array, level: int) -> Array:
        """Return values by row with the rows along the axis of a loop."""
        return rows.reshape(rows.shape[0], *(1,) * level, rows.shape[1])

    def _index(self, node: Node) -> Array:
        return self._once("index", node, self._make_index)

    def _make_index(self, node: Node) -> Array:
        if node.op == "row":
            return np.zeros(1, dtype=np.int64)
        if node.op == "loop":
            relation = relation_of(node)
            count = self._valid[relation.name, relation.arity].shape[0]
            return self._along(np.arange(count)[:, None], self._axis[node])
        if node.op == "select":
            return np.where(self._holds(node.args[0]), *(self._index(arg) for arg in node.args[1:]))
        with self._visiting(node) as (axis, missing):
            mask = (missing == 0) & self._holds(node.args[1])
            if node.op == "first":
                return np.asarray(mask.argmax(axis=axis, keepdims=True))
            least = node.op == "argmin"
            value = np.where(mask, self._value(node.args[2]), np.inf if least else -np.inf)
        return np.asarray(
            value.argmin(axis=axis, keepdims=True) if least else value.argmax(axis=axis, keepdims=True)
        )

    # ---------------------------------------------------------------- numbers and atoms

    def _value(self, node: Node) -> Array:
        return self._once("value", node, self._make_value)

    def _make_value(self, node: Node) -> Array:
        if node.op == "const":
            return np.array([self._code(node.data.name) if isinstance(node.data, Atom) else node.data])
        if node.op == "col":
            return self._column(node)
        if node.op == "select":
            return np.where(self._holds(node.args[0]), *(self._value(arg) for arg in node.args[1:]))
        if node.op in ("count", "sum", "min_of", "max_of"):
            return self._gathered(node)
        return self._ops.apply(NODES[node.op], *map(self._value, node.args))

    def _column(self, node: Node) -> Array:
        relation, column = node.data
        rows = self._columns[relation.name, relation.arity][column]
        index = node.args[0]
        if index.op == "row":
            return np.asarray(rows[0])
        if index.op == "loop":
            return self._along(rows, self._axis[index])
        scene = self._scenes if rows.shape[1] > 1 else 0
        return np.asarray(rows[self._index(index), scene])

    def _gathered(self, node: Node) -> Array:
        """Return a number aggregated over all rows."""
        with self._visiting(node) as (axis, missing):
            mask = (missing == 0) & self._holds(node.args[1])
            if node.op == "count":
                return np.asarray(np.count_nonzero(mask, axis=axis, keepdims=True))
            value = self._value(node.args[2])
        if node.op == "sum":
            added = np.sum(np.where(mask, value, 0), axis=axis, keepdims=True)
            return np.asarray(self._value(node.args[3]) + added)
        empty = np.inf if node.op == "min_of" else -np.inf
        reduce = np.min if node.op == "min_of" else np.max
        return np.asarray(reduce(np.where(mask, value, empty), axis=axis, keepdims=True))


def _flat(values: Array, scenes: int) -> Array:
    """Return values by scene, whose other axes have length 1, as one axis."""
    return np.broadcast_to(values.reshape(values.shape[-1]), (scenes,))


def _shortfall(holds: Array, excess: Array, wanted: bool) -> Array:
    """Return by how much a comparison fails, from 0 to 1; `excess` is above 0 if it does not hold."""
    gap = excess if wanted else -excess
    size = np.asarray(1.0 + gap)
    np.divide(gap, size, out=size)
    np.fmin(size, 1.0, out=size)  # an infinite or undefined amount counts as 1
    size += _HARDLY
    np.copyto(size, 0.0, where=holds if wanted else ~holds)
    return size
