"""The domains of the C library's functions, and bounds on their values, for proofs."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from typing import Final

from gmpy2 import mpq

from drlsl.logic.core import Operation
from drlsl.verify.smt.polynomials import Interval, Rational

_SLACK: Final = mpq(1, 10**9)
"""Share of its magnitude by which a computed bound is widened: the C library is far more exact."""

_LARGEST_EXPONENT: Final = 709.78
"""Below this, exp/1 does not overflow."""

_LARGEST: Final = sys.float_info.max


def domain_of(row: Operation, exponent: mpq | None = None) -> Interval | None:
    """Return the interval of arguments for which a function has a float value; None without bounds.

    Of ``pow``, by its exponent, the bases: positive ones, or any if the exponent is a whole number. What
    a row needs is said beside it.
    """
    if row.kind != "power":
        return None if row.curve is None else _bounds((None, None) if row.needs else row.curve.arguments)
    if exponent is None or not exponent:
        return None if exponent is None else (None, None)
    magnitude = _LARGEST_EXPONENT / float(abs(exponent))
    if magnitude > _LARGEST_EXPONENT:
        return (None, None)
    reach = mpq(math.exp(magnitude)) * (1 - _SLACK)
    return (-reach, reach) if exponent > 0 else (1 / reach, None)


def bounds_of(row: Operation, argument: Interval, exponent: mpq | None = None) -> Interval:
    """Return bounds on a function's values, given bounds on its argument, or on its base."""
    if row.kind == "power":
        return _power(argument, exponent)
    if row.curve is None:
        return (None, None)
    least, most = _bounds(row.curve.image)
    ends = (max(row.curve.arguments[0], -_LARGEST), min(row.curve.arguments[1], _LARGEST))
    try:
        low, high = row.extent(
            *(_inside(ends, end, bound) for end, bound in zip(ends, argument, strict=True))
        )
    except (ValueError, OverflowError):  # no float is that large
        return (least, most)
    return (_widened(low, -1, least, max), _widened(high, 1, most, min))


def _inside(ends: tuple[float, float], end: float, bound: Rational | None) -> float:
    """Return a bound on an argument as a float, rounded outward but not beyond the ends."""
    return end if bound is None else min(ends[1], max(ends[0], math.nextafter(float(bound), end)))


def _bounds(ends: tuple[float | None, float | None]) -> Interval:
    """Return an interval of floats, with None for infinite ends."""
    low, high = (None if end is None or math.isinf(end) else mpq(end) for end in ends)
    return low, high


def _power(base: Interval, exponent: mpq | None) -> Interval:
    """Return bounds on a power with a constant exponent; any other is unbounded."""
    low, high = base
    if exponent is None or low is None or low < 0:
        return (None, None)
    ends = [_at(lambda value: value ** float(exponent), bound) for bound in (low, high)]
    if exponent < 0:
        ends.reverse()
    least, most = _widened(ends[0], -1, mpq(0), max), _widened(ends[1], 1, None, min)
    return (least, most)


def _at(function: Callable[[float], float], argument: Rational | None) -> float | None:
    """Return the value of a function, if it has one."""
    if argument is None:
        return None
    try:
        value = function(float(argument))
    except (ArithmeticError, ValueError):
        return None
    return value if math.isfinite(value) else None


def _widened(
    value: float | None,
    sign: int,
    known: Rational | None,
    pick: Callable[[Rational, Rational], Rational],
) -> Rational | None:
    """Return a computed bound, widened, or the known one if that is tighter."""
    if value is None:
        return known
    bound = mpq(value) + sign * _SLACK * (1 + abs(mpq(value)))
    return bound if known is None else pick(bound, known)
