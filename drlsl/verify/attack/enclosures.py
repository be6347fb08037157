"""Arithmetic on real numbers enclosed between two rationals; rational results are exact."""

from __future__ import annotations

import decimal
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Final

from drlsl.logic.core import Operation


@dataclass(frozen=True, slots=True)
class Enclosure:
    """A real number from `low` to `high`."""

    low: Fraction
    high: Fraction

    @property
    def exact(self) -> bool:
        """True if it is known exactly."""
        return self.low == self.high


NO_NUMBER: Final = Enclosure(Fraction(1), Fraction(0))
"""The result of an undefined operation, such as 1 / 0."""

ANY: Final = Enclosure(Fraction(-1), Fraction(-2))
"""Any number, or none."""

_HALF: Final = Fraction(1, 2)
_LARGEST_EXPONENT: Final = 2000
_LARGEST_POWER: Final = 1 << 16
"""Most bits of an exact power."""


def point(value: Fraction) -> Enclosure:
    """Return the enclosure of a known number."""
    return Enclosure(value, value)


def hull(one: Enclosure, other: Enclosure) -> Enclosure:
    """Return the enclosure of both numbers."""
    if one == other:
        return one
    if not {one, other}.isdisjoint((ANY, NO_NUMBER)):
        return ANY
    return Enclosure(min(one.low, other.low), max(one.high, other.high))


def operation(row: Operation, args: Sequence[Enclosure], bits: int) -> Enclosure:
    """Return an operation of a lowered program; irrational results are enclosed to some `bits` bits."""
    if NO_NUMBER in args:
        return NO_NUMBER
    if ANY in args:
        return ANY
    match row.kind:
        case "step" | "sign":
            return Enclosure(*(Fraction(row.compute(end)) for end in (args[0].low, args[0].high)))
        case "whole":
            return _whole(row, args)
        case "real" | "power":
            return _real(row, args, bits)
    return _ARITHMETIC[row.node](*args)


def _add(one: Enclosure, other: Enclosure) -> Enclosure:
    return Enclosure(one.low + other.low, one.high + other.high)


def _negate(one: Enclosure) -> Enclosure:
    return Enclosure(-one.high, -one.low)


def _multiply(one: Enclosure, other: Enclosure) -> Enclosure:
    corners = [a * b for a in {one.low, one.high} for b in {other.low, other.high}]
    return Enclosure(min(corners), max(corners))


def _divide(one: Enclosure, other: Enclosure) -> Enclosure:
    if other.low == other.high == 0:
        return NO_NUMBER
    if other.low <= 0 <= other.high:
        return ANY
    return _multiply(one, Enclosure(1 / other.high, 1 / other.low))


def _absolute(one: Enclosure) -> Enclosure:
    if one.low >= 0:
        return one
    return _negate(one) if one.high <= 0 else Enclosure(Fraction(0), max(-one.low, one.high))


_ARITHMETIC: Final[dict[str, Callable[..., Enclosure]]] = {
    "add": _add,
    "sub": lambda one, other: _add(one, _negate(other)),
    "mul": _multiply,
    "div": _divide,
    "neg": _negate,
    "abs": _absolute,
    "min": lambda one, other: Enclosure(min(one.low, other.low), min(one.high, other.high)),
    "max": lambda one, other: Enclosure(max(one.low, other.low), max(one.high, other.high)),
    "tofloat": lambda one: one,
}


def _whole(row: Operation, args: Sequence[Enclosure]) -> Enclosure:
    if not all(arg.exact and arg.low.denominator == 1 for arg in args):
        return ANY
    values = [arg.low.numerator for arg in args]
    if row.divides and values[-1] == 0:
        return NO_NUMBER
    return point(Fraction(row.compute(*values)))


def _sqrt(one: Enclosure, bits: int) -> Enclosure:
    if one.high < 0:
        return NO_NUMBER
    if one.low < 0:
        return ANY
    low, high = (_root(end, bits) for end in (one.low, one.high))
    return Enclosure(low[0], high[1])


def _root(square: Fraction, bits: int) -> tuple[Fraction, Fraction]:
    """Return bounds on a square root: the root itself if it is rational."""
    exact = Fraction(math.isqrt(square.numerator), math.isqrt(square.denominator))
    if exact * exact == square:
        return exact, exact
    # at least this many significant binary places, however small the root is
    shift = bits + max(0, square.denominator.bit_length() - square.numerator.bit_length()) // 2
    scaled = math.isqrt((square.numerator << (2 * shift)) // square.denominator)
    return Fraction(scaled, 1 << shift), Fraction(scaled + 1, 1 << shift)


def _real(row: Operation, args: Sequence[Enclosure], bits: int) -> Enclosure:
    if row.node == "sqrt":
        return _sqrt(args[0], bits)
    if row.node == "pow":
        return _power(args[0], args[1], bits)
    curve = row.curve
    if curve is None:
        return ANY
    (arg,) = args
    below, above = curve.domain
    if arg.high < below or arg.low > above:
        return NO_NUMBER
    if curve.excludes_ends and (arg.high <= below or arg.low >= above):
        return NO_NUMBER
    if row.node == "exp":
        return _monotone(arg, _exp, bits)
    if row.node == "log":
        return _monotone(arg, _log, bits) if arg.low > 0 else ANY
    least, most = curve.image
    if not math.isfinite(least + most) or arg.low < below or arg.high > above:
        return ANY
    return Enclosure(Fraction(least), Fraction(most))


def _monotone(
    arg: Enclosure, function: Callable[[Fraction, int], tuple[Fraction, Fraction] | None], bits: int
) -> Enclosure:
    ends = function(arg.low, bits), function(arg.high, bits)
    if ends[0] is None or ends[1] is None:
        return ANY
    return Enclosure(ends[0][0], ends[1][1])


def _context(bits: int) -> decimal.Context:
    digits = bits * 30103 // 100000 + 10
    traps = [decimal.InvalidOperation, decimal.Overflow, decimal.DivisionByZero]
    return decimal.Context(prec=digits, Emax=10**6, Emin=-(10**6), traps=traps)


def _decimal(value: Fraction, context: decimal.Context) -> tuple[decimal.Decimal, decimal.Decimal]:
    """Return a fraction rounded down and up."""
    numerator, denominator = decimal.Decimal(value.numerator), decimal.Decimal(value.denominator)
    low, high = context.copy(), context.copy()
    low.rounding, high.rounding = decimal.ROUND_FLOOR, decimal.ROUND_CEILING
    return low.divide(numerator, denominator), high.divide(numerator, denominator)


def _enclosed(
    value: Fraction, bits: int, function: Callable[[decimal.Decimal, decimal.Context], decimal.Decimal]
) -> tuple[Fraction, Fraction]:
    """Return the enclosure of a growing function with correctly rounded results: off by at most one unit."""
    context = _context(bits)
    low, high = (function(end, context) for end in _decimal(value, context))
    return Fraction(low.next_minus(context)), Fraction(high.next_plus(context))


def _exp(value: Fraction, bits: int) -> tuple[Fraction, Fraction] | None:
    if abs(value) > _LARGEST_EXPONENT:
        return None if value > 0 else (Fraction(0), Fraction(1, 2**_LARGEST_EXPONENT))
    return _enclosed(value, bits, lambda one, context: one.exp(context))


def _log(value: Fraction, bits: int) -> tuple[Fraction, Fraction]:
    return _enclosed(value, bits, lambda one, context: one.ln(context))


def _power(base: Enclosure, exponent: Enclosure, bits: int) -> Enclosure:
    if exponent.exact and exponent.low.denominator == 1:
        return _whole_power(base, exponent.low.numerator)
    if base.high < 0 and exponent.exact:
        return NO_NUMBER
    if base.low == base.high == 0 and exponent.low > 0:
        return base
    if exponent.exact and exponent.low == _HALF:
        return _sqrt(base, bits)
    if base.low <= 0:
        return ANY
    logarithm = _monotone(base, _log, bits)
    return _monotone(_multiply(exponent, logarithm), _exp, bits)


def _whole_power(base: Enclosure, exponent: int) -> Enclosure:
    size = max(end.numerator.bit_length() + end.denominator.bit_length() for end in (base.low, base.high))
    if size * abs(exponent) > _LARGEST_POWER:
        return ANY
    if exponent < 0:
        return _divide(point(Fraction(1)), _whole_power(base, -exponent))
    if exponent % 2 == 0:
        base = _absolute(base)
    return Enclosure(base.low**exponent, base.high**exponent)
