"""Arithmetic: evaluable functors over unbounded integers and floats.

Source: ISO 13211-1, 9, with Cor.2; then what SWI-Prolog programs expect besides. With the flag `iso` off,
``/`` and ``**`` of integers give an integer where that is exact, and ``inf`` and ``nan`` are evaluable.
"""

from __future__ import annotations

import math
import operator
import random
import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from drlsl.logic.core.integers import (
    SMALL_BITS,
    check_division,
    check_modular_power,
    check_power,
    check_product,
)
from drlsl.logic.errors import domain_error, evaluation_error, instantiation_error, resource_error, type_error
from drlsl.logic.terms import MOST_BITS, NIL, Atom, CyclicTerm, Struct, Term, Var, deref, is_acyclic

if TYPE_CHECKING:
    from drlsl.logic.core.builtin_table import Caller

Number: TypeAlias = int | float

_NESTED: Final = 150
_FEW_NESTED: Final = 8
_STEPS_OF_OPERATION: Final = 3
# After this many steps, a long walk checks once that the term is finite.
_LONG: Final = 10_000


def evaluate(term: Term, machine: Caller, nested: int = 0) -> Number:
    """Return the value of an arithmetic expression.

    Raises:
        InstantiationError: A variable in it is unbound.
        PrologTypeError: Something in it is not evaluable, or of the wrong type.
        EvaluationError: It is undefined. Source: ISO 13211-1, 9.1.4.
    """
    while True:
        kind = type(term)
        if kind is int or kind is float:
            return term  # type: ignore[return-value]  # kind says so
        if kind is Var:
            term = deref(term)
            if type(term) is Var:
                raise instantiation_error()
            continue
        break
    if kind is not Struct:
        return _evaluate_constant(term, machine)
    assert type(term) is Struct
    if nested > _FEW_NESTED:
        # Shared parts are evaluated each time: a term of a few cells may take long.
        machine.meter.spend(_STEPS_OF_OPERATION)
        if nested > _NESTED:
            return _evaluate_deep(term, machine)
    args = term.args
    if len(args) == 2:
        binary = BINARY.get(term.name)
        if binary is not None:
            left = args[0]
            if type(left) is not int:
                left = evaluate(left, machine, nested + 1)
            right = args[1]
            if type(right) is not int:
                right = evaluate(right, machine, nested + 1)
            return binary(left, right, machine)
    elif len(args) == 1:
        unary = UNARY.get(term.name)
        if unary is not None:
            return unary(evaluate(args[0], machine, nested + 1), machine)
    return _evaluate_rare(term, [], machine, nested)


def _evaluate_rare(term: Struct, values: list[Number], machine: Caller, nested: int) -> Number:
    """Return the value of an unusual functor; `values` holds the arguments' values if they are known."""
    name, arity = term.name, len(term.args)
    if name == "." and arity == 2 and deref(term.args[1]) is NIL:
        char = deref(term.args[0])
        if type(char) is Atom and len(char.name) == 1 and not machine.flags.iso:
            return ord(char.name)
        return values[0] if values else evaluate(term.args[0], machine, nested + 1)
    if name == "powm" and arity == 3:
        base, exponent, modulus = (
            _integer(value) for value in values or [evaluate(arg, machine, nested + 1) for arg in term.args]
        )
        return _modular_power(base, exponent, modulus, machine)
    raise type_error("evaluable", Struct("/", (Atom(name), arity)))


def _modular_power(base: int, exponent: int, modulus: int, machine: Caller) -> int:
    if modulus == 0:
        raise evaluation_error("zero_divisor")
    check_modular_power(exponent, modulus, machine.meter)
    check_division(base, modulus, machine.meter)
    try:
        return pow(base, exponent, modulus)
    except ValueError:  # a negative power of an integer without an inverse
        raise evaluation_error("undefined") from None


def _evaluate_deep(root: Struct, machine: Caller) -> Number:
    """Evaluate with an explicit stack, for expressions nested deeper than Python's.

    Raises:
        CyclicTerm: The expression is infinite.
    """
    values: list[Number] = []
    todo: list[tuple[Term, bool]] = [(root, False)]
    steps = 0
    while todo:
        steps += 1
        machine.meter.spend(_STEPS_OF_OPERATION)
        if steps == _LONG and not is_acyclic(root):
            raise CyclicTerm("the expression contains itself")
        term, ready = todo.pop()
        term = deref(term)
        if type(term) is not Struct:
            values.append(evaluate(term, machine))
            continue
        arity = len(term.args)
        if not ready:
            is_list = term.name == "." and arity == 2 and deref(term.args[1]) is NIL
            todo.append((term, True))
            todo.extend((arg, False) for arg in reversed(term.args[:1] if is_list else term.args))
            continue
        if term.name == "." and arity == 2:
            continue
        args = values[-arity:]
        del values[-arity:]
        if arity == 2 and term.name in BINARY:
            values.append(BINARY[term.name](args[0], args[1], machine))
        elif arity == 1 and term.name in UNARY:
            values.append(UNARY[term.name](args[0], machine))
        else:
            values.append(_evaluate_rare(term, args, machine, 0))
    return values[0]


def _evaluate_constant(term: Term, machine: Caller) -> Number:
    if type(term) is Atom:
        constant = _CONSTANTS.get(term.name)
        if constant is not None:
            return constant
        make = _CHANGING.get(term.name)
        if make is not None:
            return make(machine)
        if not machine.flags.iso and term.name in _NOT_FINITE:
            return _NOT_FINITE[term.name]
        raise type_error("evaluable", Struct("/", (term, 0)))
    if type(term) is str and len(term) == 1:
        return ord(term)
    raise type_error("evaluable", term)


# ---------------------------------------------------------------------- checks


def _integer(value: Number) -> int:
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


# ---------------------------------------------------------------------- comparison


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


COMPARISONS: Final[dict[str, Callable[[Any, Any], bool]]] = {
    "=:=": operator.eq,
    "=\\=": operator.ne,
    "<": operator.lt,
    "=<": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
"""Comparisons of two numbers of one type, by name."""


def comparison(name: str) -> Callable[[Number, Number], bool]:
    """Return a comparison of two numbers of any type."""
    holds = COMPARISONS[name]
    return lambda left, right: holds(*of_one_type(left, right))


# ---------------------------------------------------------------------- operations of two numbers

Binary: TypeAlias = Callable[[Any, Any, "Caller"], Number]
Unary: TypeAlias = Callable[[Any, "Caller"], Number]


def _made(value: int, machine: Caller) -> int:
    """Return a large integer that an operation has created, accounted for."""
    machine.meter.text(value.bit_length() >> 3)
    return value


def _arithmetic(operation: Callable[[Any, Any], Any]) -> Binary:
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


def _multiply(left: Number, right: Number, machine: Caller) -> Number:
    if type(left) is int and type(right) is int:
        if left.bit_length() + right.bit_length() <= SMALL_BITS:
            return left * right
        check_product(left, right, machine.meter)
        return _made(left * right, machine)
    return _multiply_floats(left, right, machine)


_multiply_floats = _arithmetic(operator.mul)


def _integers(operation: Callable[[int, int], int], *, is_slow: bool = False) -> Binary:
    """Return an operation of integers only; a slow one takes time by the product of their sizes."""

    def apply(left: Number, right: Number, machine: Caller) -> Number:
        if type(left) is int and type(right) is int:
            if is_slow and left.bit_length() > SMALL_BITS:
                check_division(left, right, machine.meter)
            result = operation(left, right)
            return result if result.bit_length() <= SMALL_BITS else _made(result, machine)
        raise type_error("integer", left if type(left) is not int else right)

    return apply


def _division(operation: Callable[[int, int], int]) -> Binary:
    """Return an integer division or remainder: a zero divisor is an evaluation error."""

    def checked(left: int, right: int) -> int:
        if right == 0:
            raise evaluation_error("zero_divisor")
        return operation(left, right)

    return _integers(checked, is_slow=True)


def _truncated(left: int, right: int) -> int:
    quotient = abs(left) // abs(right)
    return quotient if (left < 0) == (right < 0) else -quotient


def _shift_left(left: int, right: int) -> int:
    if right < 0:
        return left >> -right
    if not left:
        return 0
    if left.bit_length() + right > MOST_BITS:
        raise resource_error("memory")
    return left << right


def _shift_right(left: int, right: int) -> int:
    return _shift_left(left, -right) if right < 0 else left >> right


def _get_bit(value: int, bit: int) -> int:
    if bit < 0:
        raise type_error("not_less_than_zero", bit)
    return (value >> bit) & 1


def _least_common_multiple(left: int, right: int) -> int:
    if left.bit_length() + right.bit_length() > MOST_BITS:
        raise resource_error("memory")
    return math.lcm(left, right)


def _divide(left: Number, right: Number, machine: Caller) -> Number:
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
        # math.pow has two such cases: zero to a negative power, and a negative base with a fractional
        # exponent.
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


def _power(left: Number, right: Number, machine: Caller) -> Number:
    if type(left) is int and type(right) is int and (right >= 0 or machine.flags.iso or left in (1, -1)):
        return _power_of_integers(left, right, machine)
    return _power_of_floats(left, right)


def _star_power(left: Number, right: Number, machine: Caller) -> Number:
    if type(left) is int and type(right) is int and not machine.flags.iso:
        return _power(left, right, machine)
    return _power_of_floats(left, right)


def _maximum(left: Number, right: Number, _machine: Caller) -> Number:
    one, other = of_one_type(left, right)
    if one == other:
        return _of_equals(left, right, 1.0)
    return left if one > other or _is_nan(left) else right


def _minimum(left: Number, right: Number, _machine: Caller) -> Number:
    one, other = of_one_type(left, right)
    if one == other:
        return _of_equals(left, right, -1.0)
    return left if one < other or _is_nan(left) else right


def _of_equals(left: Number, right: Number, sign: float) -> Number:
    """Return the float of two equal numbers, as SWI-Prolog; of two zeros the one with the sign."""
    if type(left) is type(right) is float:
        return left if math.copysign(1.0, left) == sign else right
    return left if type(left) is float else right


def _arc_tangent(left: Number, right: Number, machine: Caller) -> float:
    if left == 0 and right == 0 and machine.flags.iso:
        raise evaluation_error("undefined")
    return math.atan2(to_float(left), to_float(right))


def _copy_sign(left: Number, right: Number, _machine: Caller) -> float:
    return math.copysign(to_float(left), to_float(right))


def _next_toward(left: Number, right: Number, _machine: Caller) -> float:
    return math.nextafter(to_float(left), to_float(right))


def _logarithm(base: Number, value: Number, machine: Caller) -> float:
    divisor = _natural_logarithm(base, machine)
    if divisor == 0.0:
        raise evaluation_error("zero_divisor")
    return check_float(_natural_logarithm(value, machine) / divisor)


BINARY: Final[dict[str, Binary]] = {
    "+": _arithmetic(operator.add),
    "-": _arithmetic(operator.sub),
    "*": _multiply,
    "/": _divide,
    "//": _division(_truncated),
    "div": _division(operator.floordiv),
    "mod": _division(operator.mod),
    "rem": _division(lambda left, right: left - right * _truncated(left, right)),
    "**": _star_power,
    "^": _power,
    "min": _minimum,
    "max": _maximum,
    ">>": _integers(_shift_right),
    "<<": _integers(_shift_left),
    "/\\": _integers(operator.and_),
    "\\/": _integers(operator.or_),
    "xor": _integers(operator.xor),
    "gcd": _integers(math.gcd, is_slow=True),
    "lcm": _integers(_least_common_multiple, is_slow=True),
    "getbit": _integers(_get_bit),
    "atan2": _arc_tangent,
    "atan": _arc_tangent,
    "copysign": _copy_sign,
    "nexttoward": _next_toward,
    "log": _logarithm,
}


# ---------------------------------------------------------------------- operations of one number


def _of_float(function: Callable[[float], float]) -> Unary:
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


def _rounding(function: Callable[[Any], int]) -> Unary:
    """Return a function from floats to integers."""

    def apply(value: Number, _machine: Caller) -> int:
        if type(value) is int:
            return value
        try:
            return function(value)
        except (ValueError, OverflowError):
            raise evaluation_error("undefined") from None

    return apply


def _round(value: float) -> int:
    whole = math.trunc(value)
    rest = value - whole  # exact, which the distance to the floor is not
    return whole + (rest >= 0.5) - (rest <= -0.5)


def _natural_logarithm(value: Number, _machine: Caller) -> float:
    if value <= 0:
        raise evaluation_error("undefined")
    return math.log(value)


def _negate(value: Number, _machine: Caller) -> Number:
    return -value


def _sign(value: Number, _machine: Caller) -> Number:
    if type(value) is int:
        return (value > 0) - (value < 0)
    return math.copysign(1.0, value) if value != 0.0 and not math.isnan(value) else value


def _fraction(value: Number, _machine: Caller) -> Number:
    return 0 if type(value) is int else math.copysign(math.modf(value)[0], value)


def _whole(value: Number, _machine: Caller) -> Number:
    return value if type(value) is int else math.copysign(math.modf(value)[1], value)


def _succ(value: Number, _machine: Caller) -> int:
    return _integer(value) + 1


def _most_significant_bit(value: Number, _machine: Caller) -> int:
    number = _integer(value)
    if number <= 0:
        raise domain_error("not_less_than_one", number)
    return number.bit_length() - 1


def generator(machine: Caller) -> random.Random:
    """Return the engine's source of random numbers."""
    known: random.Random = machine.state.setdefault("random", random.Random())
    return known


def _random(value: Number, machine: Caller) -> int:
    bound = _integer(value)
    if bound < 1:
        raise domain_error("not_less_than_one", bound)
    return generator(machine).randrange(bound)


UNARY: Final[dict[str, Unary]] = {
    "-": _negate,
    "+": lambda value, _machine: value,
    "abs": lambda value, _machine: abs(value),
    "sign": _sign,
    "\\": lambda value, _machine: ~_integer(value),
    "succ": _succ,
    "msb": _most_significant_bit,
    "popcount": lambda value, _machine: _integer(value).bit_count(),
    "float": lambda value, _machine: to_float(value),
    "integer": _rounding(_round),
    "truncate": _rounding(math.trunc),
    "round": _rounding(_round),
    "ceiling": _rounding(math.ceil),
    "floor": _rounding(math.floor),
    "float_integer_part": _whole,
    "float_fractional_part": _fraction,
    "sqrt": _of_float(math.sqrt),
    "exp": _of_float(math.exp),
    "log": _natural_logarithm,
    "log2": lambda value, machine: _natural_logarithm(value, machine) / math.log(2.0),
    "sin": _of_float(math.sin),
    "cos": _of_float(math.cos),
    "tan": _of_float(math.tan),
    "asin": _of_float(math.asin),
    "acos": _of_float(math.acos),
    "atan": _of_float(math.atan),
    "sinh": _of_float(math.sinh),
    "cosh": _of_float(math.cosh),
    "tanh": _of_float(math.tanh),
    "asinh": _of_float(math.asinh),
    "acosh": _of_float(math.acosh),
    "atanh": _of_float(math.atanh),
    "erf": _of_float(math.erf),
    "erfc": _of_float(math.erfc),
    "lgamma": _of_float(math.lgamma),
    "cot": _of_float(lambda value: 1.0 / math.tan(value)),
    "acot": _of_float(lambda value: math.atan(1.0 / value)),
    "random": _random,
}

_CONSTANTS: Final[dict[str, Number]] = {
    "pi": math.pi,
    "e": math.e,
    "epsilon": sys.float_info.epsilon,
    "max_integer": sys.maxsize,
    "min_integer": -sys.maxsize - 1,
    "max_tagged_integer": (1 << 60) - 1,
    "min_tagged_integer": -(1 << 60),
}
_NOT_FINITE: Final[dict[str, float]] = {
    "inf": math.inf,
    "infinite": math.inf,
    "nan": math.nan,
}
_CHANGING: Final[dict[str, Callable[[Caller], Number]]] = {
    "random": lambda machine: generator(machine).random(),
    "random_float": lambda machine: generator(machine).random(),
    "cputime": lambda _machine: time.process_time(),
    "realtime": lambda _machine: int(time.time()),
}
