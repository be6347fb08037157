"""Distances of scenes from making conditions of a lowered program true, in arrays, to guide a search.

Distances are 0 if the condition holds, and add up over its failing parts: a comparison counts by the amount
by which it fails, from 0 to 1, any other failing part as 1. Each loop of the program is an axis, the last
axis is the scenes'. The array operations are listed once, and then done for any number of scenes.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any, Final, TypeAlias

import numpy as np

from drlsl.logic.core import NODES, Operation
from drlsl.logic.terms import Atom
from drlsl.lowering.backends import Array, Ops, Rows
from drlsl.lowering.ir import Node, relation_of
from drlsl.traffic import Floats
from drlsl.verify.row_memory import RowMemory

Facts: TypeAlias = Mapping[tuple[str, int], Rows]

_HARDLY: Final = 1e-12
"""The distance of a comparison that fails by an amount of 0, such as 1 < 1."""

_OPS: Final = Ops(np.dtype(np.float64), 1)


class Closeness:
    """The distances of scenes from several conjunctions over their facts.

    `conjunctions` are those that should become true, or false if not `wanted`; a conjunction that should be
    false is a single condition. `code` returns the integers of atoms.
    """

    def __init__(
        self, conjunctions: Sequence[Sequence[Node]], code: Callable[[str], int], *, wanted: bool = True
    ) -> None:
        assert wanted or all(len(parts) == 1 for parts in conjunctions)
        recipe = _Recipe()
        listing = _Listing(recipe, code)
        fars = [[listing.far(part, wanted) for part in parts] for parts in conjunctions]
        self._steps = recipe.finished([functools.reduce(partial(recipe.step, np.add), far) for far in fars])

    def distances(self, facts: Facts, scenes: int) -> Floats:
        """Return the distances of N scenes from the C conjunctions, shape (C, N): 0 where one holds."""
        with np.errstate(all="ignore"):
            results = self._steps.run(_Columns(facts, scenes))
        return np.array([np.broadcast_to(far.reshape(far.shape[-1]), (scenes,)) for far in results])


class _Columns:
    """The columns of facts, each of shape (rows, N) or (rows, 1)."""

    def __init__(self, facts: Facts, scenes: int) -> None:
        self._facts = facts
        self._scenes = scenes

    def column(self, key: tuple[str, int], place: int) -> Array:
        """Return a column of a relation; scenes lie side by side in memory, as operations run along them."""
        return np.ascontiguousarray(np.atleast_2d(np.asarray(self._facts[key].columns[place]).T))

    def valid(self, key: tuple[str, int]) -> Array:
        """Return which rows of a relation exist."""
        rows = self._facts[key]
        if rows.valid is not None:
            return np.ascontiguousarray(np.asarray(rows.valid).T)
        return np.ones((self.column(key, 0).shape[0], self._scenes), dtype=np.bool_)


@dataclass(frozen=True, slots=True)
class _Steps:
    """Array operations in order: each with the places of its arguments and of its result.

    An operation without arguments reads the columns. The last entry has the places that no later one reads.
    """

    steps: Sequence[tuple[Callable[..., Array], tuple[int, ...], int, tuple[int, ...]]]
    results: Sequence[int]

    def run(self, columns: _Columns) -> list[Array]:
        """Do the operations, and return the results."""
        values: list[Any] = [None] * len(self.steps)
        for function, args, place, unused in self.steps:
            values[place] = function(*[values[arg] for arg in args]) if args else function(columns)
            for other in unused:
                values[other] = None
        return [values[place] for place in self.results]


class _Recipe:
    """Lists array operations; none twice with the same arguments."""

    def __init__(self) -> None:
        self._steps: list[tuple[Callable[..., Array], tuple[int, ...]]] = []
        self._places: dict[Any, int] = {}

    def step(self, function: Callable[..., Any], *args: int, **fixed: Any) -> int:
        """Return the place of the result of an operation on other results, with `fixed` arguments besides."""
        key = (function, args, *fixed.items())
        known = self._places.get(key)
        if known is None:
            known = self._places[key] = len(self._steps)
            self._steps.append((partial(function, **fixed) if fixed else function, args))
        return known

    def constant(self, value: Any) -> int:
        """Return the place of an array of one number."""
        return self.step(_constant, value=value, kind=type(value))

    def finished(self, results: Sequence[int]) -> _Steps:
        """Return the steps that lead to these results."""
        needed = set(results)
        for place in range(len(self._steps) - 1, -1, -1):
            if place in needed:
                needed.update(self._steps[place][1])
        order = sorted(needed)
        place_of = {old: new for new, old in enumerate(order)}
        last = dict.fromkeys(results, -1)
        steps = []
        for old in reversed(order):
            function, args = self._steps[old]
            unused = tuple(place_of[arg] for arg in dict.fromkeys(args) if arg not in last)
            last.update((arg, old) for arg in args if arg not in last)
            steps.append((function, tuple(place_of[arg] for arg in args), place_of[old], unused))
        return _Steps(steps[::-1], [place_of[old] for old in results])


def _constant(_columns: _Columns, value: Any, kind: type) -> Array:
    return np.array([value])


class _Listing(RowMemory[int]):
    """Lists the operations for nodes of a lowered program."""

    def __init__(self, recipe: _Recipe, code: Callable[[str], int]) -> None:
        super().__init__()
        self._step = recipe.step
        self._constant = recipe.constant
        self._code = code

    def far(self, node: Node, wanted: bool) -> int:
        """List the distance of `node` from being true, or false if not `wanted`."""
        while node.op == "not":
            node, wanted = node.args[0], not wanted
        return self._once(("far", wanted), node, partial(self._make_far, wanted=wanted))

    def _make_far(self, node: Node, wanted: bool) -> int:
        match node.op:
            case "const":
                return self._constant(0.0 if node.data is wanted else 1.0)
            case "and" | "or":
                join = np.add if (node.op == "and") is wanted else np.minimum
                return functools.reduce(
                    partial(self._step, join), [self.far(arg, wanted) for arg in node.args]
                )
            case "any":
                return self._some_far(node, wanted)
            case "lt":
                return self._step(_far_from_less, *map(self._value, node.args), wanted=wanted)
            case "eq":
                return self._step(_far_from_equal, *map(self._value, node.args), wanted=wanted)
            case "within":
                return self._step(_far_from_within, self._value(node.args[0]), bound=node.data, wanted=wanted)
        raise AssertionError(f"no condition: {node.op}")

    def _some_far(self, node: Node, wanted: bool) -> int:
        """List the distance of the closest row that a quantifier visits; or of all rows together."""
        with self._visiting(node) as (level, rows):
            far = self.far(node.args[1], wanted)
            if wanted:
                missing = self._once(("missing", level), rows, partial(self._missing, level))
                return self._step(_least, self._step(np.add, missing, far), axis=-(level + 2))
            return self._step(_added_far, self._visited(level, rows), far, axis=-(level + 2))

    def _missing(self, level: int, rows: Node) -> int:
        """List by row, on the axis of a level, the distance from visiting it."""
        fars = []
        while rows.op == "where":
            rows, inner, cond = rows.args
            with self._at(inner, level):
                fars.append(self.far(cond, True))
        there = self._step(_unless, self._there(level, rows))
        return functools.reduce(partial(self._step, np.add), fars, there)

    def _holds(self, node: Node) -> int:
        return self._once("holds", node, self._make_holds)

    def _make_holds(self, node: Node) -> int:
        match node.op:
            case "const":
                return self._constant(bool(node.data))
            case "not":
                return self._step(np.logical_not, self._holds(node.args[0]))
            case "and" | "or":
                join = np.logical_and if node.op == "and" else np.logical_or
                return functools.reduce(partial(self._step, join), map(self._holds, node.args))
            case "any":
                with self._visiting(node) as (level, rows):
                    mask = self._step(np.logical_and, self._visited(level, rows), self._holds(node.args[1]))
                    return self._step(_any, mask, axis=-(level + 2))
            case "lt":
                return self._step(np.less, *map(self._value, node.args))
            case "eq":
                return self._step(np.equal, *map(self._value, node.args))
            case "within":
                return self._step(_OPS.within, self._value(node.args[0]), bound=node.data)
        raise AssertionError(f"no condition: {node.op}")

    @contextmanager
    def _visiting(self, node: Node) -> Iterator[tuple[int, Node]]:
        """Give a quantifier's loop a level, whose axis is -(level + 2); yield it with the rows it visits."""
        # levels distinguish loops that rules nest; loops in conditions on rows may share a level
        taken = {self._loops[other] for other in node.free}
        level = next(level for level in range(len(taken) + 1) if level not in taken)
        loop = node.args[0]
        with self._at(loop, level):
            yield level, loop.args[0]

    def _visited(self, level: int, rows: Node) -> int:
        """List by row, on the axis of a level, whether a quantifier visits it."""
        return self._once(("visited", level), rows, partial(self._make_visited, level))

    def _make_visited(self, level: int, rows: Node) -> int:
        conds = []
        while rows.op == "where":
            rows, inner, cond = rows.args
            with self._at(inner, level):
                conds.append(self._holds(cond))
        return functools.reduce(partial(self._step, np.logical_and), conds, self._there(level, rows))

    def _there(self, level: int, rows: Node) -> int:
        """List by row whether it exists, and is not the first of `others`."""
        relation = relation_of(rows)
        valid = self._step(_valid, key=(relation.name, relation.arity))
        there = self._step(_without_first, valid) if rows.op == "others" else valid
        return self._along(there, level)

    @contextmanager
    def _at(self, loop: Node, level: int) -> Iterator[None]:
        """Have a loop on an axis; an enclosing quantifier may use the same loop on another axis."""
        outer = self._loops.get(loop)
        self._loops[loop] = level
        yield
        self._leave(loop, outer)

    def _along(self, rows: int, level: int) -> int:
        """List values by row with the rows along the axis of a level."""
        return rows if level == 0 else self._step(_spread, rows, level=level)

    def _index(self, node: Node) -> int:
        return self._once("index", node, self._make_index)

    def _make_index(self, node: Node) -> int:
        if node.op == "row":
            return self._constant(0)
        if node.op == "loop":
            relation = relation_of(node)
            places = self._step(_places, self._step(_valid, key=(relation.name, relation.arity)))
            return self._along(places, self._loops[node])
        if node.op == "select":
            return self._step(np.where, self._holds(node.args[0]), *map(self._index, node.args[1:]))
        with self._visiting(node) as (level, rows):
            mask = self._step(np.logical_and, self._visited(level, rows), self._holds(node.args[1]))
            if node.op == "first":
                return self._step(_first, mask, axis=-(level + 2))
            least = node.op == "argmin"
            return self._step(_best, mask, self._value(node.args[2]), least=least, axis=-(level + 2))

    def _value(self, node: Node) -> int:
        return self._once("value", node, self._make_value)

    def _make_value(self, node: Node) -> int:
        if node.op == "const":
            return self._constant(self._code(node.data.name) if isinstance(node.data, Atom) else node.data)
        if node.op == "col":
            return self._column(node)
        if node.op == "select":
            return self._step(np.where, self._holds(node.args[0]), *map(self._value, node.args[1:]))
        if node.op in ("count", "sum", "min_of", "max_of"):
            return self._gathered(node)
        return self._step(_operation, *map(self._value, node.args), row=NODES[node.op])

    def _column(self, node: Node) -> int:
        relation, place = node.data
        rows = self._step(_column, key=(relation.name, relation.arity), place=place)
        index = node.args[0]
        if index.op == "row":
            return self._step(_first_row, rows)
        if index.op == "loop":
            return self._along(rows, self._loops[index])
        return self._step(_taken, rows, self._index(index))

    def _gathered(self, node: Node) -> int:
        """List a number aggregated over all rows."""
        with self._visiting(node) as (level, rows):
            axis = -(level + 2)
            mask = self._step(np.logical_and, self._visited(level, rows), self._holds(node.args[1]))
            if node.op == "count":
                return self._step(_count, mask, axis=axis)
            value = self._value(node.args[2])
        if node.op == "sum":
            return self._step(np.add, self._value(node.args[3]), self._step(_total, mask, value, axis=axis))
        return self._step(_extreme, mask, value, least=node.op == "min_of", axis=axis)


def _column(columns: _Columns, key: tuple[str, int], place: int) -> Array:
    return columns.column(key, place)


def _valid(columns: _Columns, key: tuple[str, int]) -> Array:
    return columns.valid(key)


def _without_first(there: Array) -> Array:
    return there & (np.arange(there.shape[0]) > 0)[:, None]


def _unless(there: Array) -> Array:
    return np.asarray(1.0 - there)


def _spread(rows: Array, level: int) -> Array:
    return rows.reshape(rows.shape[0], *(1,) * level, rows.shape[1])


def _places(valid: Array) -> Array:
    return np.arange(valid.shape[0])[:, None]


def _first_row(rows: Array) -> Array:
    return np.asarray(rows[0])


def _taken(rows: Array, index: Array) -> Array:
    return np.asarray(rows[index, np.arange(rows.shape[1])])


def _operation(*values: Array, row: Operation) -> Array:
    return _OPS.apply(row, *values)


def _least(far: Array, axis: int) -> Array:
    return np.asarray(np.minimum.reduce(far, axis=axis, keepdims=True))


def _added_far(visited: Array, far: Array, axis: int) -> Array:
    return np.asarray(np.add.reduce(visited * far, axis=axis, keepdims=True))


def _any(mask: Array, axis: int) -> Array:
    return np.asarray(np.logical_or.reduce(mask, axis=axis, keepdims=True))


def _first(mask: Array, axis: int) -> Array:
    return np.asarray(mask.argmax(axis=axis, keepdims=True))


def _best(mask: Array, value: Array, least: bool, axis: int) -> Array:
    masked = np.where(mask, value, np.inf if least else -np.inf)
    return np.asarray((masked.argmin if least else masked.argmax)(axis=axis, keepdims=True))


def _count(mask: Array, axis: int) -> Array:
    return np.asarray(np.count_nonzero(mask, axis=axis, keepdims=True))


def _total(mask: Array, value: Array, axis: int) -> Array:
    return np.asarray(np.add.reduce(np.where(mask, value, 0), axis=axis, keepdims=True))


def _extreme(mask: Array, value: Array, least: bool, axis: int) -> Array:
    masked = np.where(mask, value, np.inf if least else -np.inf)
    return np.asarray((np.minimum if least else np.maximum).reduce(masked, axis=axis, keepdims=True))


def _far_from_less(left: Array, right: Array, wanted: bool) -> Array:
    return _shortfall(left < right, left - right, wanted)


def _far_from_equal(left: Array, right: Array, wanted: bool) -> Array:
    if left.dtype.kind == "f":
        return _shortfall(left == right, np.abs(left - right), wanted)
    return np.asarray(left != right if wanted else left == right).astype(np.float64)


def _far_from_within(value: Array, bound: float, wanted: bool) -> Array:
    return _shortfall(_OPS.within(value, bound), np.abs(value) - bound, wanted)


def _shortfall(holds: Array, excess: Array, wanted: bool) -> Array:
    """Return by how much a comparison fails, from 0 to 1; `excess` is above 0 if it does not hold."""
    gap = excess if wanted else -excess
    size = np.asarray(1.0 + np.abs(gap))
    np.divide(gap, size, out=size)
    np.fmin(size, 1.0, out=size)  # an infinite or undefined amount counts as 1
    size += _HARDLY
    size *= ~holds if wanted else holds  # a product is much faster than a choice by a mask
    return size
