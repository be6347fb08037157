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
    key, conform = (relation.name, relation.arity), _check(relation, used)

    def read(facts: Facts) -> Sequence[Row]:
        rows = facts.get(key, ())
        return rows if conform(rows) else _converted(rows, relation, conform)

    return read


def _check(relation: Relation, used: Sequence[int]) -> Callable[[Sequence[Row]], bool]:
    """Return the test whether rows conform to the schema in the columns that are used, as they are."""
    single, first, key, arity = relation.single, relation.first, relation.key, relation.arity
    floats = _values_at([place for place in used if relation.columns[place] == "float"])
    others = [(place, relation.columns[place]) for place in used if relation.columns[place] != "float"]

    def conform(rows: Sequence[Row]) -> bool:
        try:
            if not rows:
                return not single and first is None
            columns = [*zip(*rows, strict=True)]
            return (
                not (single and len(rows) > 1)
                and len(columns) == arity
                and (key is None or len({*columns[key]}) == len(rows))
                and (first is None or rows[0][key or 0] == first)
                and _are_sound([*chain.from_iterable(floats(columns))])
                and (not others or all(_is_sound(columns[place], kind) for place, kind in others))
            )
        except (TypeError, ValueError):
            return False

    return conform


def _values_at(places: Sequence[int]) -> Callable[[Sequence[Any]], Sequence[Any]]:
    """Return the function that takes the items in some places out of a sequence."""
    if len(places) == 1:
        return itemgetter(slice(places[0], places[0] + 1))
    return itemgetter(*places) if places else itemgetter(slice(0))


def _converted(
    rows: Sequence[Row], relation: Relation, conform: Callable[[Sequence[Row]], bool]
) -> Sequence[Row]:
    """Return rows with each value of its column's kind, such as floats for integers.

    Raises:
        Undecided: they do not conform to the schema all the same.
    """
    name = f"{relation.name}/{relation.arity}"
    try:
        rows = relation.conform(rows)
    except (TypeError, ValueError) as error:
        raise Undecided(str(error)) from error
    if conform(rows):
        return rows
    if relation.single and len(rows) != 1:
        raise Undecided(f"{len(rows)} rows of {name}")
    if relation.first is not None and (not rows or rows[0][relation.key or 0] != relation.first):
        raise Undecided(f"{name} does not begin with {relation.first}")
    raise Undecided(f"a row of {name} does not conform to the schema")


def _are_sound(floats: Sequence[Any]) -> bool:
    # one sum is faster than checking each, and sufficient if all are small
    return sum(map(_absolute, floats)) <= FLOAT_BOUND or all(abs(x) <= FLOAT_BOUND for x in floats)


def _is_sound(column: Sequence[Any], kind: str) -> bool:
    """Return whether a column of names or of integers is sound."""
    kinds = set(map(type, column))
    if kind == "atom":
        return kinds == {str}
    return kinds == {int} and min(column) >= -INT_BOUND and max(column) <= INT_BOUND


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
