"""The cost of operations on large integers.

Python's operations on integers cannot be interrupted, and some take time that grows with the square of the
size; so the time is estimated before, and reported to the meter of the query.
"""

from __future__ import annotations

from typing import Final

from drlsl.logic.errors import resource_error
from drlsl.logic.limits import Meter
from drlsl.logic.terms import MOST_BITS, product_seconds

# Operations on fewer bits need no estimate.
SMALL_BITS: Final = 1 << 14

# Seconds that CPython 3.11 takes on a slow machine: for the quotient or common divisor of two integers of
# 2**19 bits, which grows with the product of their sizes, and for a squaring and its remainder.
_DIVISION: Final = 0.3
_POWER_STEP: Final = 2e-12


def check_product(left: int, right: int, meter: Meter) -> None:
    """Check that a product may be computed.

    Raises:
        ResourceError: It has too many bits.
        LimitExceeded: It takes too long.
    """
    first, second = left.bit_length(), right.bit_length()
    if first + second > MOST_BITS:
        raise resource_error("memory")
    if first > SMALL_BITS and second > SMALL_BITS:
        meter.forecast(product_seconds(first, second))


def check_division(left: int, right: int, meter: Meter) -> None:
    """Check that a division, or the search for a common divisor, ends in time.

    Raises:
        LimitExceeded: It takes too long.
    """
    first, second = left.bit_length(), right.bit_length()
    if first > SMALL_BITS and second > SMALL_BITS:
        meter.forecast(_DIVISION * (first / 2**19) * (second / 2**19))


def check_power(bits: int, meter: Meter) -> None:
    """Check that a power of that many bits may be computed.

    Raises:
        ResourceError: It has too many bits.
        LimitExceeded: It takes too long.
    """
    if bits > MOST_BITS:
        raise resource_error("memory")
    if bits > SMALL_BITS:
        meter.forecast(2.0 * product_seconds(bits // 2, bits // 2))


def check_modular_power(exponent: int, modulus: int, meter: Meter) -> None:
    """Check that a power in modular arithmetic ends in time.

    Raises:
        LimitExceeded: It takes too long.
    """
    bits = modulus.bit_length()
    if exponent.bit_length() * bits > SMALL_BITS:
        meter.forecast(exponent.bit_length() * (1e-7 + _POWER_STEP * bits * bits))
