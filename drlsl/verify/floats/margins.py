"""The margin by which comparisons must clear their limits for doubles to decide as a proof says.

A proof is about real numbers. `margin_of` walks the lowered property as it is evaluated, from left to right,
with an interval and an error bound for every number (`rounding.py`), and finds the least margin M such that
in every scene where each evaluated comparison clears its limit by M, each has the same outcome in doubles. A
passed comparison narrows the numbers after it; one that doubles decide by their order alone, such as
min(X, Y) > X, is always right.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from drlsl.logic.core import COMPARISONS, NODES
from drlsl.logic.terms import Atom, Operators, Struct, Var, format_term
from drlsl.lowering.frontend import Answer
from drlsl.lowering.ir import QUANTIFIERS, SMALLEST_DIVISOR, Node, Pool
from drlsl.verify.floats.assumed import Simplifier
from drlsl.verify.floats.intervals import MOST_PIECES, STRIDE, Columns, Context, Values
from drlsl.verify.floats.ordering import Order
from drlsl.verify.floats.rounding import up
from drlsl.verify.ranges import Range

USUAL_MARGIN: Final = 1e-9
"""The usual margin, in the unit of the comparison; a proof with a larger one needs a reason."""

GREATEST_MARGIN: Final = 1e-3
"""Largest margin; a proof that needs a larger one holds in real arithmetic only."""

_MARGINS: Final = (
    USUAL_MARGIN,
    *(digit * 10.0**power for power in range(-9, -3) for digit in (1, 2, 5) if power > -9 or digit > 1),
    GREATEST_MARGIN,
)


@dataclass(frozen=True, slots=True)
class Floats:
    """The consequences of a proof in real numbers for doubles.

    `margin`: doubles decide alike unless a comparison is within it of its limit; None: no such margin is
    known, and the proof holds in real arithmetic only. `error` is the largest bound on the rounding error of
    a comparison that clears its limit by the margin, `comparison` is the one with that error; for a margin
    above the usual, it is the one that needs it, without a margin, the one that prevents it. `overflows`:
    that one is a division by a number too close to 0. `divisors`: some divisors count as compared with 0.
    """

    margin: float | None
    error: float
    comparison: str | None = None
    divisors: bool = False
    overflows: bool = False

    @property
    def because(self) -> str | None:
        """The reason why the proof implies less for doubles than usual, or nothing; None if it does not."""
        if self.overflows:
            return f"{self.comparison} may overflow: no margin keeps its divisor far enough from 0"
        if self.margin is None:
            off = f"by {self.error:.2g}" if math.isfinite(self.error) else "by any amount"
            return f"{self.comparison} may be off {off}"
        if self.margin > USUAL_MARGIN:
            return f"closer to a limit, {self.comparison} may be off by more than that"
        return None

    def as_json(self) -> dict[str, Any]:
        """Return the fields as `--json` prints them."""
        return {
            "margin": self.margin,
            "error": self.error if math.isfinite(self.error) else None,
            "comparison": self.comparison,
            "divisors": self.divisors,
            "because": self.because,
        }


class _Walk:
    """Examines every evaluated comparison, for one margin."""

    def __init__(self, values: Values) -> None:
        self._values = values
        self._seen: set[tuple[Node, Context]] = set()
        self.largest: tuple[float, Node | None] = (0.0, None)
        self.failed: tuple[float, Node | None] | None = None
        self.divisors = False
        self._overflows: set[Node] = set()

    @property
    def overflows(self) -> bool:
        """True if a division by a number too close to 0 prevents a margin."""
        return self.failed is not None and self.failed[1] in self._overflows

    def visit(self, node: Node, context: Context) -> None:
        """Check the comparisons in a node."""
        place = (node, self._values.about(node, context))
        if place in self._seen:
            return
        self._seen.add(place)
        args = node.args
        match node.op:
            case "and" | "or":
                inner: Context | None = context
                for arg in args:
                    if inner is None:
                        return
                    self.visit(arg, inner)
                    inner = self._values.passed(arg, node.op == "and", inner)
            case "select":
                self._choice(node, context)
            case "where":
                self.visit(args[0], context)
                inner = self._values.entered(args[1], context)
                if inner is not None:
                    self.visit(args[2], inner)
            case "loop" | "row" | "facts" | "others" | "const":
                pass
            case _ if node.op in QUANTIFIERS:
                self._quantifier(node, context)
            case _:
                for arg in args:
                    self.visit(arg, context)
                self._compare(node, context)

    def _choice(self, node: Node, context: Context) -> None:
        self.visit(node.args[0], context)
        for arg, inner in zip(node.args[1:], self._values.sides(node.args[0], context), strict=True):
            if inner is not None:
                self.visit(arg, inner)

    def _quantifier(self, node: Node, context: Context) -> None:
        self.visit(node.args[0].args[0], context)
        inner = self._values.entered(node.args[0], context)
        if inner is None:
            return
        self.visit(node.args[1], inner)
        inner = self._values.passed(node.args[1], True, inner)
        if inner is None:
            return
        for value in node.args[2:]:
            self.visit(value, inner)
        if node.op in ("argmin", "argmax"):
            self._judge(node, 2 * self._values.of(node.args[2], inner).error)

    def _compare(self, node: Node, context: Context) -> None:
        """Judge a node that is a comparison, or decides by one."""
        values = self._values
        match node.op:
            case "lt" | "eq" if node.args[0].kind not in ("atom", "index", "bool"):
                self._difference(node, node.args[0], node.args[1], context)
            case "within" if node.data == SMALLEST_DIVISOR:
                self._divisor(node, context)
            case "within":
                number = values.of(node.args[0], context)
                if not number.magnitude + number.error < node.data:
                    self._judge(node, math.inf)
            case op if op in NODES and NODES[op].kind in ("step", "sign") and node.args[0].kind == "float":
                self._judge(node, values.of(node.args[0], context).error)

    def _divisor(self, node: Node, context: Context) -> None:
        """Judge a division by the comparison of its divisor with 0, if a scene may be clear of that."""
        values, divisor = self._values, node.args[0]
        if not values.may_vanish(divisor, context):
            return
        number = values.of(divisor, context)
        if 0.0 < number.least <= SMALLEST_DIVISOR or number.magnitude <= values.margin:
            self._overflows.add(node)
            self._judge(node, math.inf)
            return
        self.divisors = True
        self._difference(node, divisor, values.pool.const(0.0), context, SMALLEST_DIVISOR)

    def _difference(self, node: Node, left: Node, right: Node, context: Context, more: float = 0.0) -> None:
        """Judge a comparison by the error of the difference of its sides, piece by piece of its size."""
        values = self._values
        one, other = values.of(left, context), values.of(right, context)
        error = one.error + other.error + more
        if error <= values.margin:
            self._judge(node, error)
            return
        step = values.margin
        most = max(up(one.high - other.low), up(other.high - one.low))
        worst = self._off(left, right, (-step, step), context) + more
        for _ in range(MOST_PIECES):
            if step > error or step > most:
                break
            for bounds in ((step, STRIDE * step), (-STRIDE * step, -step)):
                off = self._off(left, right, bounds, context) + more
                if off > step:
                    self._judge(node, off)
                    return
            step *= STRIDE
        else:
            worst = error
        self._judge(node, min(worst, values.margin))

    def _off(self, left: Node, right: Node, bounds: tuple[float, float], context: Context) -> float:
        """Return the error of a difference within bounds."""
        inner = self._values.near(left, right, bounds, context)
        if inner is None:
            return 0.0
        return self._values.of(left, inner).error + self._values.of(right, inner).error

    def _judge(self, node: Node, error: float) -> None:
        if not error <= self._values.margin:
            if self.failed is None or error > self.failed[0]:
                self.failed = (error, node)
        elif self.largest[1] is None or error > self.largest[0]:
            self.largest = (error, node)


def margin_of(
    answer: Answer, pool: Pool, ranges: Mapping[str, Range], vehicles: int, columns: Columns | None = None
) -> Floats:
    """Return the margin of a property proved in real numbers, with `vehicles` vehicles besides the ego.

    `columns` bound the facts if they are not those of a driving scene.
    """
    simplifier = Simplifier(pool, Order(Values(pool, ranges, vehicles, USUAL_MARGIN, columns)).settled)
    roots = [simplifier.simplified(root, {}) for root in (answer.undecided, answer.found)]

    def walk(wanted: float) -> _Walk:
        values = Values(pool, ranges, vehicles, wanted, columns)
        result = _Walk(values)
        for root in roots:
            result.visit(root, values.start)
        return result

    first = walk(USUAL_MARGIN)
    if first.failed is None:
        return Floats(USUAL_MARGIN, first.largest[0], _written(pool, first.largest[1]), first.divisors)
    last = walk(GREATEST_MARGIN)
    if last.failed is not None:
        error, node = last.failed
        return Floats(None, error, _written(pool, node), last.divisors, last.overflows)
    failing, enough = 0, len(_MARGINS) - 1
    while enough - failing > 1:
        middle = (failing + enough) // 2
        if walk(_MARGINS[middle]).failed is None:
            enough = middle
        else:
            failing = middle
    below, above = walk(_MARGINS[failing]), walk(_MARGINS[enough])
    assert below.failed is not None
    return Floats(_MARGINS[enough], above.largest[0], _written(pool, below.failed[1]), above.divisors)


def _written(pool: Pool, node: Node | None) -> str | None:
    """Return a comparison as written: file, line and text."""
    if node is None:
        return None
    source = pool.sources.get(node)
    if source is None:
        return f"a choice by {pool.names.get(node, node.op)}"
    clause, term = source.clause, source.term
    if isinstance(term, Struct) and term.name in COMPARISONS:
        text = f" {term.name} ".join(_text(pool, arg) for arg in term.args)
    else:
        text = _text(pool, term)
    return text if clause is None or clause.span is None else f"{text} ({clause.span})"


def _text(pool: Pool, term: Any) -> str:
    return format_term(_readable(pool, term), Operators(), spacing=True)


def _readable(pool: Pool, term: Any) -> Any:
    """Return a term with the names of its variables, and of the values in it, as atoms."""
    if isinstance(term, Struct):
        return Struct(term.name, tuple(_readable(pool, arg) for arg in term.args))
    if isinstance(term, Var):
        return Atom(term.name)
    return Atom(pool.names.get(term, "_")) if isinstance(term, Node) else term
