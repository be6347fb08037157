"""Lowered programs as machine code: loops over scenes and rows, compiled by Numba."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from drlsl.lowering.backends.array_loops import ArrayLoopPrinter, Given, Kind, Parameter
from drlsl.lowering.backends.batch_program import BatchAnswer, BatchProgram, BatchResult, Layout, Rows
from drlsl.lowering.backends.numpy_backend import Table
from drlsl.lowering.backends.numpy_ops import Array
from drlsl.lowering.frontend import Lowered
from drlsl.lowering.ir import FLOAT_BOUND

_DTYPES: Final[dict[Kind, np.dtype[Any]]] = {
    "bool": np.dtype(np.bool_),
    "int": np.dtype(np.int64),
    "float": np.dtype(np.float64),
}
_OWN_TABLES: Final[Array] = np.empty(0, dtype=np.int64)

ArrayAnswer = BatchAnswer[Array]
ArrayResult = BatchResult[Array]
Facts = Mapping[tuple[str, int], Rows]


def compile_numba(lowered: Lowered, folder: Path | None = None) -> NumbaProgram:
    """Return the program that answers all queries for many scenes, or one, exactly as the interpreter.

    The machine code is kept in `folder`, and loaded from there the next time; if that is impossible, a
    warning is logged.

    Raises:
        ImportError: Numba is not installed, or does not load.
        NotLowerable: a query's answer has no form as an array.
    """
    from drlsl.lowering.backends.numba_compile import compiled

    printer = ArrayLoopPrinter(lowered)
    return NumbaProgram(lowered, printer, compiled(printer, folder))


def numba_source(lowered: Lowered) -> str:
    """Return the text of the function."""
    return ArrayLoopPrinter(lowered).module()


class NumbaProgram(BatchProgram[Array]):
    """A lowered program as machine code.

    In an undecided scene nothing holds, every `first` and `set` fails, and floats are NaN.
    """

    def __init__(self, lowered: Lowered, printer: ArrayLoopPrinter, function: Any) -> None:
        """Take over `function`, that of `printer`, compiled or not."""
        columns = {relation: given.columns.keys() for relation, given in printer.given.items()}
        super().__init__(lowered, printer.codes, columns)
        self._function = function
        self._given = {(relation.name, relation.arity): given for relation, given in printer.given.items()}
        self._outputs = [
            (value.width if value.axes == 2 else None, _DTYPES[value.kind], bool(fails))
            for value, *fails in printer.outputs
        ]
        self._order = [(key, tuple(given.columns)) for key, given in self._given.items()]
        places = {parameter.name: place for place, parameter in enumerate(printer.parameters)}
        self._buffers = [
            None if relation.single else places[printer.given[relation].shape.name]
            for _, relation in printer.buffers
        ]
        """The arguments that tell by their rows how long the buffers are; None for one place."""

    def __call__(self, facts: Facts) -> ArrayResult:
        """Return the answers for the facts of N scenes.

        Arrays of float64, int64 and bool in C order are read as they are, others are copied.

        Raises:
            ValueError: a relation or a column is missing, or the shapes or kinds do not fit.
        """
        try:
            arguments, scenes = self._flat(facts)
            result, outputs = self._blank(scenes)
            if self._function(*arguments, *outputs, *self._empty(arguments)):
                return result
        except (
            AttributeError,
            IndexError,
            KeyError,
            TypeError,
        ):  # not an array that machine code can read directly
            pass
        ready = {key: self._ready(given, facts.get(key)) for key, given in self._given.items()}
        scenes = _common_scenes({**facts, **ready})
        result, outputs = self._blank(scenes)
        arguments, _ = self._flat(ready)
        if not self._function(*arguments, *outputs, *self._empty(arguments)):
            raise AssertionError("prepared facts do not fit")
        return result

    def table(self, name: str, arity: int, rows: Rows) -> Rows:
        """Return the rows of a relation in the form that is read without a copy.

        Raises:
            ValueError: a column is missing, or of another shape or kind.
        """
        given = self._given[name, arity]
        ready = self._ready(given, rows)
        if ready.scenes > 1:
            return ready
        columns = [ready.columns[place] for place in given.columns]
        return _ReadyRows(ready.columns, ready.valid, arguments=(*columns, ready.valid, _OWN_TABLES))

    def bind(self, facts: Facts) -> BoundProgram:
        """Return the program for arrays that stay in place while their numbers change.

        Raises:
            ValueError: a relation or a column is missing, or an array could not be read without a copy.
        """
        ready = {key: self._ready(given, facts.get(key)) for key, given in self._given.items()}
        scenes = _common_scenes({**facts, **ready})
        arguments, _ = self._flat(facts)
        parameters = [parameter for given in self._given.values() for parameter in given.parameters]
        for parameter, array in zip(parameters, arguments, strict=True):
            if array is None or array.dtype != _DTYPES[parameter.kind] or not array.flags.c_contiguous:
                raise ValueError(
                    f"{parameter.name} cannot be read in place: not an array of {parameter.kind} in C order"
                )
        result, outputs = self._blank(scenes)
        bound = BoundProgram(self._function, [*arguments, *outputs, *self._empty(arguments)], result)
        bound()
        return bound

    def _flat(self, facts: Facts) -> tuple[list[Any], int]:
        """Return the function's arrays, and the number of scenes that they seem to have."""
        arguments: list[Any] = []
        scenes = 1
        for key, used in self._order:
            rows = facts[key]
            if type(rows) is _ReadyRows:
                arguments += rows.arguments
                continue
            columns, valid, index = rows.columns, rows.valid, rows.index
            arguments += [columns[place] for place in used]
            if valid is None:
                first = columns[used[0]] if used else None
                valid = _all_there((0,) if first is None else np.shape(first))
            arguments.append(valid)
            arguments.append(_OWN_TABLES if index is None else index)
            if scenes == 1:
                longest: Any = index if index is not None else columns[used[0]] if used else rows.valid
                scenes = len(longest)
        if scenes == 1 and len(facts) > len(self._order):
            scenes = _common_scenes(facts)
        return arguments, scenes

    def _empty(self, arguments: Sequence[Any]) -> list[Array]:
        """Return buffers for one call: threads may be in the function at once."""
        rows = (1 if place is None else arguments[place].shape[1] for place in self._buffers)
        return [np.empty(most, np.int64) for most in rows]

    def _blank(self, scenes: int) -> tuple[ArrayResult, list[Array]]:
        """Return a result to be filled, and its arrays in the order of the function's parameters."""
        undecided = np.empty(scenes, np.bool_)
        arrays, answers = [undecided], []
        for width, dtype, can_fail in self._outputs:
            value = np.empty(scenes if width is None else (scenes, width), dtype)
            arrays.append(value)
            if can_fail:
                fails = np.empty(scenes, np.bool_)
                arrays.append(fails)
            else:
                fails = np.zeros(scenes, np.bool_)
            answers.append(BatchAnswer(value, fails))
        return BatchResult(tuple(answers), undecided), arrays

    def _ready(self, given: Given, rows: Rows | None) -> Rows:
        relation = given.relation
        if rows is None:
            raise ValueError(f"no facts of {relation.name}/{relation.arity}")
        table = Table(Layout(relation, tuple(given.columns), FLOAT_BOUND, _DTYPES), rows)
        columns = [
            _scenes_first(table.column(place), given.valid, table.scenes) if place in given.columns else None
            for place in range(relation.arity)
        ]
        return Rows(columns, _scenes_first(table.valid, given.valid, table.scenes))


@dataclass(frozen=True, slots=True, kw_only=True)
class _ReadyRows(Rows):
    """Rows that all scenes share, with the function's arrays for them."""

    arguments: tuple[Any, ...]


class BoundProgram:
    """A program with the arrays that it reads and fills: a call has almost no overhead."""

    __slots__ = ("_arguments", "_function", "_result")

    def __init__(self, function: Any, arguments: Sequence[Array], result: ArrayResult) -> None:
        self._function = function
        self._arguments = tuple(arguments)
        self._result = result

    def __call__(self) -> ArrayResult:
        """Return the answers for the numbers that the arrays hold now; the next call overwrites them.

        Raises:
            ValueError: the shapes do not fit, or a scene's table is missing.
        """
        if not self._function(*self._arguments):
            raise ValueError("shapes do not fit, or an index is beyond the tables")
        return self._result


@lru_cache(maxsize=4)
def _all_there(shape: tuple[int, ...]) -> Array:
    """Return the mask of tables whose rows are all there, for columns of that shape; nobody writes to it."""
    mask = np.ones(shape, np.bool_)
    mask.setflags(write=False)
    return mask


def _common_scenes(facts: Facts) -> int:
    scenes = {rows.scenes for rows in facts.values()} - {1}
    if len(scenes) > 1:
        raise ValueError(f"facts of {' and '.join(map(str, sorted(scenes)))} scenes")
    return scenes.pop() if scenes else 1


def _scenes_first(column: Array, like: Parameter, scenes: int) -> Array:
    if column.shape[1] != scenes:
        column = np.broadcast_to(column, (column.shape[0], scenes))
    return np.ascontiguousarray(column.T if like.axes == 2 else column[0])
