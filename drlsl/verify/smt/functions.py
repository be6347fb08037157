"""The domains of the C library's functions, and bounds on their values, for proofs."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Final

from drlsl.verify.smt.polynomials import Interval, Rational

_SLACK: Final = Fraction(1, 10**9)
"""Share of its magnitude by which a computed bound is widened: the C library is far more exact."""

_LARGEST_EXPONENT: Final = 709.78
"""Below this, exp/1 does not overflow."""

_DOMAINS: Final[dict[str, Interval]] = {
    "acos": (Fraction(-1), Fraction(1)),
    "asin": (Fraction(-1), Fraction(1)),
    "acosh": (Fraction(1), None),
    "atanh": (Fraction(math.nextafter(-1.0, 0.0)), Fraction(math.nextafter(1.0, 0.0))),
    "exp": (None, Fraction(str(_LARGEST_EXPONENT))),
    "sinh": (Fraction("-710.47"), Fraction("710.47")),
    "cosh": (Fraction("-710.47"), Fraction("710.47")),
    "log": (None, None),
    "tan": (None, None),
    "asinh": (None, None),
    "sin": (None, None),
    "cos": (None, None),
    "atan": (None, None),
    "tanh": (None, None),
}
"""The arguments for which a function has a value that is a float, rounded inward where it overflows.

The domain of `log`, the positive numbers, is checked separately; none of its values is large.
"""

_BOUNDED: Final[dict[str, Interval]] = {
    "sin": (Fraction(-1), Fraction(1)),
    "cos": (Fraction(-1), Fraction(1)),
    "tanh": (Fraction(-1), Fraction(1)),
    "atan": (Fraction(-8, 5), Fraction(8, 5)),
    "asin": (Fraction(-8, 5), Fraction(8, 5)),
    "acos": (Fraction(0), Fraction(16, 5)),
    "acosh": (Fraction(0), Fraction(711)),
    "asinh": (Fraction(-711), Fraction(711)),
    "exp": (Fraction(0), None),
    "cosh": (Fraction(99, 100), None),
    "log": (Fraction(-746), Fraction(710)),
}
"""Bounds on the values, over all floats."""

_RISING: Final[dict[str, Callable[[float], float]]] = {
    "exp": math.exp,
    "log": math.log,
    "sinh": math.sinh,
    "asinh": math.asinh,
    "atan": math.atan,
    "tanh": math.tanh,
}


def domain_of(function: str, exponent: Fraction | None = None) -> Interval | None:
    """Return the interval of arguments for which a function has a float value; None without bounds.

    Of ``pow``, by its exponent, the bases: positive ones, or any if the exponent is a whole number.
    """
    if function != "pow":
        return _DOMAINS[function]
    if exponent is None or not exponent:
        return None if exponent is None else (None, None)
    magnitude = _LARGEST_EXPONENT / float(abs(exponent))
    if magnitude > _LARGEST_EXPONENT:
        return (None, None)
    reach = Fraction(math.exp(magnitude)) * (1 - _SLACK)
    return (-reach, reach) if exponent > 0 else (1 / reach, None)


def bounds_of(function: str, argument: Interval, exponent: Fraction | None = None) -> Interval:
    """Return bounds on a function's values, given bounds on its argument, or on its base."""
    if function == "pow":
        return _power(argument, exponent)
    least, most = _BOUNDED.get(function, (None, None))
    if function in _RISING:
        low, high = (_at(_RISING[function], bound) for bound in argument)
        least = _widened(low, -1, least, max)
        most = _widened(high, 1, most, min)
    return (least, most)


def _power(base: Interval, exponent: Fraction | None) -> Interval:
    """Return bounds on a power with a constant exponent; any other is unbounded."""
    low, high = base
    if exponent is None or low is None or low < 0:
        return (None, None)
    ends = [_at(lambda value: value ** float(exponent), bound) for bound in (low, high)]
    if exponent < 0:
        ends.reverse()
    least, most = _widened(ends[0], -1, Fraction(0), max), _widened(ends[1], 1, None, min)
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
    bound = Fraction(value) + sign * _SLACK * (1 + abs(Fraction(value)))
    return bound if known is None else pick(bound, known)
