"""Facts drawn by the thousand within their bounds, as arrays, and changed in small steps."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Final, TypeAlias

import numpy as np

from drlsl.lowering.backends import Rows
from drlsl.traffic import Mask
from drlsl.verify.told.declared import Column, Declared, Key, Table

Place: TypeAlias = tuple[Key, int]

_SPECIAL: Final = 0.3
"""The share of numbers that are an end of their range, 0, or the value of another number."""


@dataclass(slots=True)
class Sets:
    """N sets of facts: by relation and column an array of shape (N, rows), and which rows exist.

    Names and integers are given by their index in the column's values, keys by the number of their row.
    """

    columns: dict[Place, Any]
    there: dict[Key, Mask]

    def __len__(self) -> int:
        return len(next(iter(self.there.values())))

    def put(self, index: Any, other: Sets) -> None:
        """Replace some of the sets by those of the same place in another."""
        for place, column in self.columns.items():
            column[index] = other.columns[place][index]
        for key, there in self.there.items():
            there[index] = other.there[key][index]

    def copy(self) -> Sets:
        """Return a copy."""
        return Sets(
            {place: column.copy() for place, column in self.columns.items()},
            {key: there.copy() for key, there in self.there.items()},
        )


class Drawer:
    """Draws and changes sets of facts with up to so many rows of each open relation."""

    def __init__(self, declared: Declared, rows: Mapping[Key, int], code: Callable[[str], int]) -> None:
        self._tables = declared.tables
        self._rows = {table.key: rows.get(table.key, 0) if table.is_open else 1 for table in declared.tables}
        self._named = {table.relation.name: self._rows[table.key] for table in declared.tables}
        self._code = code

    def draw(self, rng: np.random.Generator, count: int) -> Sets:
        """Draw sets: any number of rows, any names, numbers anywhere, at the ends and equal to others."""
        sets = Sets({}, {})
        for table in self._tables:
            most = self._rows[table.key]
            least = rng.integers(0, most + 1, size=(count, 1)) if table.is_open else np.full((count, 1), most)
            sets.there[table.key] = np.arange(most) < least
            for place, column in enumerate(table.columns):
                sets.columns[table.key, place] = self._drawn(rng, column, (count, most))
        return sets

    def _drawn(self, rng: np.random.Generator, column: Column, shape: tuple[int, int]) -> Any:
        if column.kind == "key":
            return np.broadcast_to(np.arange(1, shape[1] + 1), shape).copy()
        if column.kind == "key_of":
            return rng.integers(0, self._named[column.of] + 1, size=shape)
        if column.kind != "number":
            return rng.integers(0, len(column.values), size=shape)
        low, high = map(float, column.bounds)
        # small numbers as often as large ones
        scale = 10.0 ** -rng.choice([0.0, 0.5, 1.0, 2.0], size=shape)
        values = np.clip(low + (high - low) * rng.random(shape), low, high)
        values = np.clip(np.where(rng.random(shape) < 0.5, values, values * scale), low, high)
        special = np.array([low, high, min(max(0.0, low), high)])[rng.integers(0, 3, size=shape)]
        return np.where(rng.random(shape) < _SPECIAL / 2, special, values)

    def changed(self, rng: np.random.Generator, sets: Sets) -> Sets:
        """Change every set slightly: one or a few numbers or names of it, or the number of its rows."""
        fresh, result = self.draw(rng, len(sets)), sets.copy()
        every = sum(array.shape[1] for array in result.columns.values())
        often = rng.choice([1.0, 2.0, 4.0], size=(len(sets), 1)) / max(1, every)
        for table in self._tables:
            for place, column in enumerate(table.columns):
                values = result.columns[table.key, place]
                chosen = rng.random(values.shape) < often
                if column.kind == "number":
                    low, high = map(float, column.bounds)
                    reach = (high - low) * 10.0 ** -rng.uniform(0.0, 7.0, size=values.shape)
                    moved = np.clip(values + reach * rng.uniform(-1.0, 1.0, size=values.shape), low, high)
                    drawn = fresh.columns[table.key, place]
                    values[...] = np.where(
                        chosen, np.where(rng.random(values.shape) < 0.8, moved, drawn), values
                    )
                elif column.kind != "key":
                    values[...] = np.where(chosen, fresh.columns[table.key, place], values)
            if table.is_open:
                again = rng.random(len(sets)) < 0.05
                result.there[table.key][again] = fresh.there[table.key][again]
        return result

    def arrays(self, sets: Sets) -> dict[Key, Rows]:
        """Return the facts as the array tier reads them."""
        found: dict[Key, Rows] = {}
        for table in self._tables:
            columns = [
                self._coded(column, sets.columns[table.key, place])
                for place, column in enumerate(table.columns)
            ]
            if table.relation.single:
                found[table.key] = Rows([column[:, 0] for column in columns])
            else:
                found[table.key] = Rows(columns, sets.there[table.key])
        return found

    def _coded(self, column: Column, values: Any) -> Any:
        if column.kind == "one_of":
            return np.array([self._code(str(one)) for one in column.values], dtype=np.int64)[values]
        if column.kind == "integer":
            return np.array(column.values, dtype=np.int64)[values]
        return values

    def facts(self, sets: Sets, number: int) -> dict[Key, list[tuple[Any, ...]]]:
        """Return one of the sets as rows of names, integers and floats."""
        return {
            table.key: [
                tuple(
                    self._plain(column, sets.columns[table.key, place][number, row])
                    for place, column in enumerate(table.columns)
                )
                for row in np.flatnonzero(sets.there[table.key][number])
            ]
            for table in self._tables
        }

    def _plain(self, column: Column, value: Any) -> Any:
        if column.kind in ("one_of", "integer"):
            return column.values[int(value)]
        return float(value) if column.kind == "number" else int(value)


def floats_of(
    facts: Mapping[Key, list[tuple[Any, ...]]], table: Table, digits: int | None
) -> list[tuple[Any, ...]]:
    """Return the rows of a relation with its numbers as floats, rounded and within their bounds."""

    def number(value: Fraction, column: Column) -> float:
        low, high = map(float, column.bounds)
        short = float(value) if digits is None else round(float(value), digits)
        return min(high, max(low, short))

    return [
        tuple(
            number(value, column) if column.kind == "number" else value
            for value, column in zip(row, table.columns, strict=True)
        )
        for row in facts[table.key]
    ]
