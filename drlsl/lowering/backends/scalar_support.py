"""The functions that generated code for one scene calls."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import chain
from operator import itemgetter
from typing import Any, Final, TypeAlias

from drlsl.logic import Compound, String
from drlsl.logic.core import NODES
from drlsl.lowering.ir import FLOAT_BOUND, INT_BOUND, Relation, Undecided

Row: TypeAlias = Sequence[Any]
Facts: TypeAlias = Mapping[tuple[str, int], Sequence[Row]]

_absolute: Final = float.__abs__  # refuses everything but floats


def row_reader(relation: Relation, used: Sequence[int]) -> Callable[[Facts], Sequence[Row]]:
    """Return the function that gives the rows of a relation, if their used columns conform to the schema.

    It raises `Undecided` if they do not.
    """
    key, conform = (relation.name, relation.arity), _quick_check(relation, used)

    def read(facts: Facts) -> Sequence[Row]:
        rows = facts.get(key, ())
        return rows if conform(rows) else _checked_rows(rows, relation, used)

    return read


def _quick_check(relation: Relation, used: Sequence[int]) -> Callable[[Sequence[Row]], bool]:
    """Return a test of rows: nearly all that conform to the schema pass, and none that do not."""
    single, first, key, lengths = relation.single, relation.first, relation.key, {relation.arity}
    floats = _values_at([place for place in used if relation.columns[place] == "float"])
    others = [
        (itemgetter(place), relation.columns[place]) for place in used if relation.columns[place] != "float"
    ]

    def conform(rows: Sequence[Row]) -> bool:
        try:
            if not rows:
                return not single and first is None
            return (
                not (single and len(rows) > 1)
                and set(map(len, rows)) == lengths
                and (key is None or len({row[key] for row in rows}) == len(rows))
                and (first is None or rows[0][key or 0] == first)
                and sum(map(_absolute, chain.from_iterable(map(floats, rows)))) <= FLOAT_BOUND
                and (not others or all(_is_sound([*map(value, rows)], kind) for value, kind in others))
            )
        except (TypeError, ValueError):
            return False

    return conform


def _values_at(places: Sequence[int]) -> Callable[[Row], Sequence[Any]]:
    """Return the function that takes the values of some columns out of a row."""
    if len(places) == 1:
        return itemgetter(slice(places[0], places[0] + 1))
    return itemgetter(*places) if places else itemgetter(slice(0))


def _checked_rows(rows: Sequence[Row], relation: Relation, used: Sequence[int]) -> Sequence[Row]:
    try:
        return _checked(rows, relation, used)
    except TypeError:  # an integer in a column of floats, or an impossible value
        try:
            return _checked(relation.conform(rows), relation, used)
        except (TypeError, ValueError) as error:
            raise Undecided(str(error)) from error


def _checked(rows: Sequence[Row], relation: Relation, used: Sequence[int]) -> Sequence[Row]:
    if relation.single and len(rows) != 1:
        raise Undecided(f"{len(rows)} rows of {relation.name}/{relation.arity}")
    if relation.first is not None and (not rows or rows[0][relation.key or 0] != relation.first):
        raise Undecided(f"{relation.name}/{relation.arity} does not begin with {relation.first}")
    try:
        columns = list(zip(*rows, strict=True))
        if rows and len(columns) != relation.arity:
            raise Undecided(f"a row of {relation.name}/{relation.arity} has {len(columns)} values")
        unique = relation.key is None or len(rows) < 2 or len(set(columns[relation.key])) == len(rows)
        if not rows or (unique and all(_is_sound(columns[place], relation.columns[place]) for place in used)):
            return rows
    except ValueError as error:
        raise Undecided(f"{relation.name}/{relation.arity}: {error}") from error
    raise Undecided(f"a row of {relation.name}/{relation.arity} does not conform to the schema")


def _is_sound(column: Sequence[Any], kind: str) -> bool:
    if kind == "float":
        # one sum is faster than checking each, and sufficient if all are small
        return sum(map(_absolute, column)) <= FLOAT_BOUND or all(abs(x) <= FLOAT_BOUND for x in column)
    if kind == "atom":
        return set(map(type, column)) == {str}
    if set(map(type, column)) != {int}:
        raise TypeError
    return bool(min(column) >= -INT_BOUND and max(column) <= INT_BOUND)


def blank_row(relation: Relation) -> Row:
    """Return a row that stands for none: its values are undefined but of the right kind."""
    return tuple({"atom": "", "int": 0, "float": 0.0}[kind] for kind in relation.columns)


SUPPORT: Final[dict[str, Any]] = {
    "Compound": Compound,
    "String": String,
    "Undecided": Undecided,
    "inf": math.inf,
    "nan": math.nan,
    "sqrt": math.sqrt,
    **{row.compute.__name__: row.compute for row in NODES.values()},
}
