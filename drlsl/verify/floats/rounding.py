"""The distance of doubles from the real numbers of a proof, operation by operation.

An `Approximation` bounds a real value and the error of its double. Every operation adds half a unit in the
last place of its own result to the errors of its operands: IEEE 754 binary64, rounded to nearest, no
operations fused. All bounds here are themselves rounded outward.

Source: Higham, Accuracy and Stability of Numerical Algorithms (2002), 2 and 3; IEEE 754-2019, 4.3.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Final

from drlsl.logic.core import Operation
from drlsl.verify.ranges import decimal

_OUTWARD: Final = 1 + 2.0**-48
"""Share of an error bound that its own computation may lose at most."""

_TINY: Final = math.ulp(0.0)
"""The least double above 0: the most that underflow can lose."""

_FUNCTION_ULPS: Final = 4
"""Bound on the error of the C library's functions, in units in the last place.

Source: Gladman et al., Accuracy of Mathematical Functions in Single, Double, ... Precision (2024): below 1
for those of glibc, below 3 for those of other libraries in use.
"""

_LARGEST: Final = 1e300
"""Magnitude beyond which a double may overflow, and no error is bounded."""


@dataclass(frozen=True, slots=True)
class Approximation:
    """A real number from `low` to `high`, and a double for it with an error of at most `error`.

    `unit`: the double is exactly -1, 0 or 1, and a product with it does not round.
    """

    low: float
    high: float
    error: float = 0.0
    unit: bool = False

    @property
    def magnitude(self) -> float:
        """The greatest absolute value of the real number."""
        return max(abs(self.low), abs(self.high))

    @property
    def least(self) -> float:
        """The least absolute value of the real number."""
        return 0.0 if self.low <= 0.0 <= self.high else min(abs(self.low), abs(self.high))

    @property
    def is_exact(self) -> bool:
        """True if the double is the number."""
        return self.error == 0.0

    def within(self, low: float, high: float) -> Approximation:
        """Return the same number, known to be also in another interval that meets this one."""
        if low <= self.low and high >= self.high:
            return self
        return Approximation(max(low, self.low), min(high, self.high), self.error, self.unit)


ANY: Final = Approximation(-math.inf, math.inf, math.inf)
"""Nothing is known."""


def down(value: float) -> float:
    """Return the double below: at most the exact result that was rounded to `value`."""
    return math.nextafter(value, -math.inf)


def up(value: float) -> float:
    """Return the double above."""
    return math.nextafter(value, math.inf)


def wider(error: float) -> float:
    """Return an error bound, enlarged by the error of its own computation."""
    return error * _OUTWARD + _TINY if error else 0.0


def outward(number: Fraction) -> tuple[float, float]:
    """Return doubles that enclose a rational number: twice the number if it is a double."""
    near = float(number)
    exact = Fraction(near)
    return (near if exact <= number else down(near), near if exact >= number else up(near))


def between(low: Fraction, high: Fraction) -> Approximation:
    """Return the approximation of a fact: an exact double in this range, or the one nearest to an end."""
    off = max(abs(Fraction(float(end)) - end) for end in (low, high))
    return Approximation(outward(low)[0], outward(high)[1], outward(off)[1])


@functools.cache
def constant(value: float) -> Approximation:
    """Return the approximation of a double that stands for the decimal fraction that it prints as."""
    exact = decimal(value)
    try:
        double = float(value)
    except OverflowError:
        return ANY
    off = outward(abs(Fraction(double) - exact))[1]
    return Approximation(*outward(exact), off, unit=value in (-1, 0, 1))


def half_ulp(magnitude: float) -> float:
    """Return the largest change of a result of at most this magnitude by rounding to nearest."""
    return math.ulp(magnitude) / 2 if magnitude <= _LARGEST else math.inf


def _rounded(low: float, high: float, error: float, *, underflows: bool = False) -> Approximation:
    """Return a rounded result in an interval, with the error of its operands."""
    magnitude = max(abs(low), abs(high)) + error
    if not magnitude <= _LARGEST:
        return Approximation(low, high, math.inf)
    return Approximation(low, high, wider(error + half_ulp(magnitude) + (_TINY if underflows else 0.0)))


def negate(one: Approximation) -> Approximation:
    """Return -x."""
    return Approximation(-one.high, -one.low, one.error, one.unit)


def absolute(one: Approximation) -> Approximation:
    """Return the absolute value."""
    return Approximation(one.least, one.magnitude, one.error, one.unit)


def either(one: Approximation, other: Approximation) -> Approximation:
    """Return one of two numbers, the same one in reals and in doubles."""
    return Approximation(
        min(one.low, other.low),
        max(one.high, other.high),
        max(one.error, other.error),
        one.unit and other.unit,
    )


def least_of(one: Approximation, other: Approximation) -> Approximation:
    """Return the minimum: its error is at most the larger one of the two."""
    joint = either(one, other)
    return Approximation(joint.low, min(one.high, other.high), joint.error, joint.unit)


def greatest_of(one: Approximation, other: Approximation) -> Approximation:
    """Return the maximum."""
    return negate(least_of(negate(one), negate(other)))


def add(one: Approximation, other: Approximation) -> Approximation:
    """Return the sum."""
    low, high = one.low + other.low, one.high + other.high
    if math.isnan(low) or math.isnan(high):
        return ANY
    return _rounded(down(low), up(high), one.error + other.error)


def multiply(one: Approximation, other: Approximation, *, square: bool = False) -> Approximation:
    """Return the product; `square` says that both are the same number."""
    low, high = product(one.low, one.high, other.low, other.high)
    if square:
        low = max(low, 0.0)
    if math.isinf(one.error) or math.isinf(other.error):
        return Approximation(low, high, math.inf)  # a double may be infinite, and 0 times that is NaN
    error = _times(one.magnitude, other.error) + _times(other.magnitude, one.error)
    error += _times(one.error, other.error)
    if one.unit or other.unit:
        return Approximation(low, high, wider(error), one.unit and other.unit)
    return _rounded(low, high, error, underflows=True)


def divide(
    one: Approximation, other: Approximation, bounds: tuple[float, float], nearest: float = 0.0
) -> Approximation:
    """Return the quotient, known to be within bounds; the divisor is at least `nearest` away from 0."""
    low, high = bounds
    smallest = down(max(nearest, other.least) - other.error)
    if not smallest > 0.0:
        return ANY.within(low, high)
    most = up(up(one.magnitude / smallest))
    low, high = max(low, -most), min(high, most)
    error = (one.error + _times(max(abs(low), abs(high)), other.error)) / smallest
    return _rounded(low, high, error, underflows=True)


def square_root(one: Approximation, bounds: tuple[float, float]) -> Approximation:
    """Return the square root, known to be within bounds; its argument as a double is not negative."""
    low, high = bounds
    error = math.sqrt(one.error)
    steady = low + math.sqrt(max(0.0, down(one.low - one.error)))
    if steady > 0.0:
        error = min(error, one.error / steady)
    return _rounded(low, high, error)


def root_range(one: Approximation) -> tuple[float, float]:
    """Return the interval of the square root."""
    low = max(0.0, down(math.sqrt(max(0.0, one.low))))
    return low, up(math.sqrt(max(0.0, one.high)))


def to_float(one: Approximation) -> Approximation:
    """Return an integer as a double."""
    if one.magnitude <= 2.0**53:
        return one
    return _rounded(one.low, one.high, one.error)


def total(start: Approximation, addend: Approximation, most: int, *, whole: bool) -> Approximation:
    """Return `start` plus at most `most` numbers, added one after another; `whole` ones without rounding."""
    low = start.low + most * min(0.0, addend.low)
    high = start.high + most * max(0.0, addend.high)
    if not max(abs(low), abs(high)) <= _LARGEST:
        return ANY
    low, high = (low, high) if whole else (low - abs(low) * 2.0**-40, high + abs(high) * 2.0**-40)
    error = start.error + most * addend.error
    if not whole:
        reach = start.magnitude + most * addend.magnitude + error
        error += most * half_ulp(2 * reach)
    return Approximation(low, high, wider(error))


def product(low: float, high: float, other_low: float, other_high: float) -> tuple[float, float]:
    """Return the interval of a product."""
    corners = [_times(a, b) for a in (low, high) for b in (other_low, other_high)]
    least, most = min(corners), max(corners)
    exact = all(abs(a) in (0.0, 1.0) for a in (low, high)) or all(
        abs(b) in (0.0, 1.0) for b in (other_low, other_high)
    )
    return (least, most) if exact else (down(least), up(most))


def quotient(low: float, high: float, other_low: float, other_high: float) -> tuple[float, float]:
    """Return the interval of a quotient by numbers that are not 0, but may be arbitrarily close."""
    if other_low < 0.0 < other_high or (other_low == 0.0 == other_high):
        return (-math.inf, math.inf)
    if other_high <= 0.0:
        return quotient(-high, -low, -other_high, -other_low)
    corners = [
        (math.copysign(math.inf, a) if a else 0.0) if b == 0.0 else a / b if not math.isinf(b) else 0.0
        for a in (low, high)
        for b in (other_low, other_high)
    ]
    if any(math.isnan(corner) for corner in corners):
        return (-math.inf, math.inf)
    return (down(min(corners)), up(max(corners)))


def _times(one: float, other: float) -> float:
    """Return the product, 0 if a factor is 0, even if the other is infinite."""
    return one * other if one and other else 0.0


def apply(row: Operation, *args: Approximation) -> Approximation:
    """Return a function of the C library; unbounded if it may be undefined or a pole is near."""
    try:
        if row.kind == "power":
            low, high, change = _power(*args)
        elif row.curve is None:
            return ANY
        else:
            (one,) = args
            low, high = row.extent(one.low, one.high)
            change = row.curve.change(one.low, one.high, one.error) if one.error else 0.0
    except (ValueError, OverflowError, ZeroDivisionError):
        return ANY
    if math.isnan(low) or math.isnan(high) or math.isnan(change):
        return ANY
    low, high = low - abs(low) * 1e-14 - _TINY, high + abs(high) * 1e-14 + _TINY
    magnitude = max(abs(low), abs(high)) + change
    if not magnitude <= _LARGEST:
        return Approximation(low, high, math.inf)
    # the slope is computed with the same functions: a small factor covers their error
    return Approximation(low, high, wider(change * (1 + 1e-12) + _FUNCTION_ULPS * math.ulp(magnitude)))


def _power(base: Approximation, exponent: Approximation) -> tuple[float, float, float]:
    """Return the interval of a power, and its change by the errors of base and exponent."""
    if exponent.is_exact and exponent.low == exponent.high == int(exponent.low) and exponent.low >= 0:
        return _whole_power(base, int(exponent.low))
    if exponent.is_exact and exponent.low == exponent.high > 0.0:
        return _positive_power(base, exponent.low)
    low, high = base.low - base.error, base.high + base.error
    if low <= 0.0:
        raise ValueError("the base may be 0 or below")
    exponents = (exponent.low - exponent.error, exponent.high + exponent.error)
    corners = [value**power for value in (base.low, base.high) for power in (exponent.low, exponent.high)]
    wide = [value**power for value in (low, high) for power in exponents]
    logarithm = max(abs(math.log(low)), abs(math.log(high)))
    # d(b ** y) = b ** y * (y / b * db + log b * dy)
    steep = max(map(abs, exponents)) / low * base.error + logarithm * exponent.error
    return min(corners), max(corners), max(wide) * steep


def _positive_power(base: Approximation, power: float) -> tuple[float, float, float]:
    """Return the same for a base that is not negative and an exact exponent above 0."""
    low, high = max(0.0, base.low), max(0.0, base.high)
    reach = high + base.error
    if power >= 1.0:
        return low**power, high**power, power * reach ** (power - 1) * base.error
    change = base.error**power  # its largest value over an interval of this length, next to 0
    steady = low - base.error
    if steady > 0.0:
        change = min(change, power * steady ** (power - 1) * base.error)
    return low**power, high**power, change


def _whole_power(base: Approximation, power: int) -> tuple[float, float, float]:
    ends = [base.low**power, base.high**power]
    if power % 2 == 0 and base.low < 0.0 < base.high:
        ends.append(0.0)
    reach = base.magnitude + base.error
    change = power * reach ** (power - 1) * base.error if power and base.error else 0.0
    return min(ends), max(ends), change
