"""The functions called by loops over the rows of arrays: plain Python, also readable for a compiler.

Every function is total. A table is a line of an array (tables, rows), or an element for a single relation; a
place of -1 stands for no row.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from drlsl.lowering.backends.numpy_ops import Array, Mask
from drlsl.lowering.ir import FLOAT_BOUND, FUNCTIONS, INT_BOUND, sign, truncated

NO_INTEGER: Final = 2**63 - 1
"""Beyond every valid integer."""


# ---------------------------------------------------------------- facts


def filled(valid: Mask, column: Array) -> Mask:
    """Return `valid` or, if it is empty, the mask of all rows."""
    return np.ones(column.shape, dtype=np.bool_) if valid.size == 0 else valid


def alike(one: Array, other: Array) -> bool:
    """Return whether two arrays have equally many tables and rows."""
    return bool((one.shape[0] == other.shape[0]) & (one.shape[1] == other.shape[1]))


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
        return int(index[scene])
    return scene if tables > 1 else 0


def is_sound_float(value: float) -> bool:
    """Return whether a float is within bounds."""
    return abs(value) <= FLOAT_BOUND


def is_sound_integer(value: int) -> bool:
    """Return whether an integer is within bounds."""
    return (value >= -INT_BOUND) & (value <= INT_BOUND)


def floats_are_sound(column: Array, valid: Mask, table: int) -> bool:
    """Return whether the floats of the existing rows are within bounds."""
    sound = True
    for row in range(column.shape[1]):
        sound &= is_sound_float(column[table, row]) | (not valid[table, row])
    return sound


def integers_are_sound(column: Array, valid: Mask, table: int) -> bool:
    """Return whether the integers of the existing rows are within bounds."""
    sound = True
    for row in range(column.shape[1]):
        sound &= is_sound_integer(column[table, row]) | (not valid[table, row])
    return sound


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


def places(rows: int) -> Array:
    """Return an array for the places of `rows` rows."""
    return np.empty(rows, dtype=np.int64)


def blank(line: Array, scene: int, value: float) -> None:
    """Fill a scene's elements."""
    for place in range(line.shape[1]):
        line[scene, place] = value


# ---------------------------------------------------------------- numbers


def choose(cond: bool, then: float, els: float) -> float:
    """Return `then` if the condition holds, else `els`."""
    return then if cond else els


def lesser(left: float, right: float) -> float:
    """Return the lesser number; of equal ones the right, as in Prolog (visible in the sign of a zero)."""
    return left if left < right else right


def greater(left: float, right: float) -> float:
    """Return the greater of two numbers; of equal ones the left, as in Prolog."""
    return left if left >= right else right


def quotient(left: float, right: float) -> float:
    """Return the quotient; NaN for a zero divisor."""
    return left / right if right != 0.0 else math.nan


def root(value: float) -> float:
    """Return the square root; NaN if it is undefined."""
    return math.sqrt(value) if value >= 0.0 else math.nan


def floor(value: float) -> int:
    """Return the integer not above; 0 if it is out of bounds."""
    return math.floor(value) if -INT_BOUND <= value <= INT_BOUND else 0


def ceiling(value: float) -> int:
    """Return the integer not below; 0 if it is out of bounds."""
    return math.ceil(value) if -INT_BOUND <= value <= INT_BOUND else 0


def truncate(value: float) -> int:
    """Return the integer toward zero; 0 if it is out of bounds."""
    return int(value) if -INT_BOUND <= value <= INT_BOUND else 0


def nearest(value: float) -> int:
    """Return the nearest integer, a half upward in magnitude; 0 if it is out of bounds."""
    whole = floor(value)
    rest = value - whole
    return whole + 1 if rest > 0.5 or (rest == 0.5 and value > 0.0) else whole


def floor_quotient(left: int, right: int) -> int:
    """Return integer division downward; 0 for a zero divisor. Division by -1 may overflow the processor's."""
    if right == -1:
        return -left
    return left // right if right != 0 else 0


def floor_rest(left: int, right: int) -> int:
    """Return the remainder of that division."""
    return left % right if right not in (0, -1) else 0


def integer_sign(value: int) -> int:
    """Return 1, 0 or -1."""
    return 1 if value > 0 else -1 if value < 0 else 0


OPS: Final[dict[str, Callable[..., Any]]] = {
    function.__name__: function
    for function in (
        *(filled, alike, fits, table_of, places, blank),
        *(is_sound_float, is_sound_integer, floats_are_sound, integers_are_sound, keys_differ, place_of),
        *(choose, lesser, greater, quotient, root, floor, ceiling, truncate, nearest),
        *(floor_quotient, floor_rest, integer_sign, sign, truncated),
    )
}
"""Operations by their name in generated code."""

MATH: Final[dict[str, Callable[..., float]]] = {
    f"math_{name}": function for name, function in FUNCTIONS.items()
}
"""Functions of the C library, by their name in generated code."""

CALLED: Final[dict[str, Any]] = {**OPS, **MATH, "inf": math.inf, "nan": math.nan}
"""The names that the text of `ArrayLoopPrinter` uses."""
