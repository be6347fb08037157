"""Intervals and error bounds of the numbers of a lowered program, and what passed conditions imply.

Forward, the interval and the error of a number follow from those of its parts. Backward, the interval of a
number narrows its parts: so a comparison that the evaluation has passed, clear of its limit, narrows the
numbers that come after it, and a division by a number found to be above 0 has a bound.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, Final, TypeAlias

from drlsl.driving.scene import EGO_LIMITS
from drlsl.logic.core import NODES
from drlsl.lowering.ir import SMALLEST_DIVISOR, Node, Pool, is_checked_divisor, relation_of
from drlsl.verify.floats import rounding
from drlsl.verify.floats.rounding import ANY, Approximation, down, up
from drlsl.verify.names import VEHICLE, OpenRelation
from drlsl.verify.ranges import MOST_LANES_ONE_WAY, Range

_FINE: Final = 16.0
"""An error smaller than the margin by this factor is not computed more exactly."""

STRIDE: Final = 8.0
"""Ratio of the distances from a limit of successive pieces of a number's interval."""

_GAIN: Final = 0.1
"""An end of an interval that moves by a smaller share of itself is not moved."""

MOST_PIECES: Final = 100
"""More pieces than the interval of any bounded number has."""


Columns: TypeAlias = Mapping[tuple[str, int], tuple[Approximation, Approximation]]
"""By relation and column, the bounds of its first row and of any other row."""


def _fact_columns(ranges: Mapping[str, Range]) -> Columns:
    """Return, by relation and column, the bounds of its first row and of any other row."""

    def of(name: str) -> Approximation:
        return rounding.between(*ranges[name])

    def both_ways(name: str) -> Approximation:
        reach = of(name).magnitude
        return Approximation(-reach, reach)

    def around(middle: Approximation, reach: float) -> Approximation:
        return Approximation(down(middle.low - reach), up(middle.high + reach))

    width, radar = of("lane_width").high, of("radar_range").high
    ego_x, ego_y = of("position"), around(of("road_position"), width / 2)
    sizes = (of("length"), of("width"))
    lane = Approximation(0.0, float(MOST_LANES_ONE_WAY))
    ego = (ANY, lane, ego_x, ego_y, both_ways("ego_speed"), both_ways("lateral_speed"), *sizes)
    other = (ANY, lane, around(ego_x, radar), around(ego_y, radar), both_ways("speed"), ego[5], *sizes)
    centre = around(of("road_position"), up(MOST_LANES_ONE_WAY * width + of("median").high))
    # lanes touch, up to the rounding of their centre lines
    touching = Approximation(centre.low, centre.high, 4 * math.ulp(centre.magnitude))
    strip = (lane, ANY, touching, of("lane_width"), of("speed_limit"))
    result = {("vehicle", place): pair for place, pair in enumerate(zip(ego, other, strict=True))}
    result |= {("road_lane", place): (one, one) for place, one in enumerate(strip)}
    end = around(ego_x, of("end_ahead").magnitude)
    result |= {("lane_end", place): (one, one) for place, one in enumerate((lane, end))}
    single = {name: of(name) for name in ranges}
    single |= {
        "target_lane": lane,
        **{name: rounding.constant(limit) for name, limit in EGO_LIMITS.items()},
    }
    return result | {(name, 0): (one, one) for name, one in single.items()}


class Context:
    """The known intervals of numbers at a point of the evaluation, by node."""

    __slots__ = ("blind", "passed", "ranges", "values")

    def __init__(self, ranges: Mapping[Node, tuple[float, float]], *, blind: bool) -> None:
        self.ranges = ranges
        self.blind = blind
        self.values: dict[Node, Approximation] = {}
        self.passed: dict[tuple[Node, bool], Context | None] = {}


class Values:
    """Intervals and errors of numbers, and their consequences from conditions, for one margin.

    `columns` bound the facts if they are not those of a driving scene. In a `blind` context nothing is
    assumed, not even that comparisons were decided correctly.
    """

    def __init__(
        self,
        pool: Pool,
        ranges: Mapping[str, Range],
        rows: int,
        margin: float,
        columns: Columns | None = None,
    ) -> None:
        self.pool = pool
        self.margin = margin
        self._rows = rows
        self._columns = _fact_columns(ranges) if columns is None else columns
        self._radar = rounding.between(*ranges["radar_range"]).high
        self._contexts: dict[frozenset[Any], Context] = {}
        self._masks: dict[Node, int] = {}
        self.blind = Context({}, blind=True)
        self.start = self.context({})

    def context(self, ranges: Mapping[Node, tuple[float, float]]) -> Context:
        """Return the context with these intervals."""
        key = frozenset(ranges.items())
        known = self._contexts.get(key)
        if known is None:
            known = self._contexts[key] = Context(ranges, blind=False)
        return known

    def of(self, node: Node, context: Context) -> Approximation:
        """Return the bounds of a number."""
        known = context.values.get(node)
        if known is None:
            inner = self.about(node, context)
            known = inner.values.get(node)
            if known is None:
                bounds = inner.ranges.get(node, (-math.inf, math.inf))
                known = inner.values[node] = self._made(node, inner, bounds).within(*bounds)
            context.values[node] = known
        return known

    def about(self, node: Node, context: Context) -> Context:
        """Return the context restricted to a node and its parts, on which its value depends."""
        mask = self._mask(node)
        said = {part: bounds for part, bounds in context.ranges.items() if mask >> part.order & 1}
        return context if len(said) == len(context.ranges) else self.context(said)

    def _mask(self, node: Node) -> int:
        """Return the node and all its parts, as bits by order of creation."""
        known = self._masks.get(node)
        if known is None:
            known = 1 << node.order
            for arg in node.args:
                known |= self._mask(arg)
            self._masks[node] = known
        return known

    def _made(self, node: Node, context: Context, bounds: tuple[float, float]) -> Approximation:
        args = node.args
        match node.op:
            case "const":
                return rounding.constant(node.data)
            case "col":
                return self._column(node)
            case "select":
                return self._choice(node, context, bounds)
            case "min" | "max":
                return self._extreme(node, context)
            case "min_of" | "max_of":
                inner = self.inside(node, context)
                return ANY if inner is None else self.of(args[2], inner)
            case "count":
                return Approximation(0.0, float(self._most(node)))
            case "sum":
                inner = self.inside(node, context)
                start = self.of(args[3], context)
                if inner is None:
                    return start
                return rounding.total(
                    start, self.of(args[2], inner), self._most(node), whole=node.kind == "int"
                )
        return self._operation(node, [self.of(arg, context) for arg in args], context, bounds)

    def _choice(self, node: Node, context: Context, bounds: tuple[float, float]) -> Approximation:
        """Return the bounds of a choice: of each side where it is taken and has a value within bounds."""
        found = []
        for arg, side in zip(node.args[1:], self.sides(node.args[0], context), strict=True):
            inner = side and self.narrow(arg, *bounds, side)
            if inner is not None:
                found.append(self.of(arg, inner))
        return rounding.either(*found) if len(found) == 2 else found[0] if found else ANY

    def _operation(
        self, node: Node, args: list[Approximation], context: Context, bounds: tuple[float, float]
    ) -> Approximation:
        match node.op:
            case "add" | "sub" | "mul":
                return self._ring(node, args)
            case "div":
                low, high = rounding.quotient(args[0].low, args[0].high, args[1].low, args[1].high)
                bounds = (max(low, bounds[0]), min(high, bounds[1]))
                return rounding.divide(args[0], args[1], bounds, self._nearest(node.args[1], context))
            case "sqrt":
                low, high = rounding.root_range(args[0])
                return rounding.square_root(args[0], (max(low, bounds[0]), min(high, bounds[1])))
            case "neg":
                return rounding.negate(args[0])
            case "abs":
                return rounding.absolute(args[0])
            case "tofloat":
                return rounding.to_float(args[0])
            case "sign" | "isign":
                return Approximation(-1.0, 1.0, 0.0, unit=True)
        row = NODES.get(node.op)
        if row is not None and row.kind in ("real", "power"):
            return rounding.apply(row, *self._defined(node, args, context))
        if row is not None and row.bounds is not None and node.kind == "int":
            return Approximation(*row.bounds(*((arg.low, arg.high) for arg in args)))
        return Approximation(node.low, node.high) if node.kind == "int" else ANY

    def _defined(self, node: Node, args: list[Approximation], context: Context) -> list[Approximation]:
        """Return a function's arguments where it is defined: no logarithm of 0, no power of 0 below 0.

        Only numbers that may be 0 were compared with it.
        """
        one = args[0]
        told = node.op == "log" or (node.op == "pow" and args[1].high < 0.0 and one.low >= 0.0)
        if not told or context.blind or one.low > 0.0 or node.args[0].low > 0.0:
            return args
        return [one.within(self.clear(one) or math.ulp(0.0), math.inf), *args[1:]]

    def _ring(self, node: Node, args: list[Approximation]) -> Approximation:
        one, other = args
        if node.op == "mul":
            result = rounding.multiply(one, other, square=node.args[0] is node.args[1])
        else:
            result = rounding.add(one, other if node.op == "add" else rounding.negate(other))
        if node.kind == "int":
            return Approximation(result.low, result.high)
        reach = self._apart(node) if node.op == "sub" else None
        if reach is not None and result.high > reach and one.is_exact and other.is_exact:
            return Approximation(-reach, reach, rounding.half_ulp(reach))
        return result

    def _apart(self, node: Node) -> float | None:
        """Return the largest distance of two vehicles along one axis, if the node is one."""
        left, right = node.args
        if left.op != "col" or right.op != "col" or left.data != right.data:
            return None
        relation, column = left.data
        if relation != VEHICLE or relation.fields[column] not in ("x", "y"):
            return None
        egos = sum(arg.args[0].op == "row" for arg in node.args)
        return up(self._radar * (2 - egos))

    def _column(self, node: Node) -> Approximation:
        relation, column = node.data
        place = column if len(relation.columns) > 1 else 0
        first, other = self._columns.get((relation.name, place), (ANY, ANY))
        index = node.args[0]
        if index.op == "row":
            return first
        return other if relation.first is not None and _is_other(index) else rounding.either(first, other)

    def _most(self, node: Node) -> int:
        relation = relation_of(node.args[0])
        if relation == VEHICLE:
            return self._rows + 1
        return self._rows if isinstance(relation, OpenRelation) else relation.capacity

    def _extreme(self, node: Node, context: Context) -> Approximation:
        """Return a minimum or maximum; a side with a large error where it is not taken does no harm."""
        least = node.op == "min"
        combine = rounding.least_of if least else rounding.greatest_of
        args = [self.of(arg, context) for arg in node.args]
        result = combine(*args)
        if result.error * _FINE <= self.margin or context.blind:
            return result
        for wild, tame in ((0, 1), (1, 0)):
            if args[wild].error > args[tame].error:
                error = self._where_taken(node.args[wild], args[tame], context, least=least)
                if error is not None and error < result.error:
                    return Approximation(result.low, result.high, max(error, args[tame].error))
        return result

    def _where_taken(self, wild: Node, tame: Approximation, context: Context, *, least: bool) -> float | None:
        """Return the error of a side where it may be the extreme, unless doubles see that it is not."""
        edge, sign = (tame.high, 1.0) if least else (tame.low, -1.0)
        end = sign * (self.of(wild, context).high if least else self.of(wild, context).low)
        if not math.isfinite(end) or not math.isfinite(edge):
            return None
        step = 1.0
        for _ in range(MOST_PIECES):
            near, far = sign * edge + step, sign * edge + STRIDE * step
            if near > end:
                break
            piece = self._narrow_either(wild, sign * near, sign * far, context)
            if piece is not None and self.of(wild, piece).error >= step:
                return None
            step *= STRIDE
        else:
            return None
        taken = self._narrow_either(wild, sign * -math.inf, edge + sign, context)
        return 0.0 if taken is None else self.of(wild, taken).error

    def _narrow_either(self, node: Node, low: float, high: float, context: Context) -> Context | None:
        return self.narrow(node, min(low, high), max(low, high), context)

    def clear(self, number: Approximation) -> float:
        """Return the least distance from 0 of a number that was compared with 0."""
        return 0.0 if number.is_exact else self.margin

    def may_vanish(self, divisor: Node, context: Context) -> bool:
        """Return whether a divisor counts as compared with 0: unless it is surely further away."""
        number = self.of(divisor, context)
        return is_checked_divisor(divisor) and not number.least > up(SMALLEST_DIVISOR + number.error)

    def _nearest(self, divisor: Node, context: Context) -> float:
        """Return the least distance of a divisor from 0: the margin, if it counts as compared with 0."""
        least = self.of(divisor, context).least
        return max(least, self.margin) if not context.blind and self.may_vanish(divisor, context) else least

    def sides(self, cond: Node, context: Context) -> tuple[Context | None, Context | None]:
        """Return the contexts where a condition holds, and where it does not."""
        return self.passed(cond, True, context), self.passed(cond, False, context)

    def passed(self, cond: Node, holds: bool, context: Context) -> Context | None:
        """Return the context after a condition had an outcome; None: it never has, clear of its limits."""
        if context.blind:
            return context
        if (cond, holds) not in context.passed:
            context.passed[cond, holds] = self._passed(cond, holds, context)
        return context.passed[cond, holds]

    def _passed(self, cond: Node, holds: bool, context: Context) -> Context | None:
        args = cond.args
        match cond.op:
            case "const":
                return context if cond.data is holds else None
            case "not":
                return self.passed(args[0], not holds, context)
            case "and" | "or":
                if (cond.op == "and") is holds:
                    inner: Context | None = context
                    for arg in args:
                        inner = inner and self.passed(arg, holds, inner)
                    return inner
            case "lt":
                below, above = args if holds else args[::-1]
                return self._ordered(below, above, context, strict=holds)
            case "eq" if holds and args[0].kind not in ("atom", "bool", "index"):
                one, other = (self.of(arg, context) for arg in args)
                low, high = max(one.low, other.low), min(one.high, other.high)
                narrowed = self.narrow(args[0], low, high, context)
                return narrowed and self.narrow(args[1], low, high, narrowed)
            case "within" if not holds and cond.data == SMALLEST_DIVISOR:
                if self.of(args[0], context).low >= 0.0:
                    return self.narrow(args[0], self._nearest(args[0], context), math.inf, context)
        return context

    def _ordered(self, low: Node, high: Node, context: Context, *, strict: bool) -> Context | None:
        """Return the context where one number is below another, by the margin unless both are exact."""
        below, above = self.of(low, context), self.of(high, context)
        exact = below.is_exact and above.is_exact
        room = 0.0 if exact else self.margin
        if exact and strict and low.kind == "int":
            room = 1.0
        inner = self.narrow(low, -math.inf, up(above.high - room), context)
        inner = inner and self.narrow(high, down(below.low + room), math.inf, inner)
        if inner is None or low.is_const or high.is_const:
            return inner
        apart = self._difference(high, low)
        inner = self.narrow(apart, room, math.inf, inner)
        return inner and self.narrow(self._difference(low, high), -math.inf, -room, inner)

    def _difference(self, one: Node, other: Node) -> Node:
        return self.pool.make("sub", one.kind, (one, other))

    def near(self, left: Node, right: Node, bounds: tuple[float, float], context: Context) -> Context | None:
        """Return the context where the difference of two numbers is within bounds."""
        low, high = bounds
        other = self.of(right, context)
        inner = self.narrow(left, down(other.low + low), up(other.high + high), context)
        if inner is None:
            return None
        one = self.of(left, inner)
        inner = self.narrow(right, down(one.low - high), up(one.high - low), inner)
        if left.is_const or right.is_const:
            return inner
        inner = inner and self.narrow(self._difference(left, right), low, high, inner)
        return inner and self.narrow(self._difference(right, left), -high, -low, inner)

    def inside(self, node: Node, context: Context) -> Context | None:
        """Return the context for a row that a quantifier counts; None: it counts none."""
        loop, cond = node.args[:2]
        inner = self.entered(loop, context)
        inner = inner and self.passed(cond, True, inner)
        if inner is not None and node.op in ("min_of", "max_of") and node in context.ranges:
            low, high = context.ranges[node]
            ends = (low, math.inf) if node.op == "min_of" else (-math.inf, high)
            return self.narrow(node.args[2], *ends, inner)
        return inner

    def entered(self, loop: Node, context: Context) -> Context | None:
        """Return the context in a loop: rows meet its conditions, and nothing is known from other loops."""
        if context.blind:
            return context
        kept = {node: bounds for node, bounds in context.ranges.items() if loop not in node.free}
        inner: Context | None = self.context(kept)
        rows = loop.args[0]
        while rows.op == "where" and inner is not None:
            rows, own, cond = rows.args
            inner = self.passed(self.pool.substitute(cond, {own: loop}), True, inner)
        return inner

    def narrow(self, node: Node, low: float, high: float, context: Context) -> Context | None:
        """Return the context in which a number is in an interval; None: it never is."""
        if context.blind:
            return context
        found = dict(context.ranges)
        if not self._narrow(node, low, high, context, found):
            return None
        return (
            context if len(found) == len(context.ranges) and found == context.ranges else self.context(found)
        )

    def _narrow(
        self, node: Node, low: float, high: float, context: Context, found: dict[Node, tuple[float, float]]
    ) -> bool:
        """Put the consequences for a number and its parts into `found`; False: it is never there."""
        known = self.of(node, context)
        least, most = found.get(node, (-math.inf, math.inf))
        least, most = max(least, known.low), min(most, known.high)
        if low <= least and high >= most:
            return True
        low, high = max(low, least), min(high, most)
        if low > high:
            return False
        if math.isinf(least) or math.isinf(most):
            gained = (low, high) != (least, most)
        else:
            gained = low > least + _GAIN * abs(least) or high < most - _GAIN * abs(most)
        if node.is_const or not gained:
            return True
        found[node] = (low, high)
        return all(
            self._narrow(arg, below, above, context, found)
            for arg, (below, above) in self._arguments(node, low, high, context)
        )

    def _arguments(
        self, node: Node, low: float, high: float, context: Context
    ) -> Iterator[tuple[Node, tuple[float, float]]]:
        """Yield the intervals of the parts of a number that follow from its value."""
        args = node.args
        values = [self.of(arg, context) for arg in args] if node.op in _INVERTED else []
        match node.op:
            case "neg":
                yield args[0], (-high, -low)
            case "tofloat":
                yield args[0], (low, high)
            case "add":
                for one, other in ((0, 1), (1, 0)):
                    yield args[one], (down(low - values[other].high), up(high - values[other].low))
            case "sub":
                yield args[0], (down(low + values[1].low), up(high + values[1].high))
                yield args[1], (down(values[0].low - high), up(values[0].high - low))
            case "mul" if args[0] is args[1]:
                root = up(math.sqrt(max(0.0, high)))
                positive = values[0].low >= 0.0 and low > 0.0
                yield args[0], (down(math.sqrt(low)) if positive else -root, root)
            case "mul":
                for one, other in ((0, 1), (1, 0)):
                    if values[other].least > 0.0 or low > 0.0 or high < 0.0:
                        yield args[one], rounding.quotient(low, high, values[other].low, values[other].high)
            case "div":
                yield args[0], rounding.product(low, high, values[1].low, values[1].high)
                if low > 0.0 or high < 0.0:
                    yield args[1], rounding.quotient(values[0].low, values[0].high, low, high)
            case "sqrt":
                yield args[0], (down(low * low) if low > 0.0 else 0.0, up(high * high))
            case "abs":
                positive, negative = values[0].low >= 0.0, values[0].high <= 0.0
                yield args[0], (low if positive else -high, -low if negative else high)
            case "min" | "max":
                yield from _of_extreme(node, values, low, high)
            case "select":
                yield from self._of_choice(node, low, high, context)

    def _of_choice(
        self, node: Node, low: float, high: float, context: Context
    ) -> Iterator[tuple[Node, tuple[float, float]]]:
        """Yield the intervals that follow if only one side of a choice is possible."""
        possible = []
        for arg, inner in zip(node.args[1:], self.sides(node.args[0], context), strict=True):
            value = None if inner is None else self.of(arg, inner)
            if value is not None and value.low <= high and value.high >= low:
                possible.append(arg)
        if len(possible) == 1:
            yield possible[0], (low, high)


_INVERTED: Final = frozenset({"add", "sub", "mul", "div", "abs", "min", "max"})


def _of_extreme(
    node: Node, values: list[Approximation], low: float, high: float
) -> Iterator[tuple[Node, tuple[float, float]]]:
    """Yield bounds on the sides of a minimum, and the value of the only side that can be it."""
    for one, other in ((0, 1), (1, 0)):
        if node.op == "min":
            yield node.args[one], (low, high if values[other].low > high else math.inf)
        else:
            yield node.args[one], (low if values[other].high < low else -math.inf, high)


def _is_other(index: Node) -> bool:
    """Return whether an index is surely a row after the first."""
    while index.op == "loop" or index.op in ("first", "argmin", "argmax"):
        index = index.args[0]
        while index.op == "where":
            index = index.args[0]
        if index.op == "others":
            return True
        if index.op == "facts":
            return False
    return False
