"""The functions called by loops over the rows of arrays: plain Python, also readable for a compiler.

Every function is total. A table is a line of an array (tables, rows), or an element for a single relation; a
place of -1 stands for no row.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from inspect import isfunction
from typing import Any, Final

from drlsl.logic.core import NODES
from drlsl.lowering.backends.numpy_ops import Array, Mask
from drlsl.lowering.ir import FLOAT_BOUND, INT_BOUND

NO_INTEGER: Final = 2**63 - 1
"""Beyond every valid integer."""


def fits(tables: int, index: Array, scenes: int) -> bool:
    """Return whether every scene has a table."""
    if index.size == 0:
        return tables == 1 or tables == scenes
    if index.size != scenes:
        return False
    inside = True
    for table in index:
        inside &= bool(0 <= table < tables)
    return inside


def table_of(scene: int, tables: int, index: Array) -> int:
    """Return the table of a scene."""
    if index.size > 0:
        own: int = index[scene]  # not int(...), for which Numba would compile a function
        return own
    return scene if tables > 1 else 0


def is_sound_float(value: float) -> bool:
    """Return whether a float is within bounds."""
    return abs(value) <= FLOAT_BOUND


def is_sound_integer(value: int) -> bool:
    """Return whether an integer is within bounds."""
    return (value >= -INT_BOUND) & (value <= INT_BOUND)


def keys_differ(keys: Array, valid: Mask, table: int) -> bool:
    """Return whether no two existing rows have the same key."""
    rows = keys.shape[1]
    ascending = True
    for row in range(1, rows):
        ascending &= bool(keys[table, row - 1] < keys[table, row])
    if ascending:
        return True
    for row in range(1, rows):
        if valid[table, row]:
            for other in range(row):
                if keys[table, other] == keys[table, row] and valid[table, other]:
                    return False
    return True


def place_of(key: int, keys: Array, valid: Mask, table: int) -> int:
    """Return the place of the row with that key."""
    for row in range(keys.shape[1]):
        if keys[table, row] == key and valid[table, row]:
            return row
    return -1


def blank(line: Array, scene: int, value: float) -> None:
    """Fill a scene's elements."""
    for place in range(line.shape[1]):
        line[scene, place] = value


def choose(cond: bool, then: float, els: float) -> float:
    """Return `then` if the condition holds, else `els`."""
    return then if cond else els


_HERE: Final[list[Callable[..., Any]]] = [
    *(fits, table_of, blank, choose),
    *(is_sound_float, is_sound_integer, keys_differ, place_of),
]

OPS: Final[dict[str, Callable[..., Any]]] = {
    **{function.__name__: function for function in _HERE},
    **{
        row.compute.__name__: row.compute
        for row in NODES.values()
        if isfunction(row.compute) and not row.library
    },
}
"""What is compiled as it stands, by the name that generated code knows."""

LIBRARY: Final = {row.compute.__name__: row for row in NODES.values() if row.library}
"""The operations that are called through Python, by the name that generated code knows."""

CALLED: Final[dict[str, Any]] = {
    **OPS,
    **{name: row.compute for name, row in LIBRARY.items()},
    "inf": math.inf,
    "nan": math.nan,
}
"""What the text of `ArrayLoopPrinter` knows."""
