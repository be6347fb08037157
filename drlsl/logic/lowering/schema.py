"""What a lowered program may assume about its facts."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

Kind: TypeAlias = Literal["atom", "int", "float"]

FLOAT_BOUND: Final = 1e15
"""A float fact beyond this, or one that is not finite, sends its scene to the interpreter.

Within the bound the back ends can tell at lowering time which operations cannot overflow.
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
    `capacity` is the number of rows that are expected at most; more rows are slower, never wrong. `fields`
    names the columns in generated code.
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
            raise ValueError(f"{self.name}: key {self.key} is no column of 0 to {len(self.columns) - 1}")
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


class Schema:
    """The fact relations of a program by name and arity."""

    def __init__(self, relations: Iterable[Relation]) -> None:
        self.relations: Final = {(relation.name, relation.arity): relation for relation in relations}

    def find(self, name: str, arity: int) -> Relation | None:
        """The relation of that name and arity, if the schema declares it."""
        return self.relations.get((name, arity))
