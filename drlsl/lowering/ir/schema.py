"""The assumptions of a lowered program about its facts."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any, Final, Literal, TypeAlias

Kind: TypeAlias = Literal["atom", "int", "float"]

FLOAT_BOUND: Final = 1e15
"""A float fact beyond this, or one that is not finite, sends its scene to the interpreter.

Within the bound the back ends know at lowering time which operations cannot overflow.
"""

FLOAT32_BOUND: Final = 2.0**24
"""The same for programs in float32, which hold every integer up to it exactly."""

INT_BOUND: Final = 2**53
"""An integer beyond this sends its scene to the interpreter: floats hold every integer up to it exactly."""


@dataclass(frozen=True, slots=True)
class Relation:
    """One fact predicate.

    `columns` gives the kind of each argument. A `single` relation has exactly one row. In column `key` no two
    rows have the same value. `first` is the atom that the key of the first row always has; it needs `key`.
    `capacity` is the largest expected number of rows; more rows are slower, never wrong. `fields` names the
    columns in generated code.
    """

    name: str
    columns: tuple[Kind, ...]
    single: bool = False
    key: int | None = None
    first: str | None = None
    capacity: int = 64
    fields: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.key is not None and not 0 <= self.key < len(self.columns):
            raise ValueError(f"{self.name}: key {self.key} is not a column from 0 to {len(self.columns) - 1}")
        if self.first is not None and (self.key is None or self.columns[self.key] != "atom"):
            raise ValueError(f"{self.name}: first={self.first!r} needs a key column of atoms")
        if self.fields and len(self.fields) != len(self.columns):
            raise ValueError(f"{self.name}: {len(self.fields)} fields for {len(self.columns)} columns")
        if self.single and self.first is not None:
            raise ValueError(f"{self.name}: a single relation has no need of first")

    @property
    def arity(self) -> int:
        """The number of columns."""
        return len(self.columns)

    def conform(self, rows: Iterable[Sequence[Any]]) -> list[tuple[str | int | float, ...]]:
        """Return the rows with each value of its column's kind, as every tier reads them.

        An integer in a column of floats becomes that float, and NumPy's numbers become Python's. NaN is kept,
        for the tier that reads it to refuse.

        Raises:
            TypeError: A value is of another kind: a float among integers, a bool, None.
            ValueError: A row has another length, or a number is too large for a float.
        """
        exact = tuple(map(_TYPES.__getitem__, self.columns))
        return [
            row if isinstance(row, tuple) and tuple(map(type, row)) == exact else self._conform_row(row)
            for row in rows
        ]

    def _conform_row(self, row: Sequence[Any]) -> tuple[str | int | float, ...]:
        if len(row) != self.arity:
            raise ValueError(f"a row of {self.name}/{self.arity} has {len(row)} values")
        values: list[str | int | float] = []
        for place, (kind, value) in enumerate(zip(self.columns, row, strict=True)):
            try:
                values.append(_CONFORM[kind](value))
            except (TypeError, OverflowError) as error:
                name = self.fields[place] if self.fields else f"column {place}"
                what = f"{name} of {self.name}/{self.arity}"
                if isinstance(error, OverflowError):
                    raise ValueError(f"{what} is an integer too large for a float") from error
                raise TypeError(f"{what} is {value!r:.80}; expected {_EXPECTED[kind]}") from error
        return tuple(values)


def _atom(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError
    return str(value)


def _integer(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise TypeError
    return int(value)


def _float(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, Real):
        raise TypeError
    return float(value)


_CONFORM: Final[dict[Kind, Callable[[Any], str | int | float]]] = {
    "atom": _atom,
    "int": _integer,
    "float": _float,
}
_TYPES: Final[dict[Kind, type]] = {"atom": str, "int": int, "float": float}
_EXPECTED: Final = {"atom": "a name", "int": "an integer", "float": "a number"}


class Schema:
    """The fact relations of a program by name and arity."""

    def __init__(self, relations: Iterable[Relation]) -> None:
        self.relations: Final = {(relation.name, relation.arity): relation for relation in relations}

    def find(self, name: str, arity: int) -> Relation | None:
        """Return the relation of that name and arity, if the schema declares it."""
        return self.relations.get((name, arity))
