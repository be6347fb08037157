"""Lowered programs on NumPy arrays: thousands of scenes in one call."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np

from drlsl.logic.lowering.arrays import ArrayPrinter
from drlsl.logic.lowering.lower import Answer, Lowered, Query
from drlsl.logic.lowering.numpy_ops import Array, Mask, Ops
from drlsl.logic.lowering.schema import FLOAT_BOUND, INT_BOUND, Relation
from drlsl.logic.terms import Atom

CHUNK: Final = 2048
"""Scenes that are answered together: more of them no longer fit the processor's cache."""

_LARGE_BLOCK: Final = 1 << 24
_PIECE: Final = 1 << 13


@dataclass(frozen=True, slots=True)
class Rows:
    """The rows of one relation in N scenes.

    `columns` has an array for each column, or None for one that is not used: of shape (N, K), or (1, K) where
    all scenes share them; for a single relation (N,) or (1,). `valid`, of the same shape, marks the rows that
    are there; None where all are. Arrays in Fortran order are taken as they are. Atoms are integers, see
    `ArrayProgram.code`.
    """

    columns: Sequence[Array | None]
    valid: Mask | None = None

    @property
    def scenes(self) -> int:
        """N, or 1 where all scenes share the rows."""
        arrays = [array for array in (*self.columns, self.valid) if array is not None]
        return max((array.shape[0] for array in arrays), default=1)


@dataclass(frozen=True, slots=True)
class ArrayAnswer:
    """The answers to one query in N scenes.

    `value`: for `holds` (N,) bool; for `first` the argument (N,), or (N, n) for a list or for n arguments;
    for `set` and `all` (N, n) bool, for each value of `ArrayProgram.choices` whether it is a solution.
    `fails` (N,): there is no solution, and `value` means nothing.
    """

    value: Array
    fails: Mask


@dataclass(frozen=True, slots=True)
class ArrayResult:
    """The answers to all queries; where `undecided` (N,) is set ask the interpreter instead."""

    answers: tuple[ArrayAnswer, ...]
    undecided: Mask


def compile_numpy(lowered: Lowered, dtype: Literal["float64", "float32"] = "float64") -> ArrayProgram:
    """The program that answers all queries for many scenes.

    With float64 the answers equal the interpreter's, with float32 only nearly.

    Raises:
        NotLowerable: a query's answer has no form as an array.
    """
    return ArrayProgram(lowered, np.dtype(dtype))


def numpy_source(lowered: Lowered) -> str:
    """The text of the function over arrays."""
    return ArrayPrinter(lowered).module()


class ArrayProgram:
    """A lowered program, ready for arrays."""

    def __init__(self, lowered: Lowered, dtype: np.dtype[Any]) -> None:
        printer = ArrayPrinter(lowered)
        namespace: dict[str, Any] = {}
        exec(compile(printer.module(), "<lowered rules>", "exec"), namespace)  # noqa: S102  (the text is made here)
        self._function: Callable[[Ops, Mapping[Any, Table]], Iterable[tuple[Array, ...]]] = namespace[
            "answer"
        ]
        self._answers: Sequence[Answer] = lowered.answers
        self._columns = {
            (relation.name, relation.arity): (relation, tuple(sorted(used)))
            for relation, used in printer.columns.items()
        }
        self._shapes = printer.shapes
        self._dtype = dtype
        # glibc learns from the first large block that is freed to keep freed memory; without that the arrays
        # of each call cost a quarter of its time in page faults.
        np.empty(_LARGE_BLOCK, dtype=np.uint8)
        self._codes = printer.codes
        self.choices: Final[Mapping[Query, tuple[str | int | float, ...]]] = {
            answer.query: tuple(
                value.name if isinstance(value, Atom) else value for value, _ in answer.choices
            )
            for answer in lowered.answers
            if answer.choices is not None
        }

    def code(self, atom: str) -> int:
        """The integer that stands for an atom in arrays."""
        return self._codes.setdefault(atom, len(self._codes))

    def atom(self, code: int) -> str:
        """The atom that an integer stands for."""
        return list(self._codes)[code]

    @property
    def reads(self) -> Collection[tuple[str, int]]:
        """The relations that the program reads, by name and arity."""
        return self._columns.keys()

    def table(self, name: str, arity: int, rows: Rows) -> Table:
        """The rows of a relation made ready, for facts that stay the same from call to call.

        Raises:
            ValueError: a column is missing, or of another shape.
        """
        relation, used = self._columns[name, arity]
        return Table(relation, used, rows, self._dtype)

    def __call__(self, facts: Mapping[tuple[str, int], Rows | Table]) -> ArrayResult:
        """The answers for the facts of N scenes.

        Raises:
            ValueError: a relation or a column is missing, or the shapes do not fit together.
        """
        tables: dict[tuple[str, int], Table] = {}
        for (name, arity), (relation, used) in self._columns.items():
            given = facts.get((name, arity))
            if given is None:
                raise ValueError(f"no facts of {name}/{arity}")
            tables[name, arity] = (
                given if isinstance(given, Table) else Table(relation, used, given, self._dtype)
            )
        scenes = max((given.scenes for given in facts.values()), default=1)
        for table in tables.values():
            if table.scenes not in (1, scenes):
                raise ValueError(f"{table}: {table.scenes} scenes where others have {scenes}")
        if scenes <= CHUNK:
            return self._chunk(tables, scenes)
        chunks = [
            self._chunk(
                {key: table.part(start, start + CHUNK) for key, table in tables.items()},
                min(CHUNK, scenes - start),
            )
            for start in range(0, scenes, CHUNK)
        ]
        answers = tuple(
            ArrayAnswer(
                np.concatenate([part.value for part in parts]), np.concatenate([part.fails for part in parts])
            )
            for parts in zip(*(chunk.answers for chunk in chunks), strict=True)
        )
        return ArrayResult(answers, np.concatenate([chunk.undecided for chunk in chunks]))

    def _chunk(self, tables: Mapping[Any, Table], scenes: int) -> ArrayResult:
        with np.errstate(all="ignore"):  # an operation may go wrong in rows that no rule looks at
            results = iter(self._function(Ops(self._dtype, scenes), tables))
            undecided = np.zeros(scenes, dtype=np.bool_)
            undecided |= next(results)[0]
            for table in tables.values():
                table.doubt(undecided)
            answers = tuple(
                self._answer(answer, result, scenes)
                for answer, result in zip(self._answers, results, strict=True)
            )
        return ArrayResult(answers, undecided)

    def _answer(self, answer: Answer, result: tuple[Array, ...], scenes: int) -> ArrayAnswer:
        if answer.query.mode == "holds":
            return ArrayAnswer(_filled(result[0], scenes), np.zeros(scenes, dtype=np.bool_))
        if answer.query.mode == "first":
            exact, plain = self._shapes[str(answer.query)]
            fails = ~_filled(result[0], scenes)
            value = np.empty((len(result) - 1, scenes), dtype=np.int64 if exact else self._dtype)
            for place, column in enumerate(result[1:]):
                value[place] = column
            return ArrayAnswer(value[0] if plain else value.T, fails)
        value = np.empty((len(result), scenes), dtype=np.bool_)
        for place, column in enumerate(result):
            value[place] = column
        return ArrayAnswer(value.T, ~np.logical_or.reduce(value, axis=0))


def _filled(mask: Array, scenes: int) -> Mask:
    result = np.empty(scenes, dtype=np.bool_)
    result[:] = mask
    return result


class Table:
    """The columns of one relation that are read: rows along the first axis, scenes along the last."""

    __slots__ = ("_columns", "_is_sound", "_relation", "scenes", "valid")

    def __init__(self, relation: Relation, used: Sequence[int], rows: Rows, dtype: np.dtype[Any]) -> None:
        self._relation = relation
        if len(rows.columns) != relation.arity:
            raise ValueError(f"{self}: {len(rows.columns)} columns")
        self._columns: dict[int, Array] = {}
        for place in used:
            column = rows.columns[place]
            if column is None:
                raise ValueError(f"the rules read column {place} of {self}, which is not given")
            self._columns[place] = self._rows_first(
                column, dtype if relation.columns[place] == "float" else _INTEGER
            )
        self.valid: Mask = self._valid(rows)
        self.scenes: int = max(column.shape[-1] for column in (self.valid, *self._columns.values()))
        self._pad()
        self._is_sound = self._looks_sound()

    def __str__(self) -> str:
        return f"{self._relation.name}/{self._relation.arity}"

    def _rows_first(self, column: Array, kind: np.dtype[Any]) -> Array:
        if self._relation.single:
            return np.asarray(column, dtype=kind).reshape(1, -1)
        if column.ndim != 2:
            raise ValueError(f"{self}: a column of shape {column.shape}, expected (N, K)")
        return np.ascontiguousarray(column.T, dtype=kind)

    def _valid(self, rows: Rows) -> Mask:
        if rows.valid is not None:
            return self._rows_first(rows.valid, np.dtype(np.bool_))
        if self._relation.single:
            return _ONE_ROW
        height = next((column.shape[1] for column in rows.columns if column is not None), 0)
        return np.ones((height, 1), dtype=np.bool_)

    def _pad(self) -> None:
        """Have at least one row to reduce over."""
        missing = (1 if self._relation.first is None else 2) - self.valid.shape[0]
        if missing > 0:
            self.valid = _with_rows(self.valid, missing)
            self._columns = {place: _with_rows(column, missing) for place, column in self._columns.items()}

    def _looks_sound(self) -> bool:
        """Whether a quick look already shows that all is as the schema says."""
        relation = self._relation
        for place, column in self._columns.items():
            if relation.columns[place] == "float":
                if not _sum_of_squares(column) <= FLOAT_BOUND**2:
                    return False  # too large, or not a number
            elif not -INT_BOUND <= column.min() <= column.max() <= INT_BOUND:
                return False
        if relation.key in self._columns and self.valid.shape[0] > 1:
            keys = self._columns[relation.key]
            if not (keys[1:] > keys[:-1]).all():
                return False
        if relation.single or relation.first is not None:
            return self.valid is _ONE_ROW or bool(self.valid[0].all())
        return True

    def column(self, place: int) -> Array:
        """One column."""
        return self._columns[place]

    def part(self, start: int, stop: int) -> Table:
        """The table for some of the scenes."""
        result = Table.__new__(Table)
        result._relation, result._is_sound = self._relation, self._is_sound
        result.valid = _scenes(self.valid, start, stop)
        result._columns = {place: _scenes(column, start, stop) for place, column in self._columns.items()}
        result.scenes = 1 if self.scenes == 1 else min(stop, self.scenes) - start
        return result

    def doubt(self, undecided: Mask) -> None:
        """Mark the scenes whose facts are not what the schema says."""
        if self._is_sound:
            return
        relation = self._relation
        for place, column in self._columns.items():
            bound = FLOAT_BOUND if relation.columns[place] == "float" else INT_BOUND
            undecided |= (~(np.abs(column) <= bound) & self.valid).any(axis=0)
        if relation.single or relation.first is not None:
            undecided |= ~self.valid[0]
        if relation.key in self._columns and relation.key is not None:
            undecided |= _repeats(self._columns[relation.key], self.valid)


_INTEGER: Final = np.dtype(np.int64)
_ONE_ROW: Final[Mask] = np.ones((1, 1), dtype=np.bool_)


def _with_rows(column: Array, missing: int) -> Array:
    return np.concatenate([column, np.zeros((missing, column.shape[1]), dtype=column.dtype)])


def _sum_of_squares(column: Array) -> float:
    """The sum of all squares, in pieces too short for a linear algebra library to start threads."""
    flat = column.reshape(-1)
    pieces = (flat[start : start + _PIECE] for start in range(0, flat.size, _PIECE))
    return float(sum(piece.dot(piece) for piece in pieces))


def _scenes(column: Array, start: int, stop: int) -> Array:
    return column if column.shape[-1] == 1 else np.ascontiguousarray(column[:, start:stop])


def _repeats(keys: Array, valid: Mask) -> Mask:
    """The scenes in which two rows have one key."""
    places = np.arange(keys.shape[0])[:, None]
    # rows that are not there get keys that no row has
    apart = np.where(valid, keys, np.iinfo(np.int64).min + places)
    ordered = np.sort(apart, axis=0)
    repeats: Mask = (ordered[1:] == ordered[:-1]).any(axis=0)
    return repeats
