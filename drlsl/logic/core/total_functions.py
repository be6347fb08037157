"""Functions of generated code: total, and plain enough for a just-in-time compiler.

Where an operation is undefined its value has no meaning; that it is defined is a separate condition.
Integers stay within machine words.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

from drlsl.logic.errors import PrologError

WORD: Final = 2**62
"""Larger than every integer of generated code, yet within a machine word."""


def lesser(left: float, right: float) -> float:
    """Return the lesser of two numbers; of equal ones the right, as in Prolog: a zero's sign shows it."""
    return left if left < right else right


def greater(left: float, right: float) -> float:
    """Return the greater of two numbers; of equal ones the left, as in Prolog."""
    return left if left >= right else right


def quotient(left: float, right: float) -> float:
    """Return the quotient; NaN for a zero divisor."""
    return left / right if right != 0.0 else math.nan


def root(value: float) -> float:
    """Return the square root; NaN where there is none."""
    return math.sqrt(value) if value >= 0.0 else math.nan


def sign(value: float) -> float:
    """Return 1.0, -1.0, or a zero as it is."""
    return math.copysign(1.0, value) if value != 0.0 else value


def integer_sign(value: int) -> int:
    """Return 1, 0 or -1."""
    return 1 if value > 0 else -1 if value < 0 else 0


def floor(value: float) -> int:
    """Return the integer not above; 0 where it is out of bounds."""
    return math.floor(value) if -WORD <= value <= WORD else 0


def ceiling(value: float) -> int:
    """Return the integer not below; 0 where it is out of bounds."""
    return math.ceil(value) if -WORD <= value <= WORD else 0


def truncate(value: float) -> int:
    """Return the integer toward zero; 0 where it is out of bounds."""
    return int(value) if -WORD <= value <= WORD else 0


def rounded(value: float) -> int:
    """Return the nearest integer, a half upward in magnitude; 0 where it is out of bounds."""
    whole = truncate(value)
    rest = value - whole  # exact, which the distance to the floor is not
    return whole + (rest >= 0.5) - (rest <= -0.5)


def truncated(left: int, right: int) -> int:
    """Return the quotient of integers toward zero; 0 for a zero divisor."""
    if right == 0:
        return 0
    quotient = abs(left) // abs(right)
    return quotient if (left < 0) == (right < 0) else -quotient


def floor_quotient(left: int, right: int) -> int:
    """Return the quotient downward; 0 for a zero divisor. By -1 a processor cannot divide every integer."""
    if right == -1:
        return -left
    return left // right if right != 0 else 0


def floor_rest(left: int, right: int) -> int:
    """Return the rest of that division."""
    return left % right if right not in (0, -1) else 0


def as_float(name: str, function: Callable[..., float]) -> Callable[..., float]:
    """Return a function that is NaN where `function` has no value, under the name of generated code."""

    def apply(*values: float) -> float:
        try:
            return function(*values)
        except (ValueError, OverflowError, ZeroDivisionError):
            return math.nan

    apply.__name__ = f"math_{name}"
    return apply


def as_word(name: str, function: Callable[..., int]) -> Callable[..., Any]:
    """Return a function that is beyond every bound where `function` is, or where it has no value."""

    def apply(*values: int) -> int:
        try:
            return max(-WORD, min(WORD, function(*map(int, values))))
        except (ValueError, OverflowError, ZeroDivisionError, PrologError):
            return WORD

    apply.__name__ = f"math_{name}"
    return apply
