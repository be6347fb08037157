"""The functions that generated code for one scene calls."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final, TypeAlias

from drlsl.logic import Compound, String
from drlsl.logic.core import NODES
from drlsl.lowering.ir import FLOAT_BOUND, INT_BOUND, Relation, Undecided

Row: TypeAlias = Sequence[Any]
Facts: TypeAlias = Mapping[tuple[str, int], Sequence[Row]]

_absolute: Final = float.__abs__  # refuses everything but floats


def checked_rows(facts: Facts, relation: Relation, used: Sequence[int]) -> Sequence[Row]:
    """Return the rows of a relation, if their used columns conform to the schema.

    Raises:
        Undecided: they do not.
    """
    rows = facts.get((relation.name, relation.arity), ())
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
    "checked_rows": checked_rows,
    "inf": math.inf,
    "nan": math.nan,
    "sqrt": math.sqrt,
    **{row.compute.__name__: row.compute for row in NODES.values()},
}
