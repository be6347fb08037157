"""Decimal digits of integers of any size, both ways.

Python's own conversions refuse more than 4,300 digits, since their time grows with the square of the number.
"""

from __future__ import annotations

import decimal
from collections.abc import Callable
from functools import cache
from typing import Final, Protocol

MOST_BITS: Final = 1 << 24
"""Bits of the largest integer; a larger one, which takes seconds to compute with, is a resource error."""

# Estimated by the digits: a decimal one needs less than four bits.
_MOST_READ: Final = 4 * MOST_BITS // 3
_DIGITS_AT_ONCE: Final = 4000
_BITS_AT_ONCE: Final = 1 << 12

# Seconds on a slow machine: for a product of two integers of 2**20 bits (by Karatsuba's method), and for each
# bit that is written in decimal.
_PRODUCT: Final = 0.07
_TO_TEXT: Final = 1.5e-7


class Costs(Protocol):
    """Accounts for work, as `drlsl.logic.limits.Meter` does; its methods raise when a limit is reached."""

    def spend(self, steps: int) -> None:
        """Account for steps of a builtin."""

    def text(self, size: int) -> None:
        """Account for a text of `size` bytes that is about to be made."""

    def forecast(self, seconds: float) -> None:
        """Account for an uninterruptible operation about to begin that takes `seconds` [s]."""


def product_seconds(first: int, second: int) -> float:
    """Return the longest time of a product of integers of these numbers of bits [s]."""
    small, large = sorted((first, second))
    return float(_PRODUCT * (small / 2**20) ** 1.585 * large / max(1, small))


def decimal_digits(value: int, meter: Costs | None = None) -> str:
    """Return the decimal text of an integer of any size.

    Raises:
        LimitExceeded: Writing it takes too long.
    """
    bits = value.bit_length()
    if bits <= _BITS_AT_ONCE:
        return str(value)
    if meter is not None:
        meter.forecast(_TO_TEXT * bits)
    with decimal.localcontext(_exact()):
        digits = format(_to_decimal(abs(value), bits, cache(_power_of_two)), "f")
    return "-" + digits if value < 0 else digits


def _exact() -> decimal.Context:
    return decimal.Context(
        prec=decimal.MAX_PREC, Emax=decimal.MAX_EMAX, Emin=decimal.MIN_EMIN, traps=[decimal.Inexact]
    )


def _power_of_two(exponent: int) -> decimal.Decimal:
    return decimal.Decimal(2) ** exponent


def _to_decimal(value: int, bits: int, power: Callable[[int], decimal.Decimal]) -> decimal.Decimal:
    """Return the same number as a decimal, joined from halves: decimals have fast products."""
    if bits <= _BITS_AT_ONCE:
        return decimal.Decimal(value)
    half = bits // 2
    high = value >> half
    return _to_decimal(high, bits - half, power) * power(half) + _to_decimal(
        value - (high << half), half, power
    )


def parse_digits(digits: str, base: int = 10, meter: Costs | None = None) -> int:
    """Return the value of any number of digits in a base; single ``_`` may be between them.

    Raises:
        ValueError: One is not a digit of the base.
        OverflowError: There are too many.
        LimitExceeded: Reading them takes too long.
    """
    if len(digits) <= _DIGITS_AT_ONCE:
        return int(digits, base)
    digits = digits.replace("_", "")
    bits = int(len(digits) * (base - 1).bit_length())
    if bits > _MOST_READ:
        raise OverflowError("an integer with this many digits")
    if base & (base - 1) == 0:
        return int(digits, base)
    if meter is not None:
        meter.forecast(3.0 * product_seconds(bits // 2, bits // 2))
    parts = [
        int(digits[max(0, end - _DIGITS_AT_ONCE) : end], base)
        for end in range(len(digits), 0, -_DIGITS_AT_ONCE)
    ]
    weight = base**_DIGITS_AT_ONCE
    while len(parts) > 1:
        parts.append(0)
        parts = [low + high * weight for low, high in zip(parts[0::2], parts[1::2], strict=False)]
        if len(parts) > 1:
            weight *= weight
    return parts[0]
