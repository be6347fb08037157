"""Decimal digits of integers of any size, both ways.

Python's own conversions refuse more than 4,300 digits, since their time grows with the square of the number.
"""

from __future__ import annotations

import decimal
from collections.abc import Callable
from functools import cache
from typing import Final, Protocol

MOST_BITS: Final = 1 << 24
"""An integer of more bits is a resource error: it takes seconds to work with."""

# Read by what the digits could need: a decimal one less than four bits.
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
        """Account for a text of so many bytes that is about to be made."""

    def forecast(self, seconds: float) -> None:
        """Account for an operation about to begin that cannot be interrupted and takes so long [s]."""


def product_seconds(first: int, second: int) -> float:
    """The time that a product of integers of so many bits takes at most [s]."""
    small, large = sorted((first, second))
    return float(_PRODUCT * (small / 2**20) ** 1.585 * large / max(1, small))


def decimal_digits(value: int, meter: Costs | None = None) -> str:
    """The decimal text of an integer of any size.

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
    """The same number as a decimal, whose products are fast: halves joined, so as deep as log2(bits)."""
    if bits <= _BITS_AT_ONCE:
        return decimal.Decimal(value)
    half = bits // 2
    high = value >> half
    return _to_decimal(high, bits - half, power) * power(half) + _to_decimal(
        value - (high << half), half, power
    )


def parse_digits(digits: str, base: int = 10, meter: Costs | None = None) -> int:
    """The value of digits in a base, however many; single ``_`` may stand between them.

    Raises:
        ValueError: One is no digit of the base.
        OverflowError: There are too many.
        LimitExceeded: Reading them takes too long.
    """
    if len(digits) <= _DIGITS_AT_ONCE:
        return int(digits, base)
    digits = digits.replace("_", "")
    bits = int(len(digits) * (base - 1).bit_length())
    if bits > _MOST_READ:
        raise OverflowError("an integer of so many digits")
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
