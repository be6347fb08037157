"""Arithmetic on nodes: the kinds of numbers, where an operation is defined, how large a result can be.

Every operation is total: where Prolog would raise an error its value is undefined, and the condition that it
has a value is kept separately. The bounds of a result follow from those of the arguments, so most conditions
are known to hold when a program is lowered.

Source: ISO 13211-1, 9, as `drlsl.logic.core.arithmetic` reads it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

from drlsl.logic.terms import Atom, Struct, Var
from drlsl.lowering.ir.nodes import UNKNOWN, Interval, Kind, Node, Pool
from drlsl.lowering.ir.schema import INT_BOUND
from drlsl.lowering.ir.trees import Sym, resolve

LARGEST: Final = 1e300
"""Largest float result, so that further operations cannot overflow at once."""

SMALLEST_DIVISOR: Final = 1e-30
"""Smallest divisor; division by less is left to the interpreter."""

_MOST_MULTIPLICATIONS: Final = 16

CONSTANTS: Final = {"pi": math.pi, "e": math.e}


def truncated(left: int, right: int) -> int:
    """Return integer division toward zero; 0 for a zero divisor."""
    if right == 0:
        return 0
    quotient = abs(left) // abs(right)
    return quotient if (left < 0) == (right < 0) else -quotient


def rounded(value: float) -> int:
    """Return the nearest integer, a half upward in magnitude; 0 for NaN and infinities."""
    if not math.isfinite(value):
        return 0
    whole = math.trunc(value)
    rest = value - whole  # exact, which the distance to the floor is not
    return whole + (rest >= 0.5) - (rest <= -0.5)


def sign(value: float) -> float:
    """Return 1.0, -1.0, or the value itself if it is a zero."""
    return math.copysign(1.0, value) if value != 0.0 else value


def _total(function: Callable[..., float]) -> Callable[..., float]:
    def apply(*values: float) -> float:
        try:
            return function(*values)
        except (ValueError, OverflowError, ZeroDivisionError):
            return math.nan

    return apply


FUNCTIONS: Final[dict[str, Callable[..., float]]] = {
    name: _total(getattr(math, name))
    for name in (
        *(
            "exp",
            "log",
            "sin",
            "cos",
            "tan",
            "asin",
            "acos",
            "atan",
            "sinh",
            "cosh",
            "tanh",
            "asinh",
            "acosh",
        ),
        *("atanh", "pow"),
    )
}
"""The functions that the C library computes: NaN where they are undefined."""

_NEEDS_POSITIVE: Final = frozenset({"log"})

OPERATIONS: Final[dict[str, Callable[..., Any]]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b if b else math.nan,
    "neg": lambda a: -a,
    "abs": abs,
    "sign": sign,
    "isign": lambda a: (a > 0) - (a < 0),
    "min": lambda a, b: a if a < b else b,
    "max": lambda a, b: a if a >= b else b,
    "sqrt": lambda a: math.sqrt(a) if a >= 0 else math.nan,
    "tofloat": float,
    "floor": math.floor,
    "ceiling": math.ceil,
    "truncate": math.trunc,
    "round": rounded,
    "truncdiv": truncated,
    "floordiv": lambda a, b: a // b if b else 0,
    "mod": lambda a, b: a % b if b else 0,
    "bitand": lambda a, b: a & b,
    "bitor": lambda a, b: a | b,
    "bitxor": lambda a, b: a ^ b,
}
"""The operations on numbers as every tier computes them; undefined where Prolog raises an error."""

_INT_DIVISIONS: Final = {"//": "truncdiv", "div": "floordiv", "mod": "mod", "rem": "rem"}
_BIT_OPERATIONS: Final = {"/\\": "bitand", "\\/": "bitor", "xor": "bitxor"}
_ROUNDINGS: Final = {
    "floor": "floor",
    "ceiling": "ceiling",
    "truncate": "truncate",
    "integer": "round",
    "round": "round",
}
COMPARISONS: Final = frozenset({"<", ">", "=<", ">=", "=:=", "=\\="})


NO_VALUE: Final = "an expression without a value"


class NoValue(Exception):
    """The expression has no value in any scene: the interpreter raises an error there."""


class NotCovered(Exception):
    """The expression uses an operation that only the interpreter has."""


class Arithmetic:
    """Evaluates one expression; `needed` collects the conditions under which it has a value.

    Each condition comes with the error if it does not hold. With the flag `iso` on, ``/`` and ``**`` of
    integers give a float.
    """

    def __init__(self, pool: Pool, *, iso: bool) -> None:
        self.pool = pool
        self.iso = iso
        self.needed: list[tuple[Node, str]] = []

    def need(self, cond: Node, otherwise: str) -> None:
        """Record that the value is only defined if `cond` holds; `otherwise` describes the error."""
        if cond is not self.pool.true:
            self.needed.append((cond, otherwise))

    def evaluate(self, term: Sym) -> Node:
        """Return the value of an expression.

        Raises:
            NoValue: it has none.
            NotCovered: only the interpreter can evaluate it.
        """
        term = resolve(term)
        if isinstance(term, Node):
            if term.kind not in ("int", "float", "number"):
                raise NoValue
            return self._distribute(self._within, term) or self._within(term)
        if isinstance(term, int | float):
            if isinstance(term, float) and not math.isfinite(term):
                raise NotCovered(f"{term} is not a number that generated code can represent")
            return self._within(self.pool.const(term))
        if isinstance(term, Struct):
            if len(term.args) == 2:
                return self.binary(term.name, self.evaluate(term.args[0]), self.evaluate(term.args[1]))
            if len(term.args) == 1:
                return self.unary(term.name, self.evaluate(term.args[0]))
            raise NoValue
        if isinstance(term, Atom) and term.name in CONSTANTS:
            return self.pool.const(CONSTANTS[term.name])
        if isinstance(term, Atom) and term.name in (
            "inf",
            "infinite",
            "nan",
            "random",
            "random_float",
            "cputime",
            "realtime",
        ):
            raise NotCovered(f"generated code cannot evaluate {term.name}")
        if isinstance(term, Var | Atom | str):
            raise NoValue
        raise AssertionError(f"no term: {term!r}")

    # ---------------------------------------------------------------- kinds

    def _distribute(self, function: Callable[..., Node], *args: Node) -> Node | None:
        """Return `function` for each side of an argument that is an integer or a float by the scene."""
        for place, arg in enumerate(args):
            if arg.kind == "number":
                before, after = args[:place], args[place + 1 :]
                return self._on_sides(arg, lambda side: function(*before, side, *after))  # noqa: B023  (called at once)
        return None

    def _on_sides(self, number: Node, function: Callable[[Node], Node]) -> Node:
        cond, then, els = number.args
        values: list[Node] = []
        outer = self.needed
        for side, fails in ((then, self.pool.not_(cond)), (els, cond)):
            self.needed = []
            try:
                values.append(function(side))
            except NoValue:
                self.needed.append((self.pool.false, NO_VALUE))
            outer.extend((self.pool.or_([fails, need]), otherwise) for need, otherwise in self.needed)
        self.needed = outer
        if not values:
            raise NoValue
        return self.pool.choose(cond, values[0], values[-1])

    def to_float(self, node: Node) -> Node:
        """Return a number as a float."""
        if node.kind == "float":
            return node
        if node.op == "select" and node.kind == "int" and any(arg.is_const for arg in node.args[1:]):
            return self.pool.choose(node.args[0], *(self.to_float(arg) for arg in node.args[1:]))
        return self._distribute(self.to_float, node) or self._make(
            "tofloat", "float", (node,), (node.low, node.high)
        )

    def _pair(self, left: Node, right: Node) -> tuple[Node, Node]:
        if left.kind == right.kind:
            return left, right
        return self.to_float(left), self.to_float(right)

    def _make(self, op: str, kind: Kind, args: tuple[Node, ...], bounds: Interval, data: Any = None) -> Node:
        if all(arg.is_const for arg in args) and op in OPERATIONS:
            value = OPERATIONS[op](*(arg.data for arg in args))
            return self.pool.const(float(value) if kind == "float" else int(value))
        return self.pool.make(op, kind, args, data, bounds)

    def _within(self, node: Node, largest: float | None = None) -> Node:
        """Return `node`, defined only while it is not too large."""
        most = largest if largest is not None else float(INT_BOUND) if node.kind == "int" else LARGEST
        if -most <= node.low and node.high <= most:
            return node
        if node.is_const and not math.isfinite(node.data):
            raise NoValue  # the interpreter raises an evaluation error
        if node.is_const:
            raise NotCovered(f"{node.data} is out of the range of generated code")
        unit = "an integer" if node.kind == "int" else "a number"
        self.need(self.pool.make("within", "bool", (node,), most), f"{unit} beyond {most:g}")
        return node

    # ---------------------------------------------------------------- operations

    def binary(self, name: str, left: Node, right: Node) -> Node:
        """Return the value of a binary operation."""
        spread = self._distribute(lambda a, b: self.binary(name, a, b), left, right)
        if spread is not None:
            return spread
        if name in ("+", "-", "*"):
            return self._ring(name, *self._pair(left, right))
        if name == "/":
            return self._divide(left, right)
        if name in ("min", "max"):
            return self._extreme(name, left, right)
        if name in _INT_DIVISIONS or name in _BIT_OPERATIONS:
            if left.kind != "int" or right.kind != "int":
                raise NoValue
            if name in _BIT_OPERATIONS:
                return self._within(self._make(_BIT_OPERATIONS[name], "int", (left, right), UNKNOWN))
            return self._int_division(_INT_DIVISIONS[name], left, right)
        if name in ("**", "^"):
            if name == "**" and self.iso:
                left, right = self.to_float(left), self.to_float(right)
            return self._power(left, right)
        raise NotCovered(f"generated code has no {name}/2")

    def unary(self, name: str, arg: Node) -> Node:
        """Return the value of a unary operation."""
        spread = self._distribute(lambda a: self.unary(name, a), arg)
        if spread is not None:
            return spread
        if name == "+":
            return arg
        if name == "-":
            return (
                arg.args[0] if arg.op == "neg" else self._make("neg", arg.kind, (arg,), (-arg.high, -arg.low))
            )
        if name == "abs":
            return self._absolute(arg)
        if name == "sign":
            return self._make("sign" if arg.kind == "float" else "isign", arg.kind, (arg,), (-1.0, 1.0))
        if name == "float":
            return self.to_float(arg)
        if name in _ROUNDINGS:
            if arg.kind == "int":
                return arg
            bounds = (max(arg.low - 1, -LARGEST), min(arg.high + 1, LARGEST))
            self._within(arg, float(INT_BOUND // 2))
            return self._within(self._make(_ROUNDINGS[name], "int", (arg,), bounds))
        if name == "sqrt":
            value = self.to_float(arg)
            negative = self.pool.less(value, self.pool.const(0.0))
            self.need(self.pool.not_(negative), "a square root of a negative number")
            bounds = (math.sqrt(max(value.low, 0.0)), math.sqrt(max(value.high, 0.0)))
            return self._make("sqrt", "float", (value,), bounds)
        if name in FUNCTIONS and name != "pow":
            return self._function(name, self.to_float(arg))
        raise NotCovered(f"generated code has no {name}/1")

    def _absolute(self, arg: Node) -> Node:
        if arg.op in ("abs", "sqrt") or arg.low > 0:
            return arg
        low = 0.0 if arg.low <= 0 <= arg.high else min(abs(arg.low), abs(arg.high))
        return self._make(
            "abs", arg.kind, (_forward(self.pool, arg),), (low, max(abs(arg.low), abs(arg.high)))
        )

    def _ring(self, name: str, left: Node, right: Node) -> Node:
        kind = left.kind
        if name == "+":
            bounds = (left.low + right.low, left.high + right.high)
            if kind == "int" and 0 in (
                left.data if left.is_const else 1,
                right.data if right.is_const else 1,
            ):
                return right if left.is_const and left.data == 0 else left
            return self._within(self._make("add", kind, (left, right), bounds))
        if name == "-":
            if right.is_const and right.data == 0 and math.copysign(1.0, right.data) > 0:
                return left
            return self._within(
                self._make("sub", kind, (left, right), (left.low - right.high, left.high - right.low))
            )
        for one, other in ((left, right), (right, left)):
            if one.is_const and one.data == 1:
                return other
        if left is right:
            left = right = _forward(self.pool, left)
        corners = [a * b for a in (left.low, left.high) for b in (right.low, right.high)]
        low = max(min(corners), 0.0) if left is right else min(corners)
        if kind == "int" and max(map(abs, corners)) > INT_BOUND:
            # the product itself might wrap around: check it as a float, which is exact enough
            self._within(self._ring("*", self.to_float(left), self.to_float(right)), float(INT_BOUND // 2))
            most = float(INT_BOUND)
            return self.pool.make(
                "mul", "int", (left, right), None, (max(low, -most), min(max(corners), most))
            )
        return self._within(self._make("mul", kind, (left, right), (low, max(corners))))

    def _divide(self, left: Node, right: Node) -> Node:
        if left.kind == right.kind == "int" and self.iso:
            return self._quotient(self.to_float(left), self.to_float(right))
        if left.kind == right.kind == "int":
            self.need(self.pool.not_(self.pool.equal(right, self.pool.const(0))), "a division by 0")
            rest = self._make("mod", "int", (left, right), _mod_bounds(right))
            exact = self._make("floordiv", "int", (left, right), _symmetric(left))
            inexact = self._quotient(self.to_float(left), self.to_float(right))
            return self.pool.choose(self.pool.equal(rest, self.pool.const(0)), exact, inexact)
        return self._quotient(*self._pair(left, right))

    def _quotient(self, left: Node, right: Node) -> Node:
        if right.is_const and right.data == 0:
            raise NoValue
        if right.is_const and right.data == 1.0:
            return left
        if is_checked_divisor(right):
            small = self.pool.make("within", "bool", (right,), SMALLEST_DIVISOR)
            self.need(self.pool.not_(small), f"a division by {SMALLEST_DIVISOR:g} or less")
            bound = max(abs(left.low), abs(left.high)) / SMALLEST_DIVISOR
            low = 0.0 if left.low >= 0 and right.low >= 0 else -bound
            return self._within(self._make("div", "float", (left, right), (low, bound)))
        corners = [a / b for a in (left.low, left.high) for b in (right.low, right.high)]
        return self._within(self._make("div", "float", (left, right), (min(corners), max(corners))))

    def _int_division(self, op: str, left: Node, right: Node) -> Node:
        if right.is_const and right.data == 0:
            raise NoValue
        self.need(self.pool.not_(self.pool.equal(right, self.pool.const(0))), "a division by 0")
        if op == "rem":
            product = self._ring("*", right, self._make("truncdiv", "int", (left, right), _symmetric(left)))
            return self._ring("-", left, product)
        bounds = _mod_bounds(right) if op == "mod" else _symmetric(left)
        return self._within(self._make(op, "int", (left, right), bounds))

    def _extreme(self, name: str, left: Node, right: Node) -> Node:
        pick = min if name == "min" else max
        if left.kind == right.kind:
            if left is right:
                return left
            bounds = (pick(left.low, right.low), pick(left.high, right.high))
            return self._make(name, left.kind, (left, right), bounds)
        # of equal numbers of different kinds the float is taken
        whole, real = (left, right) if left.kind == "int" else (right, left)
        as_float = self.to_float(whole)
        if name == "max":
            return self.pool.choose(self.pool.less(real, as_float), whole, real)
        return self.pool.choose(self.pool.less(as_float, real), whole, real)

    def _power(self, left: Node, right: Node) -> Node:
        if left.kind == right.kind == "int":
            if not right.is_const or not 0 <= right.data <= _MOST_MULTIPLICATIONS:
                raise NotCovered("an integer power needs a constant exponent from 0 to 16")
            result = self.pool.const(1)
            for _ in range(right.data):
                result = self._ring("*", result, left)
            return result
        return self._power_of_floats(*self._pair(left, right))

    def _power_of_floats(self, base: Node, exponent: Node) -> Node:
        """Return the C library's power: undefined for 0 to less than 0, or less than 0 to a fraction."""
        pool, zero = self.pool, self.pool.const(0.0)
        negative, nothing = pool.less(base, zero), pool.equal(base, zero)
        defined = [pool.not_(pool.and_([nothing, pool.less(exponent, zero)]))]
        if not (exponent.is_const and exponent.data == int(exponent.data)):
            defined.append(pool.not_(negative))
        self.need(pool.and_(defined), "a power of a negative number, or of 0 to a negative exponent")
        return self._within(self._make_function("pow", (base, exponent), _power_bounds(base, exponent)))

    def _function(self, name: str, arg: Node) -> Node:
        if name in _NEEDS_POSITIVE:
            positive = self.pool.less(self.pool.const(0.0), arg)
            self.need(positive, f"{name} of a number that is not positive")
        bounds = (-1.0, 1.0) if name in ("sin", "cos", "tanh") else (-2.0, 2.0) if name == "atan" else UNKNOWN
        return self._within(self._make_function(name, (arg,), bounds))

    def _make_function(self, name: str, args: tuple[Node, ...], bounds: Interval) -> Node:
        if all(arg.is_const for arg in args):
            value = FUNCTIONS[name](*(arg.data for arg in args))
            if not math.isfinite(value):
                raise NoValue
            return self.pool.const(value)
        return self.pool.make("function", "float", args, name, bounds)

    # ---------------------------------------------------------------- comparison

    def compare(self, name: str, left: Node, right: Node) -> Node:
        """Return the truth of a comparison."""
        spread = self._distribute(lambda a, b: self.compare(name, a, b), left, right)
        if spread is not None:
            return spread
        left, right = self._pair(left, right)
        if name == "<":
            return self.pool.less(left, right)
        if name == ">":
            return self.pool.less(right, left)
        if name == "=<":
            return self.pool.not_(self.pool.less(right, left))
        if name == ">=":
            return self.pool.not_(self.pool.less(left, right))
        same = self.pool.equal(left, right)
        return same if name == "=:=" else self.pool.not_(same)


def is_checked_divisor(node: Node) -> bool:
    """Return whether a division by a number is only defined if that is not too close to 0."""
    return node.low <= SMALLEST_DIVISOR and node.high >= -SMALLEST_DIVISOR and not node.is_const


def _power_bounds(base: Node, exponent: Node) -> Interval:
    """Return bounds of a power with a constant exponent of 0 or more, where it is defined."""
    if not exponent.is_const or exponent.data < 0:
        return UNKNOWN
    whole = exponent.data == int(exponent.data)
    low, high = (
        FUNCTIONS["pow"](end if whole else max(end, 0.0), exponent.data) for end in (base.low, base.high)
    )
    if math.isnan(low) or math.isnan(high):
        return UNKNOWN
    if exponent.data % 2 != 1:
        low, high = 0.0, max(low, high)
    slack = 1e-12  # the C library's power is exact to the last bits only
    return low - slack * abs(low), high + slack * abs(high)


def _symmetric(node: Node) -> Interval:
    bound = max(abs(node.low), abs(node.high)) + 1
    return (-bound, bound)


def _mod_bounds(right: Node) -> Interval:
    return (min(right.low, 0.0), max(right.high, 0.0))


def _forward(pool: Pool, node: Node) -> Node:
    """Return a difference reversed if its later argument is second; the magnitude is the same."""
    if node.op == "sub" and node.kind == "float":
        left, right = node.args
        if left.order < right.order:
            return pool.make("sub", "float", (right, left), None, (-node.high, -node.low))
    return node
