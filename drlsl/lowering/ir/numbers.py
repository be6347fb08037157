"""Arithmetic on nodes: the kinds of numbers, where an operation is defined, how large a result can be.

Every operation is total: where Prolog would raise an error its value is undefined, and the condition that it
has a value is kept separately. The bounds of a result follow from those of the arguments, so most conditions
are known to hold when a program is lowered.

Source: ISO 13211-1, 9, as the rows of `drlsl.logic.core.OPERATIONS` say.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from drlsl.logic.core import COMPARISONS, NODES, OPERATIONS, Operation, instantiated
from drlsl.logic.terms import Atom, Struct, Var
from drlsl.lowering.ir.nodes import UNKNOWN, Interval, Kind, Node, Pool
from drlsl.lowering.ir.schema import INT_BOUND
from drlsl.lowering.ir.trees import Sym, resolve

LARGEST: Final = 1e300
"""Largest float result, so that further operations cannot overflow at once."""

SMALLEST_DIVISOR: Final = 1e-30
"""Smallest divisor; division by less is left to the interpreter."""

_MOST_MULTIPLICATIONS: Final = 16

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
            return self.operation(term.name, *map(self.evaluate, term.args))
        if isinstance(term, Atom) and (term.name, 0) in OPERATIONS:
            return self._within(self.operation(term.name))
        if isinstance(term, Var | Atom | str):
            raise NoValue
        raise AssertionError(f"no term: {term!r}")

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

    def _made(self, row: Operation, kind: Kind, *args: Node) -> Node:
        """Return the node of an operation, within the bounds that its row knows."""
        bounds = UNKNOWN
        if row.bounds is not None:
            bounds = row.bounds(*((arg.low, arg.high) for arg in args))
        elif row.curve is not None and row.curve.domain == UNKNOWN:
            bounds = row.curve.image
        return self._make(row.node, kind, args, bounds)

    def _make(self, op: str, kind: Kind, args: tuple[Node, ...], bounds: Interval) -> Node:
        if all(arg.is_const for arg in args):
            value = NODES[op].compute(*(arg.data for arg in args))
            return self.pool.const(float(value) if kind == "float" else int(value))
        return self.pool.make(op, kind, args, None, bounds)

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

    def operation(self, name: str, *args: Node) -> Node:
        """Return the value of an operation.

        Raises:
            NoValue: it has none.
            NotCovered: only the interpreter can evaluate it.
        """
        spread = self._distribute(lambda *sides: self.operation(name, *sides), *args)
        if spread is not None:
            return spread
        row = OPERATIONS.get((name, len(args)))
        if row is None:
            raise NotCovered(f"generated code has no {name}/{len(args)}")
        if row.refused:
            raise NotCovered(f"generated code has no {name}/{len(args)}: {row.refused}")
        if row.kind == "whole" and any(arg.kind != "int" for arg in args):
            raise NoValue
        if row.defined:
            return self.evaluate(instantiated(row.defined, args))
        return _LOWERED[row.kind](self, row, *args)

    def _demand(self, row: Operation, args: tuple[Node, ...]) -> None:
        """Add the condition under which an operation has a value."""
        if row.needs is not None:
            condition, otherwise = row.needs
            goal = instantiated(condition, args)
            self.need(self.compare(goal.name, *map(self.evaluate, goal.args)), otherwise)

    def _constant(self, row: Operation) -> Node:
        return self.pool.const(row.compute())

    def _negate(self, _row: Operation, arg: Node) -> Node:
        return arg.args[0] if arg.op == "neg" else self._make("neg", arg.kind, (arg,), (-arg.high, -arg.low))

    def _sign(self, row: Operation, arg: Node) -> Node:
        return self._made(NODES["isign"] if arg.kind == "int" else row, arg.kind, arg)

    def _convert(self, _row: Operation, arg: Node) -> Node:
        return self.to_float(arg)

    def _step(self, row: Operation, arg: Node) -> Node:
        if arg.kind == "int":
            return arg
        self._within(arg, float(INT_BOUND // 2))
        return self._within(self._made(row, "int", arg))

    def _whole(self, row: Operation, *args: Node) -> Node:
        if row.divides and args[-1].is_const and args[-1].data == 0:
            raise NoValue
        self._demand(row, args)
        return self._within(self._made(row, "int", *args))

    def _real(self, row: Operation, *args: Node) -> Node:
        floats = tuple(map(self.to_float, args))
        self._demand(row, floats)
        return self._within(self._made(row, "float", *floats))

    def _absolute(self, _row: Operation, arg: Node) -> Node:
        if arg.op in ("abs", "sqrt") or arg.low > 0:
            return arg
        low = 0.0 if arg.low <= 0 <= arg.high else min(abs(arg.low), abs(arg.high))
        return self._make(
            "abs", arg.kind, (_forward(self.pool, arg),), (low, max(abs(arg.low), abs(arg.high)))
        )

    def _ring(self, row: Operation, left: Node, right: Node) -> Node:
        name = row.name
        left, right = self._pair(left, right)
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
            # the product itself might wrap around: judge it as a float, where it is exact enough
            self._within(self._ring(row, self.to_float(left), self.to_float(right)), float(INT_BOUND // 2))
            most = float(INT_BOUND)
            return self.pool.make(
                "mul", "int", (left, right), None, (max(low, -most), min(max(corners), most))
            )
        return self._within(self._make("mul", kind, (left, right), (low, max(corners))))

    def _divide(self, row: Operation, left: Node, right: Node) -> Node:
        if left.kind == right.kind == "int" and self.iso:
            return self._quotient(self.to_float(left), self.to_float(right))
        if left.kind == right.kind == "int":
            self._demand(row, (left, right))
            rest = self._made(NODES["mod"], "int", left, right)
            exact = self._made(NODES["floordiv"], "int", left, right)
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

    def _extreme(self, row: Operation, left: Node, right: Node) -> Node:
        if left.kind == right.kind:
            return left if left is right else self._made(row, left.kind, left, right)
        # of equal numbers of unlike kinds the float is taken
        whole, real = (left, right) if left.kind == "int" else (right, left)
        as_float = self.to_float(whole)
        if row.node == "max":
            return self.pool.choose(self.pool.less(real, as_float), whole, real)
        return self.pool.choose(self.pool.less(as_float, real), whole, real)

    def _power(self, row: Operation, left: Node, right: Node) -> Node:
        if row.name == "**" and self.iso:
            left, right = self.to_float(left), self.to_float(right)
        if left.kind == right.kind == "int":
            if not right.is_const or not 0 <= right.data <= _MOST_MULTIPLICATIONS:
                raise NotCovered("an integer power needs a constant exponent from 0 to 16")
            result = self.pool.const(1)
            for _ in range(right.data):
                result = self.operation("*", result, left)
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
        return self._within(self._make("pow", "float", (base, exponent), _power_bounds(base, exponent)))

    def compare(self, name: str, left: Node, right: Node) -> Node:
        """Return the truth of a comparison."""
        spread = self._distribute(lambda a, b: self.compare(name, a, b), left, right)
        if spread is not None:
            return spread
        left, right = self._pair(left, right)
        row = COMPARISONS[name]
        if row.turned:
            left, right = right, left
        cond = (self.pool.equal if row.equality else self.pool.less)(left, right)
        return self.pool.not_(cond) if row.negated else cond


_LOWERED: Final[dict[str, Callable[..., Node]]] = {
    "constant": Arithmetic._constant,
    "ring": Arithmetic._ring,
    "quotient": Arithmetic._divide,
    "extreme": Arithmetic._extreme,
    "power": Arithmetic._power,
    "negation": Arithmetic._negate,
    "magnitude": Arithmetic._absolute,
    "sign": Arithmetic._sign,
    "conversion": Arithmetic._convert,
    "step": Arithmetic._step,
    "whole": Arithmetic._whole,
    "real": Arithmetic._real,
}
"""What becomes of an operation, by its kind."""


def is_checked_divisor(node: Node) -> bool:
    """Return whether a division by a number is only defined if that is not too close to 0."""
    return node.low <= SMALLEST_DIVISOR and node.high >= -SMALLEST_DIVISOR and not node.is_const


def _power_bounds(base: Node, exponent: Node) -> Interval:
    """Return bounds of a power with a constant exponent of 0 or more, where it is defined."""
    if not exponent.is_const or exponent.data < 0:
        return UNKNOWN
    whole = exponent.data == int(exponent.data)
    power = NODES["pow"].compute
    low, high = (power(end if whole else max(end, 0.0), exponent.data) for end in (base.low, base.high))
    if math.isnan(low) or math.isnan(high):
        return UNKNOWN
    if exponent.data % 2 != 1:
        low, high = 0.0, max(low, high)
    slack = 1e-12  # the C library's power is exact to the last bits only
    return low - slack * abs(low), high + slack * abs(high)


def _forward(pool: Pool, node: Node) -> Node:
    """Return a difference reversed if its later argument is second; the magnitude is the same."""
    if node.op == "sub" and node.kind == "float":
        left, right = node.args
        if left.order < right.order:
            return pool.make("sub", "float", (right, left), None, (-node.high, -node.low))
    return node
