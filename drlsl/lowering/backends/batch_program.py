"""The common part of the back ends for many scenes: facts as arrays in, answers as arrays out.

An array is one of the back end's library. This module holds the parts that are independent of it: the checks
of shapes, the codes of atoms, the scenes in chunks.
"""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Generic, Literal, NamedTuple, TypeAlias, TypeVar

from drlsl.logic.terms import Atom
from drlsl.lowering.backends.arrays import ArrayPrinter
from drlsl.lowering.frontend import Answer, Lowered, Query
from drlsl.lowering.ir import FLOAT32_BOUND, FLOAT_BOUND, INT_BOUND, Relation

A = TypeVar("A")
Precision: TypeAlias = Literal["float64", "float32"]
Kind: TypeAlias = Literal["bool", "int", "float"]
Facts: TypeAlias = "Mapping[tuple[str, int], Rows | Table]"


@dataclass(frozen=True, slots=True)
class Rows:
    """The rows of one relation in N scenes.

    `columns` has an array for each column, or None for one that is not used: of shape (N, K), or (1, K) if
    all scenes share them; for a single relation (N,) or (1,). `valid`, of the same shape, marks the rows that
    exist; None if all do. Columns of integers and atoms hold integers, see `BatchProgram.code`.
    With `index`, shape (N,), N counts tables instead, and scene n has the rows of table `index[n]`.
    """

    columns: Sequence[Any | None]
    valid: Any | None = None
    index: Any | None = None

    @property
    def scenes(self) -> int:
        """N, or 1 if all scenes share the rows."""
        if self.index is not None:
            return len(self.index)
        for array in (*self.columns, self.valid):
            if array is not None and array.shape[0] != 1:
                return int(array.shape[0])
        return 1


class Layout(NamedTuple):
    """The columns that a program reads of a relation, the bound of its floats, and the types of kinds."""

    relation: Relation
    used: Sequence[int]
    bound: float
    kinds: Mapping[Kind, Any]


def _common(lengths: Iterable[int]) -> int:
    """Return the common length of an axis of arrays; length 1 fits any."""
    return next((length for length in lengths if length != 1), 1)


class BatchAnswer(NamedTuple, Generic[A]):
    """The answers to one query in N scenes.

    `value`: for `holds` (N,) bool; for `first` the argument (N,), or (N, n) for a list or for n arguments;
    for `set` and `all` (N, n) bool, for each value of `BatchProgram.choices` whether it is a solution.
    `fails` (N,): there is no solution, and `value` is undefined.
    """

    value: A
    fails: A


class BatchResult(NamedTuple, Generic[A]):
    """The answers to all queries; where `undecided` (N,) is set, query the interpreter instead."""

    answers: tuple[BatchAnswer[A], ...]
    undecided: A


class BatchProgram(ABC, Generic[A]):
    """A lowered program that answers for many scenes in one call."""

    def __init__(
        self, lowered: Lowered, codes: dict[str, int], columns: Mapping[Relation, Collection[int]]
    ) -> None:
        """Prepare a program with its atoms' `codes` and the `columns` that it reads of each relation."""
        self._codes = codes
        self._columns = {
            (relation.name, relation.arity): (relation, tuple(sorted(used)))
            for relation, used in columns.items()
        }
        self.choices: Final[Mapping[Query, tuple[str | int | float, ...]]] = {
            answer.query: tuple(
                value.name if isinstance(value, Atom) else value for value, _ in answer.choices
            )
            for answer in lowered.answers
            if answer.choices is not None
        }

    def code(self, atom: str) -> int:
        """Return the integer of an atom in arrays."""
        return self._codes.setdefault(atom, len(self._codes))

    def atom(self, code: int) -> str:
        """Return the atom of an integer."""
        return list(self._codes)[code]

    @property
    def reads(self) -> Collection[tuple[str, int]]:
        """The relations that the program reads, by name and arity."""
        return self._columns.keys()

    def columns_read(self, name: str, arity: int) -> Sequence[int]:
        """Return the columns of a relation that the program reads; the others may be None."""
        return self._columns[name, arity][1] if (name, arity) in self._columns else ()

    @abstractmethod
    def table(self, name: str, arity: int, rows: Rows) -> Any:
        """Return the rows of a relation, prepared for facts that stay the same from call to call.

        Raises:
            ValueError: a column is missing, or of another shape or kind.
        """

    @abstractmethod
    def __call__(self, facts: Any) -> BatchResult[A]:
        """Return the answers for the facts of N scenes, by name and arity."""


class TextProgram(BatchProgram[A]):
    """A program whose function is the text of `ArrayPrinter`."""

    def __init__(
        self, lowered: Lowered, precision: Precision, kinds_of: Callable[[Precision], Mapping[Kind, Any]]
    ) -> None:
        if precision not in ("float64", "float32"):
            raise ValueError(f"{precision}: expected float64 or float32")
        printer = ArrayPrinter(lowered)
        namespace: dict[str, Any] = {}
        exec(compile(printer.module(), "<lowered rules>", "exec"), namespace)  # noqa: S102  (the text is made here)
        super().__init__(lowered, printer.codes, printer.columns)
        self._function: Callable[[Any, Mapping[Any, Table]], Iterable[tuple[Any, ...]]] = namespace["answer"]
        self._lowered_answers: Sequence[Answer] = lowered.answers
        self._shapes = printer.shapes
        self._kinds: Final = kinds_of(precision)
        bound = FLOAT_BOUND if precision == "float64" else FLOAT32_BOUND
        self._layouts: Final = {
            key: Layout(relation, used, bound, self._kinds) for key, (relation, used) in self._columns.items()
        }

    def table(self, name: str, arity: int, rows: Rows) -> Table:
        """Return the rows of a relation, prepared for facts that stay the same from call to call.

        Raises:
            ValueError: a column is missing, or of another shape or kind.
        """
        table = self._table(self._layouts[name, arity], rows)
        table.look()
        return table

    def __call__(self, facts: Facts) -> BatchResult[A]:
        """Return the answers for the facts of N scenes.

        Raises:
            ValueError: a relation or a column is missing, or the shapes or kinds do not fit.
        """
        tables: dict[tuple[str, int], Table] = {}
        for (name, arity), layout in self._layouts.items():
            given = facts.get((name, arity))
            if given is None:
                raise ValueError(f"no facts of {name}/{arity}")
            tables[name, arity] = given if isinstance(given, Table) else self._table(layout, given)
        scenes = _common(given.scenes for given in facts.values())
        for (name, arity), given in facts.items():
            if given.scenes not in (1, scenes):
                raise ValueError(f"{name}/{arity}: {given.scenes} scenes where others have {scenes}")
        return self._answers(tables, scenes)

    @abstractmethod
    def _table(self, layout: Layout, rows: Rows) -> Table:
        """Return the rows in the form that the program reads."""

    def _answers(self, tables: Mapping[Any, Table], scenes: int) -> BatchResult[A]:
        most = self._most_scenes(scenes)
        if scenes <= most:
            return self._chunk(tables, scenes)
        chunks = [
            self._chunk(
                {key: table.part(start, start + most) for key, table in tables.items()},
                min(most, scenes - start),
            )
            for start in range(0, scenes, most)
        ]
        answers = tuple(
            BatchAnswer(
                self._joined([part.value for part in parts]), self._joined([part.fails for part in parts])
            )
            for parts in zip(*(chunk.answers for chunk in chunks), strict=True)
        )
        return BatchResult(answers, self._joined([chunk.undecided for chunk in chunks]))

    def _chunk(self, tables: Mapping[Any, Table], scenes: int) -> BatchResult[A]:
        """Return the answers for scenes that are computed together."""
        results = self._results(tables, scenes)
        undecided: Any = self._empty((scenes,), "bool")
        undecided[:] = next(results)[0]
        for table in tables.values():
            table.doubt(undecided)
        answers = tuple(
            self._answer(answer, result, scenes)
            for answer, result in zip(self._lowered_answers, results, strict=True)
        )
        return BatchResult(answers, undecided)

    def _answer(self, answer: Answer, result: tuple[Any, ...], scenes: int) -> BatchAnswer[A]:
        if answer.query.mode == "holds":
            never: Any = self._empty((scenes,), "bool")
            never[:] = False
            return BatchAnswer(self._stacked(result, scenes, "bool")[0], never)
        if answer.query.mode == "first":
            exact, plain = self._shapes[str(answer.query)]
            fails = ~self._stacked(result[:1], scenes, "bool")[0]
            value = self._stacked(result[1:], scenes, "int" if exact else "float")
            return BatchAnswer(value[0] if plain else value.T, fails)
        value = self._stacked(result, scenes, "bool")
        return BatchAnswer(value.T, ~value.any(axis=0))

    def _stacked(self, columns: Sequence[Any], scenes: int, kind: Kind) -> Any:
        """Return values of the scenes, some perhaps constant, as the rows of one array."""
        value: Any = self._empty((len(columns), scenes), kind)
        for place, column in enumerate(columns):
            value[place] = column
        return value

    def _results(self, tables: Mapping[Any, Table], scenes: int) -> Iterator[tuple[Any, ...]]:
        return iter(self._function(self._ops(scenes), tables))

    @abstractmethod
    def _ops(self, scenes: int) -> Any:
        """Return the operations that the text calls."""

    @abstractmethod
    def _most_scenes(self, scenes: int) -> int:
        """Return the number of `scenes` scenes to answer together."""

    @abstractmethod
    def _empty(self, shape: tuple[int, ...], kind: Kind) -> A:
        """Return an array to be filled."""

    @abstractmethod
    def _joined(self, parts: Sequence[A]) -> A:
        """Return the concatenation of arrays along the first axis."""


class Table(ABC):
    """The columns of one relation that are read: rows along the first axis, scenes along the last.

    `scenes` is their number, 1 if all share the rows; `valid` marks the rows that exist.
    """

    __slots__ = ("_always_there", "_bound", "_columns", "_is_sound", "_kinds", "_relation", "scenes", "valid")

    def __init__(self, layout: Layout, rows: Rows) -> None:
        relation, used, self._bound, self._kinds = layout
        self._relation = relation
        if len(rows.columns) != relation.arity:
            raise ValueError(f"{self}: {len(rows.columns)} columns")
        self._columns: dict[int, Any] = {}
        for place in used:
            column = rows.columns[place]
            if column is None:
                raise ValueError(f"the rules read column {place} of {self}, which is missing")
            kind: Kind = "float" if relation.columns[place] == "float" else "int"
            if not self._is_of(column, kind):
                raise ValueError(
                    f"column {place} of {self} holds numbers of kind {relation.columns[place]}, "
                    f"and is given as {column.dtype}"
                )
            self._columns[place] = self._rows_first(column, kind)
        self.valid: Any = self._valid(rows)
        self._always_there = relation.single and rows.valid is None
        self.scenes: int = self._fitting_scenes()
        if rows.index is not None:
            self._spread(rows.index)
        self._pad()
        self._is_sound = False

    def __str__(self) -> str:
        return f"{self._relation.name}/{self._relation.arity}"

    def _rows_first(self, column: Any, kind: Kind) -> Any:
        if self._relation.single:
            return self._converted(column.reshape(1, -1), kind)
        if column.ndim != 2:
            raise ValueError(f"{self}: a column of shape {tuple(column.shape)}, expected (N, K)")
        return self._converted(column.T, kind)

    def _valid(self, rows: Rows) -> Any:
        if rows.valid is not None:
            return self._rows_first(rows.valid, "bool")
        if self._relation.single:
            return self._all_there(1)
        return self._all_there(next((column.shape[1] for column in rows.columns if column is not None), 0))

    def _fitting_scenes(self) -> int:
        arrays = (self.valid, *self._columns.values())
        heights = sorted({array.shape[0] for array in arrays})
        if len(heights) > 1:
            raise ValueError(f"{self}: arrays for {' and '.join(map(str, heights))} rows")
        scenes = _common(array.shape[1] for array in arrays)
        widths = sorted({1, scenes}.union(array.shape[1] for array in arrays))
        if len(widths) > 2:
            raise ValueError(f"{self}: arrays for {' and '.join(map(str, widths[1:]))} scenes")
        return scenes

    def _spread(self, index: Any) -> None:
        """Give each scene the rows of its table."""
        if bool(((index < 0) | (index >= self.scenes)).any()):
            raise ValueError(f"{self}: an index beyond its {self.scenes} tables")
        index = self._placed(index)
        self.valid = self._gathered(self.valid, index)
        self._columns = {place: self._gathered(column, index) for place, column in self._columns.items()}
        self.scenes = len(index)

    def _placed(self, index: Any) -> Any:
        """Return an index on the device of the columns."""
        return index

    def _gathered(self, column: Any, index: Any) -> Any:
        """Return a column's rows in the order of `index`; rows that all tables share stay shared."""
        return column if column.shape[1] == 1 else column[:, index]

    def _pad(self) -> None:
        """Add a row if there is none, so that reductions are defined."""
        missing = (1 if self._relation.first is None else 2) - self.valid.shape[0]
        if missing > 0:
            self.valid = self._with_rows(self.valid, missing)
            self._columns = {
                place: self._with_rows(column, missing) for place, column in self._columns.items()
            }

    def column(self, place: int) -> Any:
        """Return one column."""
        return self._columns[place]

    def part(self, start: int, stop: int) -> Table:
        """Return the table for some of the scenes."""
        if self.scenes == 1:
            return self
        result = copy.copy(self)
        result.valid = self._cut(self.valid, start, stop)
        result._columns = {place: self._cut(column, start, stop) for place, column in self._columns.items()}
        result.scenes = min(stop, self.scenes) - start
        return result

    def _cut(self, column: Any, start: int, stop: int) -> Any:
        return column if column.shape[1] == 1 else column[:, start:stop]

    def look(self) -> None:
        """Check once whether all facts conform to the schema: `doubt` is then free."""
        self._is_sound = self.scenes == 0 or self._looks_sound()

    def _looks_sound(self) -> bool:
        """Return whether a quick check already shows that all facts conform to the schema."""
        relation = self._relation
        for place, column in self._columns.items():
            if not self._within(column, "float" if relation.columns[place] == "float" else "int"):
                return False
        if relation.key in self._columns and self.valid.shape[0] > 1:
            keys = self._columns[relation.key]
            if not (keys[1:] > keys[:-1]).all():
                return False
        if relation.single or relation.first is not None:
            return self._always_there or bool(self.valid[0].all())
        return True

    def doubt(self, undecided: Any) -> None:
        """Mark the scenes whose facts do not conform to the schema."""
        if self._is_sound:
            return
        relation = self._relation
        for place, column in self._columns.items():
            if relation.columns[place] == "float":
                sound = abs(column) <= self._bound
            else:
                sound = (column >= -INT_BOUND) & (column <= INT_BOUND)
            undecided |= (~sound & self.valid).any(axis=0)
        if relation.first is not None or (relation.single and not self._always_there):
            undecided |= ~self.valid[0]
        if relation.key in self._columns and relation.key is not None:
            undecided |= self._repeats(self._columns[relation.key])

    @abstractmethod
    def _is_of(self, column: Any, kind: Kind) -> bool:
        """Return whether a column's numbers are of that kind, or can be converted without a relevant loss."""

    @abstractmethod
    def _converted(self, column: Any, kind: Kind) -> Any:
        """Return a column in the form that the program reads."""

    @abstractmethod
    def _all_there(self, height: int) -> Any:
        """Return the mask of that many rows, all existing."""

    @abstractmethod
    def _with_rows(self, column: Any, missing: int) -> Any:
        """Return a column with rows of zeros appended."""

    @abstractmethod
    def _within(self, column: Any, kind: Kind) -> bool:
        """Return whether a quick check already shows that a column has no NaN and no number too large."""

    @abstractmethod
    def _repeats(self, keys: Any) -> Any:
        """Return the scenes in which two existing rows have the same key."""
