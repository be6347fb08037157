"""The truth of a lowered condition in one scene, in exact arithmetic, and where floats differ.

Numbers are rational, or enclosed between two rationals that get closer with every try: roots and exponentials
need that. What the enclosures cannot decide within `_MOST_BITS` is left open.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Final, Generic, TypeAlias, TypeVar

from drlsl.logic.core import NODES
from drlsl.logic.terms import Atom
from drlsl.lowering.ir import SMALLEST_DIVISOR, Node, reach
from drlsl.verify.attack.enclosures import ANY, NO_NUMBER, Enclosure, hull, operation, point
from drlsl.verify.attack.sampled_facts import ExactFacts
from drlsl.verify.row_memory import RowMemory
from drlsl.verify.three_values import Truth, all_of, any_of, compound

N = TypeVar("N")
Place: TypeAlias = tuple[Node, tuple[int, ...]]
"""A comparison, and the current rows of the loops around it."""

_BITS: Final = (80, 200, 500, 1200)
_MOST_BITS: Final = _BITS[-1]


class CannotJudge(Exception):
    """The enclosures are too wide, with any number of digits."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """The truth of a condition in exact arithmetic, None if unknown.

    `amount` is the exact distance from its limit of the comparison that floats decide differently; None if
    there is none, or it is unknown.
    """

    holds: bool | None
    amount: Fraction | None = None


def judge(node: Node, exact: ExactFacts, floats: ExactFacts) -> Verdict:
    """Return whether `node` holds in a scene, by its facts in rational numbers, and the error of floats."""
    for bits in _BITS:
        judged = _Exact(exact, bits)
        try:
            holds = judged.truth(node)
        except CannotJudge:
            continue
        if holds is not None:
            return Verdict(holds, _amount(node, judged, floats))
    return Verdict(None)


def _amount(node: Node, judged: _Exact, facts: ExactFacts) -> Fraction | None:
    """Return the greatest distance of a comparison that floats decide differently, innermost ones only."""
    rounding = _Floats(facts)
    if rounding.truth(node) is judged.truth(node):
        return None
    wrong = {
        place
        for place, truth in judged.comparisons.items()
        if truth is not None and rounding.comparisons.get(place, truth) is not truth
    }
    nodes = {compared for compared, _ in wrong}
    first = [place for place in wrong if not any(inner in nodes for inner in reach(place[0].args))]
    return max((judged.distances[place] for place in first if place in judged.distances), default=None)


class _Evaluation(RowMemory[int], ABC, Generic[N]):
    """Evaluates nodes over the rows of one scene; `comparisons` has the outcome of each comparison."""

    def __init__(self, facts: ExactFacts) -> None:
        super().__init__()
        self._facts = facts
        self.comparisons: dict[Place, Truth] = {}

    @abstractmethod
    def _number(self, value: Any) -> N:
        """Return a constant, or a number of the facts."""

    @abstractmethod
    def _operation(self, node: Node, args: Sequence[N]) -> N:
        """Return an operation of arithmetic."""

    @abstractmethod
    def _less(self, place: Place, left: N, right: N) -> Truth:
        """Return the truth of left < right."""

    @abstractmethod
    def _equal(self, place: Place, left: N, right: N) -> Truth:
        """Return the truth of left = right."""

    @abstractmethod
    def _within(self, place: Place, value: N, bound: float) -> Truth:
        """Return the truth of: the value is at most `bound` away from 0."""

    @abstractmethod
    def _either(self, one: N, other: N) -> N:
        """Return a number that is one of two."""

    def _place(self, node: Node) -> Place:
        return node, tuple([self._loops[loop] for loop in node.loops])

    def truth(self, node: Node) -> Truth:
        """Return the truth of a node of kind bool."""
        return self._once("truth", node, self._truth)

    def _truth(self, node: Node) -> Truth:
        match node.op:
            case "const" | "not" | "and" | "or":
                return compound(node, self.truth)
            case "any":
                return any_of([truth for truth, _ in self._visited(node)])
            case "lt" | "eq" | "within":
                place = self._place(node)
                result = self.comparisons[place] = self._comparison(node, place)
                return result
        raise AssertionError(f"no condition: {node.op}")

    def _comparison(self, node: Node, place: Place) -> Truth:
        if node.args[0].kind == "atom":
            return bool(self.atom(node.args[0]) == self.atom(node.args[1]))
        values = [self.value(arg) for arg in node.args]
        if node.op == "within":
            return self._within(place, values[0], node.data)
        return self._less(place, *values) if node.op == "lt" else self._equal(place, *values)

    def _sure(self, node: Node) -> bool:
        """Return the truth of a condition that decides a choice of row."""
        truth = self.truth(node)
        if truth is None:
            raise CannotJudge
        return truth

    def _visited(self, node: Node) -> list[tuple[Truth, int]]:
        """Return the rows that a quantifier visits, each with whether it counts."""
        loop, cond = node.args[:2]
        return self._met(self._rows(loop.args[0]), loop, cond)

    def _met(self, rows: list[tuple[Truth, int]], loop: Node, cond: Node) -> list[tuple[Truth, int]]:
        """Return rows with whether they exist and meet a condition."""
        outer = self._loops.get(loop)
        result = []
        for there, place in rows:
            self._loops[loop] = place
            result.append((all_of([there, self.truth(cond)]), place))
        self._leave(loop, outer)
        return result

    def _values(self, loop: Node, value: Node, places: Sequence[int]) -> list[N]:
        """Return a number for each of these rows."""
        outer = self._loops.get(loop)
        values = []
        for place in places:
            self._loops[loop] = place
            values.append(self.value(value))
        self._leave(loop, outer)
        return values

    def _rows(self, rows: Node) -> list[tuple[Truth, int]]:
        if rows.op == "where":
            inner, loop, cond = rows.args
            return self._met(self._rows(inner), loop, cond)
        relation = rows.data
        count = len(self._facts[relation.name, relation.arity])
        return [(True, place) for place in range(int(rows.op == "others"), count)]

    def index(self, node: Node) -> int:
        """Return the row that an index node stands for."""
        if node.op == "loop":
            return self._loops[node]
        return self._once("index", node, self._index)

    def _index(self, node: Node) -> int:
        if node.op == "row":
            return 0
        if node.op == "select":
            return self.index(node.args[1 if self._sure(node.args[0]) else 2])
        visited = self._visited(node)
        if any(truth is None for truth, _ in visited):
            raise CannotJudge
        places = [place for truth, place in visited if truth]
        if not places:
            return 0
        return places[0] if node.op == "first" else self._best(node, places)

    def _best(self, node: Node, places: Sequence[int]) -> int:
        loop, value = node.args[0], node.args[2]
        best = places[0]
        for rival in places[1:]:
            values = self._values(loop, value, (rival, best))
            if node.op == "argmax":
                values.reverse()
            where = (node, (rival, best, *self._place(node)[1]))
            beats = self.comparisons[where] = self._less(where, *values)
            if beats is None:
                raise CannotJudge
            best = rival if beats else best
        return best

    def atom(self, node: Node) -> Atom:
        """Return the atom of a node."""
        if node.op == "const":
            constant: Atom = node.data
            return constant
        if node.op == "select":
            return self.atom(node.args[1 if self._sure(node.args[0]) else 2])
        found: Atom = self._cell(node)
        return found

    def _cell(self, node: Node) -> Any:
        relation, column = node.data
        return self._facts[relation.name, relation.arity][self.index(node.args[0])][column]

    def value(self, node: Node) -> N:
        """Return the number of a node."""
        return self._once("value", node, self._value)

    def _value(self, node: Node) -> N:
        match node.op:
            case "const":
                return self._number(node.data)
            case "col":
                return self._number(self._cell(node))
            case "select":
                truth = self.truth(node.args[0])
                if truth is None:
                    return self._either(self.value(node.args[1]), self.value(node.args[2]))
                return self.value(node.args[1 if truth else 2])
            case "count" | "sum" | "min_of" | "max_of":
                return self._gathered(node)
        return self._operation(node, [self.value(arg) for arg in node.args])

    def _gathered(self, node: Node) -> N:
        """Return a number aggregated over all rows."""
        visited = self._visited(node)
        if any(truth is None for truth, _ in visited):
            raise CannotJudge
        places = [place for truth, place in visited if truth]
        if node.op == "count":
            return self._number(len(places))
        values = self._values(node.args[0], node.args[2], places)
        if node.op == "sum":
            return self._joined("add", [self.value(node.args[3]), *values])
        return self._joined(node.op[:3], values) if values else self._number(0)

    @abstractmethod
    def _joined(self, op: str, values: Sequence[N]) -> N:
        """Return the sum of numbers, or the least or greatest of them."""


class _Exact(_Evaluation[Enclosure]):
    """Evaluation in enclosures; `distances` are those of the two sides of comparisons."""

    def __init__(self, facts: ExactFacts, bits: int) -> None:
        super().__init__(facts)
        self._bits = bits
        self.distances: dict[Place, Fraction] = {}

    def _number(self, value: Any) -> Enclosure:
        # a float of the program is the decimal fraction that it prints as, like in `Algebra.number`
        return point(Fraction(repr(value)) if isinstance(value, float) else Fraction(value))

    def _operation(self, node: Node, args: Sequence[Enclosure]) -> Enclosure:
        return operation(NODES[node.op], args, self._bits)

    def _joined(self, op: str, values: Sequence[Enclosure]) -> Enclosure:
        result = values[0]
        for value in values[1:]:
            result = operation(NODES[op], (result, value), self._bits)
        return result

    def _either(self, one: Enclosure, other: Enclosure) -> Enclosure:
        return hull(one, other)

    def _measured(self, place: Place, left: Enclosure, right: Enclosure) -> Truth:
        """Record the distance of two numbers; False if one of them is undefined, None if it may be."""
        if left is NO_NUMBER or right is NO_NUMBER:
            return False
        if left is ANY or right is ANY:
            return None
        self.distances[place] = max(left.high - right.low, right.high - left.low)
        return True

    def _less(self, place: Place, left: Enclosure, right: Enclosure) -> Truth:
        measured = self._measured(place, left, right)
        if not measured or left.high < right.low:
            return measured
        return False if left.low >= right.high else None

    def _equal(self, place: Place, left: Enclosure, right: Enclosure) -> Truth:
        measured = self._measured(place, left, right)
        if not measured or left.low == left.high == right.low == right.high:
            return measured
        return False if left.high < right.low or right.high < left.low else None

    def _within(self, place: Place, value: Enclosure, bound: float) -> Truth:
        # a real number can be divided by anything but 0: only floats overflow
        limit = point(Fraction(0 if bound == SMALLEST_DIVISOR else bound))
        size = operation(NODES["abs"], (value,), self._bits)
        measured = self._measured(place, size, limit)
        if not measured or size.high <= limit.low:
            return measured
        return False if size.low > limit.high else None


class _Floats(_Evaluation[Any]):
    """Evaluation in floats, as every tier computes."""

    def _number(self, value: Any) -> Any:
        return value

    def _operation(self, node: Node, args: Sequence[Any]) -> Any:
        try:
            return NODES[node.op].compute(*args)
        except OverflowError:  # of an integer that no float can hold
            return math.nan

    def _joined(self, op: str, values: Sequence[Any]) -> Any:
        result = values[0]
        for value in values[1:]:
            result = NODES[op].compute(result, value)
        return result

    def _either(self, one: Any, other: Any) -> Any:
        raise AssertionError("floats are always judged")

    def _less(self, place: Place, left: Any, right: Any) -> Truth:
        return bool(left < right)

    def _equal(self, place: Place, left: Any, right: Any) -> Truth:
        return bool(left == right)

    def _within(self, place: Place, value: Any, bound: float) -> Truth:
        return bool(abs(value) <= bound)
