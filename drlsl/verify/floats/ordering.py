"""Comparisons that doubles decide by order alone: rounding to nearest never reverses two numbers."""

from __future__ import annotations

from drlsl.logic.core import NODES
from drlsl.lowering.ir import Node
from drlsl.verify.floats.intervals import Values
from drlsl.verify.floats.rounding import down, up
from drlsl.verify.three_values import Truth, compound


class Order:
    """The comparisons with the same outcome in reals and doubles, whatever was rounded before."""

    def __init__(self, values: Values) -> None:
        self._values = values
        self._known: dict[tuple[Node, Node], bool] = {}
        self._settled: dict[Node, Truth] = {}

    def settled(self, node: Node) -> Truth:
        """Return the truth of a condition, in doubles, too, if it is always the same."""
        if node not in self._settled:
            self._settled[node] = self._truth(node)
        return self._settled[node]

    def _truth(self, node: Node) -> Truth:
        match node.op:
            case "const" | "not" | "and" | "or":
                return compound(node, self.settled)
            case "any":
                return False if self.settled(node.args[1]) is False else None
            case "lt":
                if self.at_most(node.args[1], node.args[0]):
                    return False
                low, high = (self._ends(arg) for arg in node.args)
                return True if low[1] < high[0] else None
            case "within" if node.data > 1.0:
                least, most = self._ends(node.args[0])
                return True if max(abs(least), abs(most)) < node.data else None
            case "within":
                least, most = self._ends(node.args[0])
                return False if least > node.data or most < -node.data else None
        return None

    def _ends(self, node: Node) -> tuple[float, float]:
        """Return bounds of a double, whatever comparisons were decided on the way."""
        known = self._values.of(node, self._values.blind)
        return down(known.low - known.error), up(known.high + known.error)

    def at_most(self, one: Node, other: Node) -> bool:
        """Return whether the double of one node is never above that of another: rounding keeps order."""
        if one is other:
            return True
        if (one, other) not in self._known:
            self._known[one, other] = False
            self._known[one, other] = self._at_most(one, other)
        return self._known[one, other]

    def _at_most(self, one: Node, other: Node) -> bool:
        if one.kind == "atom" or self._ends(one)[1] <= self._ends(other)[0]:
            return one.kind != "atom"
        if one.op in ("max", "select"):
            return all(self.at_most(arg, other) for arg in one.args[one.op == "select" :])
        if other.op in ("min", "select"):
            return all(self.at_most(one, arg) for arg in other.args[other.op == "select" :])
        if one.op == "min" and any(self.at_most(arg, other) for arg in one.args):
            return True
        if other.op == "max" and any(self.at_most(one, arg) for arg in other.args):
            return True
        return one.op == other.op and self._termwise(one, other)

    def _termwise(self, one: Node, other: Node) -> bool:
        """Return whether both are the same operation with arguments in the right order."""
        left, right = one.args, other.args
        match one.op:
            case "add" if self.at_most(left[0], right[1]) and self.at_most(left[1], right[0]):
                return True
            case "div":
                return left[1] is right[1] and self._scaled(left[1], left[0], right[0])
            case "mul":
                return any(
                    a is c and self._scaled(a, b, d)
                    for a, b in (left, left[::-1])
                    for c, d in (right, right[::-1])
                )
        grows = NODES[one.op].grows if one.op in NODES else ()
        return bool(grows) and all(
            self.at_most(*((a, b) if sign > 0 else (b, a)))
            for sign, a, b in zip(grows, left, right, strict=True)
        )

    def _scaled(self, factor: Node, one: Node, other: Node) -> bool:
        """Return whether a common factor that has a sign keeps two numbers in order."""
        low, high = self._ends(factor)
        return (low >= 0.0 and self.at_most(one, other)) or (high <= 0.0 and self.at_most(other, one))
