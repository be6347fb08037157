"""Functions that the engine evaluates: of numbers of either type, raising what ISO says.

Source: ISO 13211-1, 9, with Cor.2; then what SWI-Prolog programs expect besides. With the flag `iso` off,
``/`` and ``**`` of integers give an integer where that is exact.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeAlias

from drlsl.logic.core.integers import (
    SMALL_BITS,
    check_division,
    check_modular_power,
    check_power,
    check_product,
)
from drlsl.logic.core.total_functions import truncated
from drlsl.logic.errors import domain_error, evaluation_error, resource_error, type_error
from drlsl.logic.terms import MOST_BITS

if TYPE_CHECKING:
    import random

    from drlsl.logic.core.builtin_table import Caller

Number: TypeAlias = int | float
Evaluator: TypeAlias = Callable[..., Number]
"""Takes the arguments' values and then the machine; raises an error where there is no value."""


def whole(value: Number) -> int:
    """Return the value of an operation on integers alone."""
    if type(value) is not int:
        raise type_error("integer", value)
    return value


def check_float(value: float, *inputs: Number) -> float:
    """Return a float result, unless it is an infinity or NaN without such an input. Source: ISO, 9.1.4.2."""
    if value - value != 0.0:
        if math.isnan(value):
            if not any(map(_is_nan, inputs)):
                raise evaluation_error("undefined")
        elif not any(map(_is_special, inputs)):
            raise evaluation_error("float_overflow")
    return value


def _is_nan(value: Number) -> bool:
    return type(value) is float and math.isnan(value)


def _is_special(value: Number) -> bool:
    return type(value) is float and not math.isfinite(value)


def to_float(value: Number) -> float:
    """Return a number as a float.

    Raises:
        EvaluationError: ``float_overflow`` for an integer beyond the floats.
    """
    try:
        return float(value)
    except OverflowError:
        raise evaluation_error("float_overflow") from None


def of_one_type(left: Number, right: Number) -> tuple[Number, Number]:
    """Return two numbers in the type of their comparison: an integer beside a float becomes a float.

    An integer beyond the floats is kept, and compares by its magnitude.

    Source: ISO 13211-1, 8.7.1 with 9.1.4.1.
    """
    if type(left) is not type(right):
        try:
            return float(left), float(right)
        except OverflowError:
            pass
    return left, right


def _made(value: int, machine: Caller) -> int:
    """Return a large integer that an operation has created, accounted for."""
    machine.meter.text(value.bit_length() >> 3)
    return value


def arithmetic(operation: Callable[[Any, Any], Any]) -> Evaluator:
    """Return an operation such as addition: exact for integers, checked for floats."""

    def apply(left: Number, right: Number, machine: Caller) -> Number:
        if type(left) is int and type(right) is int:
            result: int = operation(left, right)
            return result if result.bit_length() <= SMALL_BITS else _made(result, machine)
        try:
            return check_float(operation(left, right), left, right)
        except OverflowError:
            raise evaluation_error("float_overflow") from None

    return apply


def multiply(left: Number, right: Number, machine: Caller) -> Number:
    """Return the product."""
    if type(left) is int and type(right) is int:
        if left.bit_length() + right.bit_length() <= SMALL_BITS:
            return left * right
        check_product(left, right, machine.meter)
        return _made(left * right, machine)
    return _multiply_floats(left, right, machine)


_multiply_floats = arithmetic(operator.mul)


def integers(operation: Callable[[int, int], int], *, is_slow: bool = False) -> Evaluator:
    """Return an operation of integers only; a slow one takes time by the product of their sizes."""

    def apply(left: Number, right: Number, machine: Caller) -> Number:
        if type(left) is int and type(right) is int:
            if is_slow and left.bit_length() > SMALL_BITS:
                check_division(left, right, machine.meter)
            result = operation(left, right)
            return result if result.bit_length() <= SMALL_BITS else _made(result, machine)
        raise type_error("integer", left if type(left) is not int else right)

    return apply


def division(operation: Callable[[int, int], int]) -> Evaluator:
    """Return an integer division or remainder: a zero divisor is an evaluation error."""

    def checked(left: int, right: int) -> int:
        if right == 0:
            raise evaluation_error("zero_divisor")
        return operation(left, right)

    return integers(checked, is_slow=True)


def rest(left: int, right: int) -> int:
    """Return what the quotient toward zero leaves, which has the sign of the dividend."""
    return left - right * truncated(left, right)


def shift_left(left: int, right: int) -> int:
    """Return the integer shifted to the left, or to the right by less than 0."""
    if right < 0:
        return left >> -right
    if not left:
        return 0
    if left.bit_length() + right > MOST_BITS:
        raise resource_error("memory")
    return left << right


def shift_right(left: int, right: int) -> int:
    """Return the integer shifted to the right."""
    return shift_left(left, -right) if right < 0 else left >> right


def get_bit(value: int, bit: int) -> int:
    """Return one bit of an integer."""
    if bit < 0:
        raise type_error("not_less_than_zero", bit)
    return (value >> bit) & 1


def common_multiple(left: int, right: int) -> int:
    """Return the least common multiple."""
    if left.bit_length() + right.bit_length() > MOST_BITS:
        raise resource_error("memory")
    return math.lcm(left, right)


def divide(left: Number, right: Number, machine: Caller) -> Number:
    """Return the quotient: an integer where it is one and the flag `iso` is off."""
    if right == 0 and (type(right) is int or machine.flags.iso or left == 0):
        raise evaluation_error("undefined" if left == 0 else "zero_divisor")
    if type(left) is int and type(right) is int and not machine.flags.iso:
        check_division(left, right, machine.meter)
        quotient, rest = divmod(left, right)
        if not rest:
            return quotient
    try:
        return check_float(left / right, left, right)
    except OverflowError:
        raise evaluation_error("float_overflow") from None
    except ZeroDivisionError:
        raise evaluation_error("zero_divisor") from None


def _power_of_floats(left: Number, right: Number) -> float:
    base, exponent = to_float(left), to_float(right)
    try:
        return check_float(math.pow(base, exponent), base, exponent)
    except ValueError:
        # math.pow has two such cases: zero to a negative power, and a negative base with a broken exponent.
        raise evaluation_error("zero_divisor" if base == 0.0 else "undefined") from None
    except OverflowError:
        raise evaluation_error("float_overflow") from None


def _power_of_integers(base: int, exponent: int, machine: Caller) -> int:
    """Source: ISO 13211-1 Cor.2, 9.3.10."""
    if exponent < 0:
        if base in (1, -1):
            return base if exponent % 2 else 1
        raise type_error("float", base)
    if abs(base) > 1:
        check_power(base.bit_length() * exponent, machine.meter)
    return _made(int(base**exponent), machine)


def power(left: Number, right: Number, machine: Caller) -> Number:
    """Return the value of ``^``."""
    if type(left) is int and type(right) is int and (right >= 0 or machine.flags.iso or left in (1, -1)):
        return _power_of_integers(left, right, machine)
    return _power_of_floats(left, right)


def star_power(left: Number, right: Number, machine: Caller) -> Number:
    """Return the value of ``**``: as ``^``, but with the flag `iso` a float."""
    if type(left) is int and type(right) is int and not machine.flags.iso:
        return power(left, right, machine)
    return _power_of_floats(left, right)


def maximum(left: Number, right: Number, _machine: Caller) -> Number:
    """Return the greater number."""
    one, other = of_one_type(left, right)
    if one == other:
        return _of_equals(left, right, 1.0)
    return left if one > other or _is_nan(left) else right


def minimum(left: Number, right: Number, _machine: Caller) -> Number:
    """Return the lesser number."""
    one, other = of_one_type(left, right)
    if one == other:
        return _of_equals(left, right, -1.0)
    return left if one < other or _is_nan(left) else right


def _of_equals(left: Number, right: Number, sign: float) -> Number:
    """Return the float of two equal numbers, as SWI-Prolog; of two zeros the one with the sign."""
    if type(left) is type(right) is float:
        return left if math.copysign(1.0, left) == sign else right
    return left if type(left) is float else right


def arc_tangent(left: Number, right: Number, machine: Caller) -> float:
    """Return the angle of a point, its y-coordinate first."""
    if left == 0 and right == 0 and machine.flags.iso:
        raise evaluation_error("undefined")
    return math.atan2(to_float(left), to_float(right))


def copy_sign(left: Number, right: Number, _machine: Caller) -> float:
    """Return the first number with the sign of the second."""
    return math.copysign(to_float(left), to_float(right))


def next_toward(left: Number, right: Number, _machine: Caller) -> float:
    """Return the float beside the first, toward the second."""
    return math.nextafter(to_float(left), to_float(right))


def modular_power(*values_and_machine: Any) -> int:
    """Return a power in modular arithmetic."""
    *values, machine = values_and_machine
    base, exponent, modulus = map(whole, values)
    if modulus == 0:
        raise evaluation_error("zero_divisor")
    check_modular_power(exponent, modulus, machine.meter)
    check_division(base, modulus, machine.meter)
    try:
        return pow(base, exponent, modulus)
    except ValueError:  # a negative power of what has no inverse
        raise evaluation_error("undefined") from None


def of_float(function: Callable[[float], float]) -> Evaluator:
    """Return a function of floats: undefined outside its domain."""

    def apply(value: Number, _machine: Caller) -> float:
        given = to_float(value)
        try:
            return check_float(function(given), given)
        except ValueError:
            raise evaluation_error("undefined") from None
        except OverflowError:
            raise evaluation_error("float_overflow") from None
        except ZeroDivisionError:
            raise evaluation_error("zero_divisor") from None

    return apply


def rounding(function: Callable[[Any], int]) -> Evaluator:
    """Return a function from floats to integers."""

    def apply(value: Number, _machine: Caller) -> int:
        if type(value) is int:
            return value
        try:
            return function(value)
        except (ValueError, OverflowError):
            raise evaluation_error("undefined") from None

    return apply


def nearest(value: float) -> int:
    """Return the nearest integer, a half upward in magnitude."""
    whole = math.trunc(value)
    rest = value - whole  # exact, which the distance to the floor is not
    return whole + (rest >= 0.5) - (rest <= -0.5)


def natural_logarithm(value: Number, _machine: Caller) -> float:
    """Return the natural logarithm."""
    if value <= 0:
        raise evaluation_error("undefined")
    return math.log(value)


def sign(value: Number, _machine: Caller) -> Number:
    """Return 1, 0 or -1, of the number's type."""
    if type(value) is int:
        return (value > 0) - (value < 0)
    return math.copysign(1.0, value) if value != 0.0 and not math.isnan(value) else value


def fraction(value: Number, _machine: Caller) -> Number:
    """Return what stands behind the point."""
    return 0 if type(value) is int else math.copysign(math.modf(value)[0], value)


def integer_part(value: Number, _machine: Caller) -> Number:
    """Return what stands before the point."""
    return value if type(value) is int else math.copysign(math.modf(value)[1], value)


def highest_bit(value: Number) -> int:
    """Return the place of the highest bit."""
    number = whole(value)
    if number <= 0:
        raise domain_error("not_less_than_one", number)
    return number.bit_length() - 1


def generator(machine: Caller) -> random.Random:
    """Return the engine's source of random numbers."""
    import random  # few programs draw, and it takes time to load

    known: random.Random = machine.state.setdefault("random", random.Random())
    return known


def random_integer(value: Number, machine: Caller) -> int:
    """Return a random integer from 0 to below the number."""
    bound = whole(value)
    if bound < 1:
        raise domain_error("not_less_than_one", bound)
    return generator(machine).randrange(bound)
