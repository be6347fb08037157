"""The table of arithmetic: which operations and comparisons there are, and their meaning in every tier.

A row holds all that any part of DRLSL knows about an operation: the interpreter and its compiler, the back
ends of generated code (one scene in Python, arrays with NumPy, Torch or Numba), and the proofs and their
checks. To add an operation, add a row to `_ROWS`.

Most new operations are `_defined` by others, and need nothing else. Proofs know what the `Curve` of a real
function (`_real`) says; without one its value may be anything. Functions of integers (`_whole`) are exact
everywhere. The other kinds are the basis of arithmetic: tiers and proofs have their own code for each kind.
"""

from __future__ import annotations

import functools
import math
import operator
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, TypeAlias

from drlsl.logic.core import checked_functions as checked
from drlsl.logic.core import total_functions as total
from drlsl.logic.core.checked_functions import Evaluator, Number
from drlsl.logic.errors import type_error
from drlsl.logic.syntax import Flags, read_term
from drlsl.logic.terms import Atom, Operators, Struct, Term, Var

Interval: TypeAlias = tuple[float, float]
OperationKind: TypeAlias = Literal[
    "constant",  # arity 0
    "definition",  # by other operations
    "ring",  # of two numbers of one type: + - *
    "quotient",
    "extreme",
    "power",
    "negation",
    "magnitude",
    "sign",
    "conversion",  # to a float
    "step",  # from a number to an integer, which never falls
    "whole",  # from integers to an integer
    "real",  # from floats to a float
]

_ALL: Final[Interval] = (-math.inf, math.inf)


@dataclass(frozen=True, slots=True)
class Curve:
    """Properties of a real function of one number.

    It is defined from `domain[0]` to `domain[1]`, without these ends if it `excludes_ends`; its value is a
    float at most within `reach`. The values of floats lie in `image`. Over an interval inside `piece` the
    extreme values are at the ends or in `turns`. An error of the argument, which lies between `low` and
    `high`, changes the value by at most ``change(low, high, error)``.
    """

    change: Callable[[float, float, float], float]
    image: Interval = _ALL
    domain: Interval = _ALL
    excludes_ends: bool = False
    reach: Interval = _ALL
    piece: Interval | None = _ALL
    turns: tuple[float, ...] = ()

    @property
    def arguments(self) -> Interval:
        """The interval of floats for which the value is a float."""
        low, high = self.domain
        if self.excludes_ends:
            low, high = math.nextafter(low, math.inf), math.nextafter(high, -math.inf)
        return max(low, self.reach[0]), min(high, self.reach[1])


def _nothing(*_values: Any) -> Any:
    raise AssertionError("generated code has no such operation")


@dataclass(frozen=True, slots=True)
class Operation:
    """A row: an evaluable functor.

    `evaluate` computes it in the engine. In the text of one that is `defined` by others, `A`, `B` and so on
    are its arguments. One that is `refused` is left to the interpreter, for that reason.

    In generated code it is the `node` of that name, and `compute` is its total function: a `library` function
    is called through Python, so that the last bit is the interpreter's. Its text is `infix`, with its
    precedence; or for one scene `text`, which is faster than a call, under the condition `guard`. Arrays have
    the method `arrays` of `Ops`. `needs` is the condition under which it is defined, as a goal, and the error
    otherwise; one that `divides` is undefined if its last argument is 0. `bounds` returns the bounds of the
    value, given those of the arguments. `grows` says for each argument whether the double rises (1) or falls
    (-1) with it; it is empty if that is unknown. `curve` is what proofs know about a real function.
    """

    name: str
    arity: int
    kind: OperationKind
    evaluate: Evaluator
    node: str = ""
    compute: Callable[..., Any] = _nothing
    infix: tuple[str, int] | None = None
    defined: str = ""
    refused: str = ""
    library: bool = False
    text: str = ""
    guard: str = ""
    arrays: str = ""
    needs: tuple[str, str] | None = None
    divides: bool = False
    bounds: Callable[..., Interval] | None = None
    grows: tuple[int, ...] = ()
    curve: Curve | None = None

    def extent(self, low: float, high: float) -> Interval:
        """Return the least and the greatest value over an interval of arguments, as computed.

        Raises:
            ValueError: No bounds are known.
        """
        curve = self.curve
        if curve is None:
            raise ValueError(f"nothing is known of {self.name}/{self.arity}")
        if not curve.excludes_ends:
            low, high = (min(curve.domain[1], max(curve.domain[0], end)) for end in (low, high))
        values = list(curve.image)
        if curve.piece is not None and curve.piece[0] <= low <= high <= curve.piece[1]:
            turns = (turn for turn in curve.turns if low < turn < high)
            values = [self.compute(place) for place in (low, high, *turns)]
        if not all(map(math.isfinite, values)):
            raise ValueError(f"{self.name} has no bounds from {low} to {high}")
        return min(values), max(values)


@dataclass(frozen=True, slots=True)
class Comparison:
    """A row: an arithmetic comparison, its Python text, and its form in terms of < or =.

    `turned`: with its sides exchanged; `negated`: as the negation.
    """

    holds: Callable[[Any, Any], bool]
    text: str
    equality: bool = False
    turned: bool = False
    negated: bool = False


COMPARISONS: Final = {
    "=:=": Comparison(operator.eq, "==", equality=True),
    "=\\=": Comparison(operator.ne, "!=", equality=True, negated=True),
    "<": Comparison(operator.lt, "<"),
    "=<": Comparison(operator.le, "<=", turned=True, negated=True),
    ">": Comparison(operator.gt, ">", turned=True),
    ">=": Comparison(operator.ge, ">=", negated=True),
}
"""Comparisons of two numbers of one type, by name."""


@functools.cache
def parsed(text: str) -> tuple[Term, dict[str, int]]:
    """Return the term of a definition or condition, and the number of the argument for each variable."""
    read = read_term(text, Operators(), Flags())
    return read.term, {name: ord(name) - ord("A") for name in read.variables}


def instantiated(text: str, args: Sequence[Any]) -> Any:
    """Return the term of a definition or condition with arguments in place of its variables."""

    def put(term: Any) -> Any:
        if isinstance(term, Var):
            return args[places[term.name]]
        return Struct(term.name, tuple(map(put, term.args))) if isinstance(term, Struct) else term

    term, places = parsed(text)
    return put(term)


def _composed(text: str) -> Evaluator:
    """Return the function of a definition, composed of other rows' functions when it is first called."""

    @functools.cache
    def made() -> Evaluator:
        return _composition(*parsed(text))

    return lambda *values: made()(*values)


def _composition(term: Term, places: dict[str, int]) -> Evaluator:
    if isinstance(term, Var):
        place = places[term.name]
        return lambda *values: values[place]
    if isinstance(term, int | float):
        number = term
        return lambda *_values: number
    assert isinstance(term, Struct)
    evaluate = OPERATIONS[term.name, len(term.args)].evaluate
    parts = [_composition(arg, places) for arg in term.args]
    return lambda *values: evaluate(*(part(*values) for part in parts), values[-1])


OPERATIONS: Final[dict[tuple[str, int], Operation]] = {}
"""The rows, by name and arity."""

NODES: Final[dict[str, Operation]] = {}
"""The rows that are nodes of generated code, by the name of the node."""

UNARY: Final[dict[str, Evaluator]] = {}
BINARY: Final[dict[str, Evaluator]] = {}
"""What the engine evaluates, by name."""


def declare(row: Operation) -> None:
    """Add a row to the table."""
    OPERATIONS[row.name, row.arity] = row
    if row.node:
        NODES.setdefault(row.node, row)
    if row.arity in (1, 2):
        (UNARY if row.arity == 1 else BINARY)[row.name] = row.evaluate


# The factories say what the rows of a kind have in common.


def _constant(name: str, value: Number, refused: str = "") -> Operation:
    return Operation(name, 0, "constant", lambda _machine: value, compute=lambda: value, refused=refused)


def _engine_only(name: str, arity: int, evaluate: Evaluator, because: str) -> Operation:
    return Operation(name, arity, "constant", evaluate, refused=because)


def _not_finite(name: str, value: float) -> Operation:
    def evaluate(machine: Any) -> float:
        if machine.flags.iso:
            raise type_error("evaluable", Struct("/", (Atom(name), 0)))
        return value

    return _engine_only(name, 0, evaluate, "no number that generated code can hold")


def _defined(
    name: str, arity: int, text: str, evaluate: Evaluator | None = None, kind: OperationKind = "definition"
) -> Operation:
    """Return a row defined by other operations; `evaluate` is the same, but faster."""
    return Operation(name, arity, kind, evaluate or _composed(text), defined=text)


def _of_one(function: Callable[[Any], Number]) -> Evaluator:
    return lambda value, _machine: function(value)


def _sign(node: str, compute: Callable[[Any], Number], text: str) -> Operation:
    return Operation(
        *("sign", 1, "sign", checked.sign, node, compute),
        text=text,
        arrays="sign",
        bounds=lambda _one: (-1.0, 1.0),
    )


def _step(name: str, evaluate: Callable[[Any], int], node: str, compute: Callable[[float], int]) -> Operation:
    return Operation(
        *(name, 1, "step", checked.rounding(evaluate), node, compute),
        arrays=compute.__name__,
        bounds=lambda one: (one[0] - 1, one[1] + 1),
        grows=(1,),
    )


def _division(name: str, function: Any, node: str, compute: Any, arrays: str, **more: Any) -> Operation:
    evaluate = checked.division(function)
    return Operation(name, 2, "whole", evaluate, node, compute, arrays=arrays, **_DIVIDES, **more)


def _bits(name: str, node: str, operation: Callable[[int, int], int], infix: tuple[str, int]) -> Operation:
    return Operation(name, 2, "whole", checked.integers(operation), node, operation, infix=infix)


def _whole(name: str, arity: int, evaluate: Evaluator, node: str, function: Any, **more: Any) -> Operation:
    """Return the row of a function of integers that is called through Python."""
    compute = total.as_word(node, function)
    return Operation(name, arity, "whole", evaluate, node, compute, library=True, **more)


def _real(
    name: str,
    function: Callable[[float], float],
    curve: Curve | None = None,
    evaluate: Evaluator | None = None,
    needs: tuple[str, str] | None = None,
) -> Operation:
    """Return the row of a function of the C library, or of any other of one float."""
    compute = total.as_float(name, function)
    evaluate = evaluate or checked.of_float(function)
    return Operation(name, 1, "real", evaluate, name, compute, library=True, needs=needs, curve=curve)


def _steepest(slope: Callable[[float], float]) -> Callable[[float, float, float], float]:
    """Return the change of a function whose slope is greatest at an end of the interval."""
    return lambda low, high, error: error * max(abs(slope(low - error)), abs(slope(high + error)))


def _at_most_one(_low: float, _high: float, error: float) -> float:
    """Return the change of a function whose slope is nowhere greater than 1."""
    return error


def _arc(_low: float, _high: float, error: float) -> float:
    """Return the change of asin and acos, which are steepest at 1: acos(1 - e) <= pi sqrt(e / 2)."""
    return math.pi * math.sqrt(error / 2)


def _no_larger(one: Interval, _other: Interval) -> Interval:
    """Return the bounds of an integer quotient."""
    most = max(abs(one[0]), abs(one[1]))
    return -most, most


def _smaller(_one: Interval, other: Interval) -> Interval:
    """Return the bounds of a remainder, which has the sign of the divisor."""
    return min(other[0], 0.0), max(other[1], 0.0)


_DIVIDES: Final[Any] = {"needs": ("B =\\= 0", "a division by 0"), "divides": True}
_POSITIVE: Final = ("A > 0.0", "log of a number that is not positive")
_TOO_LARGE: Final = "generated code holds no integer that large"
_CHANGES: Final = "its value changes from call to call"
_SIGNS: Final = "it tells the two zeros apart, which arrays do not"
_OF_DOUBLES: Final = "it speaks of doubles, not of numbers"

_ROWS: Final = (
    _constant("pi", math.pi),
    _constant("e", math.e),
    _constant("epsilon", sys.float_info.epsilon),
    _constant("max_integer", sys.maxsize, _TOO_LARGE),
    _constant("min_integer", -sys.maxsize - 1, _TOO_LARGE),
    _constant("max_tagged_integer", (1 << 60) - 1, _TOO_LARGE),
    _constant("min_tagged_integer", -(1 << 60), _TOO_LARGE),
    _not_finite("inf", math.inf),
    _not_finite("infinite", math.inf),
    _not_finite("nan", math.nan),
    _engine_only("random", 0, lambda machine: checked.generator(machine).random(), _CHANGES),
    _engine_only("random_float", 0, lambda machine: checked.generator(machine).random(), _CHANGES),
    _engine_only("random", 1, checked.random_integer, _CHANGES),
    _engine_only("cputime", 0, lambda _machine: time.process_time(), _CHANGES),
    _engine_only("realtime", 0, lambda _machine: int(time.time()), _CHANGES),
    # of any numbers
    Operation("+", 2, "ring", checked.arithmetic(operator.add), "add", operator.add, ("+", 11), grows=(1, 1)),
    Operation(
        "-", 2, "ring", checked.arithmetic(operator.sub), "sub", operator.sub, ("-", 11), grows=(1, -1)
    ),
    Operation("*", 2, "ring", checked.multiply, "mul", operator.mul, ("*", 12)),
    Operation("/", 2, "quotient", checked.divide, "div", total.quotient, ("/", 12), guard="{1}", **_DIVIDES),
    Operation(
        *("min", 2, "extreme", checked.minimum, "min", total.lesser),
        text="{0} if {0} < {1} else {1}",
        arrays="minimum",
        bounds=lambda one, other: (min(one[0], other[0]), min(one[1], other[1])),
    ),
    Operation(
        *("max", 2, "extreme", checked.maximum, "max", total.greater),
        text="{0} if {0} >= {1} else {1}",
        arrays="maximum",
        bounds=lambda one, other: (max(one[0], other[0]), max(one[1], other[1])),
    ),
    Operation("**", 2, "power", checked.star_power, "pow", total.as_float("pow", math.pow), library=True),
    Operation("^", 2, "power", checked.power, "pow", total.as_float("pow", math.pow), library=True),
    _defined("+", 1, "A", _of_one(lambda value: value)),
    Operation("-", 1, "negation", _of_one(operator.neg), "neg", operator.neg, ("-", 13), grows=(-1,)),
    Operation("abs", 1, "magnitude", _of_one(abs), "abs", abs, arrays="absolute"),
    _sign("isign", total.integer_sign, "({0} > 0) - ({0} < 0)"),  # of integers
    _sign("sign", total.sign, ""),
    Operation(
        "float", 1, "conversion", _of_one(checked.to_float), "tofloat", float, arrays="to_float", grows=(1,)
    ),
    _step("floor", math.floor, "floor", total.floor),
    _step("ceiling", math.ceil, "ceiling", total.ceiling),
    _step("truncate", math.trunc, "truncate", total.truncate),
    _step("round", checked.nearest, "round", total.rounded),
    _step("integer", checked.nearest, "round", total.rounded),
    _engine_only("float_integer_part", 1, checked.integer_part, _SIGNS),
    _engine_only("float_fractional_part", 1, checked.fraction, _SIGNS),
    # of integers
    _division("//", total.truncated, "truncdiv", total.truncated, "truncated", bounds=_no_larger),
    _division(
        *("div", operator.floordiv, "floordiv", total.floor_quotient, "floor_divide"),
        infix=("//", 12),
        guard="{1}",
        bounds=_no_larger,
    ),
    _division(
        *("mod", operator.mod, "mod", total.floor_rest, "remainder"),
        infix=("%", 12),
        guard="{1}",
        bounds=_smaller,
    ),
    _defined("rem", 2, "A - B * (A // B)", checked.division(checked.rest), kind="whole"),
    _defined("succ", 1, "A + 1", _of_one(lambda value: checked.whole(value) + 1), kind="whole"),
    _defined("\\", 1, "-A - 1", _of_one(lambda value: ~checked.whole(value)), kind="whole"),
    _bits("/\\", "bitand", operator.and_, ("&", 9)),
    _bits("\\/", "bitor", operator.or_, ("|", 7)),
    _bits("xor", "bitxor", operator.xor, ("^", 8)),
    _whole("<<", 2, checked.integers(checked.shift_left), "shift_left", checked.shift_left),
    _whole(">>", 2, checked.integers(checked.shift_right), "shift_right", checked.shift_right),
    _whole(
        *("gcd", 2, checked.integers(math.gcd, is_slow=True), "gcd", math.gcd),
        bounds=lambda one, other: (0.0, max(map(abs, (*one, *other)))),
    ),
    _whole("lcm", 2, checked.integers(checked.common_multiple, is_slow=True), "lcm", checked.common_multiple),
    _whole("msb", 1, _of_one(checked.highest_bit), "msb", checked.highest_bit),
    _whole("popcount", 1, _of_one(lambda value: checked.whole(value).bit_count()), "popcount", int.bit_count),
    _whole("getbit", 2, checked.integers(checked.get_bit), "getbit", checked.get_bit),
    _engine_only("powm", 3, checked.modular_power, "a remainder is of use to ciphers, not to rules"),
    # of floats
    Operation(
        *("sqrt", 1, "real", checked.of_float(math.sqrt), "sqrt", total.root),
        text="sqrt({0})",
        guard="{0} >= 0.0",
        arrays="sqrt",
        needs=("A >= 0.0", "a square root of a negative number"),
        bounds=lambda one: (math.sqrt(max(one[0], 0.0)), math.sqrt(max(one[1], 0.0))),
        grows=(1,),
    ),
    _real(
        "exp",
        math.exp,
        Curve(_steepest(math.exp), image=(0.0, math.inf), reach=(-math.inf, 709.78)),
    ),
    _real(
        "log",
        math.log,
        Curve(
            _steepest(lambda value: 1 / value if value > 0 else math.inf),
            image=(-746.0, 710.0),
            domain=(0.0, math.inf),
            excludes_ends=True,
        ),
        checked.natural_logarithm,
        needs=_POSITIVE,
    ),
    _defined("log", 2, "log(B) / log(A)"),
    _defined("log2", 1, "log(A) / log(2.0)"),
    _real("sin", math.sin, Curve(_at_most_one, image=(-1.0, 1.0), piece=None)),
    _real("cos", math.cos, Curve(_at_most_one, image=(-1.0, 1.0), piece=None)),
    _real(
        *("tan", math.tan),
        Curve(_steepest(lambda value: 1 + math.tan(value) ** 2), piece=(-1.57, 1.57)),
    ),
    _real("asin", math.asin, Curve(_arc, image=(-1.6, 1.6), domain=(-1.0, 1.0))),
    _real("acos", math.acos, Curve(_arc, image=(0.0, 3.2), domain=(-1.0, 1.0))),
    _real("atan", math.atan, Curve(_at_most_one, image=(-1.6, 1.6))),
    _real("sinh", math.sinh, Curve(_steepest(math.cosh), reach=(-710.47, 710.47))),
    _real(
        "cosh",
        math.cosh,
        Curve(_steepest(math.sinh), image=(1.0, math.inf), reach=(-710.47, 710.47), turns=(0.0,)),
    ),
    _real("tanh", math.tanh, Curve(_at_most_one, image=(-1.0, 1.0))),
    _real("asinh", math.asinh, Curve(_at_most_one, image=(-711.0, 711.0))),
    _real(
        "acosh",
        math.acosh,
        Curve(
            lambda _low, _high, error: math.sqrt(2 * error),
            image=(0.0, 711.0),
            domain=(1.0, math.inf),
        ),
    ),
    _real(
        "atanh",
        math.atanh,
        Curve(
            _steepest(lambda value: 1 / (1 - value * value) if abs(value) < 1 else math.inf),
            domain=(-1.0, 1.0),
            excludes_ends=True,
        ),
    ),
    _real("erf", math.erf),
    _real("erfc", math.erfc),
    _real("lgamma", math.lgamma),
    _defined("cot", 1, "1.0 / tan(A)"),
    _defined("acot", 1, "atan(1.0 / A)"),
    _engine_only("atan2", 2, checked.arc_tangent, _SIGNS),
    _engine_only("atan", 2, checked.arc_tangent, _SIGNS),
    _engine_only("copysign", 2, checked.copy_sign, _SIGNS),
    _engine_only("nexttoward", 2, checked.next_toward, _OF_DOUBLES),
)

for _row in _ROWS:
    declare(_row)
