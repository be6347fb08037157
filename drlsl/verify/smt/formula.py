"""The back end for a solver: the answers of a lowered program over unknown scenes.

Every relation has a fixed number of rows, each with a condition under which it exists, so a quantifier over
rows is a finite conjunction or disjunction. Numbers are real: no operation rounds.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

from gmpy2 import mpq

from drlsl.logic.core import NODES, Operation
from drlsl.logic.terms import Atom
from drlsl.lowering.ir import LARGEST, Node, Relation
from drlsl.verify.row_memory import RowMemory
from drlsl.verify.smt.booleans import Bool
from drlsl.verify.smt.functions import bounds_of, domain_of
from drlsl.verify.smt.polynomials import Polynomial, Rational
from drlsl.verify.smt.values import Algebra, Value

Constant: TypeAlias = Atom | int
Finite: TypeAlias = dict[Constant, Bool]
"""The possible values of an atom or integer, each with its condition."""

Indices: TypeAlias = tuple[tuple[Bool, int], ...]
"""Row numbers, each with a condition; at most one condition holds, and without one the last row counts."""


_LARGEST_FLOAT: Final = mpq(sys.float_info.max)


class NotTranslatable(Exception):
    """An operation that has no form for the solver."""


@dataclass(frozen=True, slots=True)
class Row:
    """One row of a relation: the condition that it exists, and its columns."""

    present: Bool
    columns: tuple[Value | Finite, ...]


class Formula(RowMemory[Indices]):
    """Translates nodes, over the rows of one symbolic scene."""

    def __init__(self, algebra: Algebra, facts: Mapping[tuple[str, int], Sequence[Row]]) -> None:
        super().__init__()
        self.algebra = algebra
        self.booleans = algebra.booleans
        self._facts = facts

    def _relation(self, relation: Relation) -> Sequence[Row]:
        return self._facts[relation.name, relation.arity]

    def truth(self, node: Node) -> Bool:
        """Return the formula of a node of kind bool."""
        return self._once("truth", node, self._truth)

    def _truth(self, node: Node) -> Bool:
        booleans, args = self.booleans, node.args
        match node.op:
            case "const":
                return booleans.const(bool(node.data))
            case "not":
                return booleans.not_(self.truth(args[0]))
            case "and" | "or":
                return self._junction(node)
            case "any":
                return booleans.or_(cond for cond, _ in self._each(args[0], [args[1]], self._nothing))
            case "lt":
                return self.algebra.less(self.value(args[0]), self.value(args[1]))
            case "eq":
                return self._equal(*args)
            case "within":
                return self._within(node)
        raise NotTranslatable(f"a formula has no {node.op}")

    def _junction(self, node: Node) -> Bool:
        """Return a conjunction or disjunction; parts behind the deciding one are skipped."""
        dominant = self.booleans.const(node.op == "or")
        parts = []
        for arg in node.args:
            part = self.truth(arg)
            if part is dominant:
                return dominant
            parts.append(part)
        return self.booleans.and_(parts) if node.op == "and" else self.booleans.or_(parts)

    def _within(self, node: Node) -> Bool:
        """Return the condition that the value is in a band around 0.

        A band narrower than any difference of lengths detects a division by 0: no other number is that small.
        The widest detects numbers beyond every float; others are limits of generated code only, which are no
        errors.
        """
        (number,) = node.args
        if node.data < 1.0:
            return self.algebra.equal(self.value(number), self.algebra.zero)
        if node.data < LARGEST or number.kind == "int":
            return self.booleans.true
        row = NODES.get(number.op)
        if row is not None and row.kind in ("real", "power"):
            domain = domain_of(row, self._exponent(number))
            if domain is not None:
                return self._between(domain[0], self.value(number.args[0]), domain[1])
        return self._between(-_LARGEST_FLOAT, self.value(number), _LARGEST_FLOAT)

    def _exponent(self, function: Node) -> mpq | None:
        """Return the exponent of a power if it is constant."""
        if function.op != "pow":
            return None
        exponent = self.value(function.args[1])
        constant = exponent.constant if isinstance(exponent, Polynomial) else None
        return None if constant is None else mpq(constant)

    def _between(self, low: Rational | None, value: Value, high: Rational | None) -> Bool:
        """Return the condition that a value is within bounds."""
        algebra = self.algebra
        return self.booleans.and_(
            algebra.at_least(*pair)
            for bound, pair in (
                (low, (value, algebra.ring.const(low or 0))),
                (high, (algebra.ring.const(high or 0), value)),
            )
            if bound is not None
        )

    def _equal(self, left: Node, right: Node) -> Bool:
        if left.op == right.op == "col" and left.data == right.data and left.data[0].key == left.data[1]:
            return self._same_row(left.args[0], right.args[0])
        sides = (left, right)
        if left.kind == "atom" or (any(map(self._is_finite, sides)) and all(map(self._is_constant, sides))):
            one, other = self.finite(left), self.finite(right)
            return self.booleans.or_(
                self.booleans.and_((cond, other[constant]))
                for constant, cond in one.items()
                if constant in other
            )
        return self.algebra.equal(self.value(left), self.value(right))

    def _same_row(self, left: Node, right: Node) -> Bool:
        """Return the condition that two indices are one row: no two rows of a relation have the same key."""
        return self.booleans.or_(
            self.booleans.and_((cond, beside))
            for cond, place in self.index(left)
            for beside, other in self.index(right)
            if place == other
        )

    def _is_finite(self, node: Node) -> bool:
        """Return whether a number is a column of integers, or a choice of such."""
        if node.op == "select":
            return any(map(self._is_finite, node.args[1:]))
        return node.op == "col" and node.kind == "int"

    def _is_constant(self, node: Node) -> bool:
        """Return whether a number is a column of integers, a constant or a choice of such, not computed."""
        if node.op == "select":
            return all(map(self._is_constant, node.args[1:]))
        return node.op == "const" or (node.op == "col" and node.kind == "int")

    def finite(self, node: Node) -> Finite:
        """Return the possible constants of an atom or integer node."""
        return self._once("finite", node, self._finite)

    def _finite(self, node: Node) -> Finite:
        if node.op == "const":
            return {node.data: self.booleans.true}
        if node.op == "col":
            columns = self._columns(node)
            if all(isinstance(column, dict) for _, column in columns):
                return self._merge((cond, column) for cond, column in columns if isinstance(column, dict))
        if node.op == "select":
            cond = self.truth(node.args[0])
            sides = ((cond, node.args[1]), (self.booleans.not_(cond), node.args[2]))
            return self._merge(
                (own, self.finite(side)) for own, side in sides if own is not self.booleans.false
            )
        raise NotTranslatable(f"{node.op} is compared with a column of {node.kind}s")

    def _merge(self, parts: Iterable[tuple[Bool, Finite]]) -> Finite:
        merged: dict[Constant, list[Bool]] = {}
        for cond, finite in parts:
            for constant, own in finite.items():
                merged.setdefault(constant, []).append(self.booleans.and_((cond, own)))
        joined = {constant: self.booleans.or_(conds) for constant, conds in merged.items()}
        return {constant: cond for constant, cond in joined.items() if cond is not self.booleans.false}

    def _columns(self, node: Node) -> list[tuple[Bool, Value | Finite]]:
        """Return the possible values of a column node, with their conditions."""
        relation, column = node.data
        rows = self._relation(relation)
        return [(cond, rows[place].columns[column]) for cond, place in self.index(node.args[0])]

    def index(self, node: Node) -> Indices:
        """Return the possible rows of an index node."""
        if node.op == "loop":
            return self._loops[node]
        return self._once("index", node, self._index)

    def _index(self, node: Node) -> Indices:
        booleans = self.booleans
        if node.op == "row":
            return ((booleans.true, 0),)
        if node.op == "select":
            cond = self.truth(node.args[0])
            sides = ((cond, node.args[1]), (booleans.not_(cond), node.args[2]))
            return tuple(
                (both, place)
                for own, side in sides
                if own is not booleans.false
                for beside, place in self.index(side)
                if (both := booleans.and_((own, beside))) is not booleans.false
            )
        if node.op == "first":
            conds = [(cond, place) for cond, place in self._each(node.args[0], [node.args[1]], self._place)]
            return self._firsts(conds)
        if node.op in ("argmin", "argmax"):
            return self._best(node)
        raise NotTranslatable(f"a formula has no {node.op}")

    def _place(self, loop: Node) -> int:
        ((_, place),) = self._loops[loop]
        return place

    def _nothing(self, _loop: Node) -> None:
        return None

    def _firsts(self, conds: Sequence[tuple[Bool, int]]) -> Indices:
        """Return the first row whose condition holds."""
        found: list[tuple[Bool, int]] = []
        earlier: list[Bool] = []
        for cond, place in conds:
            own = self.booleans.and_([cond, *map(self.booleans.not_, earlier)])
            if own is not self.booleans.false:
                found.append((own, place))
            earlier.append(cond)
        return tuple(found) or ((self.booleans.true, 0),)

    def _best(self, node: Node) -> Indices:
        """Return the first row of those with the least or greatest value."""
        loop, cond, value = node.args
        rows = self._each(loop, [cond], lambda own: (self._place(own), self.value(value)))
        booleans, algebra = self.booleans, self.algebra
        result = []
        for number, (guard, (place, own)) in enumerate(rows):
            ahead = []
            for other, (beside, (_, rival)) in enumerate(rows):
                if other == number:
                    continue
                low, high = (own, rival) if node.op == "argmin" else (rival, own)
                beats = algebra.less(low, high) if other < number else algebra.at_least(high, low)
                ahead.append(booleans.implies(beside, beats))
            result.append((booleans.and_([guard, *ahead]), place))
        kept = tuple((guard, place) for guard, place in result if guard is not booleans.false)
        return kept or ((booleans.true, 0),)

    def _each(self, loop: Node, conds: Sequence[Node], make: Callable[[Node], Any]) -> list[tuple[Bool, Any]]:
        """Return for every row of the loop the condition that it counts, and the result of `make`."""
        result = []
        outer = self._loops.get(loop)
        for present, place in self._rows(loop.args[0]):
            self._loops[loop] = ((self.booleans.true, place),)
            cond = self.booleans.and_([present, *map(self.truth, conds)])
            if cond is not self.booleans.false:
                result.append((cond, make(loop)))
        self._leave(loop, outer)
        return result

    def _rows(self, rows: Node) -> list[tuple[Bool, int]]:
        """Return the rows of a rows node, with the conditions that they are in it."""
        return self._once("rows", rows, self._rows_of)

    def _rows_of(self, rows: Node) -> list[tuple[Bool, int]]:
        if rows.op == "where":
            inner, loop, cond = rows.args
            assert loop.args[0] is inner
            return self._each(loop, [cond], self._place)
        if rows.op in ("facts", "others"):
            start = int(rows.op == "others")
            found = list(enumerate(self._relation(rows.data)))[start:]
            return [(row.present, place) for place, row in found if row.present is not self.booleans.false]
        raise NotTranslatable(f"a formula has no {rows.op}")

    def value(self, node: Node) -> Value:
        """Return the value of a number node."""
        return self._once("value", node, self._value)

    def _value(self, node: Node) -> Value:
        algebra, args = self.algebra, node.args
        match node.op:
            case "const":
                return algebra.number(node.data)
            case "col":
                return self._choices([(cond, self._number(column)) for cond, column in self._columns(node)])
            case "select":
                cond = self.truth(args[0])
                if cond is self.booleans.true or cond is self.booleans.false:
                    return self.value(args[1 if cond is self.booleans.true else 2])
                return algebra.choose(cond, self.value(args[1]), self.value(args[2]))
            case "min_of" | "max_of":
                members = self._each(args[0], [args[1]], lambda _: self.value(args[2]))
                return algebra.extreme(node.op == "min_of", members)
            case "count":
                total: Value = algebra.zero
                for cond, _ in self._each(args[0], [args[1]], self._nothing):
                    total = algebra.add(total, algebra.indicator(cond))
                return total
            case "sum":
                return self._sum(node)
        return self._operation(node, [self.value(arg) for arg in args])

    def _number(self, column: Value | Finite) -> Value:
        if not isinstance(column, dict):
            return column
        parts = []
        for constant, cond in column.items():
            if not isinstance(constant, int):
                raise NotTranslatable("arithmetic on an atom")
            parts.append((cond, self.algebra.number(constant)))
        return self._choices(parts)

    def _choices(self, parts: Sequence[tuple[Bool, Value]]) -> Value:
        result = parts[-1][1]
        for cond, value in reversed(parts[:-1]):
            result = self.algebra.choose(cond, value, result)
        return result

    def _sum(self, node: Node) -> Value:
        loop, cond, value, start = node.args
        total = self.value(start)
        for own, addend in self._each(loop, [cond], lambda _: self.value(value)):
            total = self.algebra.add(total, self.algebra.choose(own, addend, self.algebra.zero))
        return total

    def _operation(self, node: Node, args: Sequence[Value]) -> Value:
        algebra = self.algebra
        true = self.booleans.true
        match node.op:
            case "add":
                return algebra.add(*args)
            case "sub":
                return algebra.subtract(*args)
            case "mul":
                return algebra.multiply(*args)
            case "div":
                return algebra.divide(*args)
            case "neg":
                return algebra.negate(args[0])
            case "abs":
                return algebra.extreme(False, [(true, args[0]), (true, algebra.negate(args[0]))])
            case "min" | "max":
                return algebra.extreme(node.op == "min", [(true, arg) for arg in args])
            case "sqrt":
                return algebra.sqrt(args[0])
            case "sign" | "isign":
                below = algebra.choose(algebra.less(args[0], algebra.zero), algebra.number(-1), algebra.zero)
                return algebra.choose(algebra.less(algebra.zero, args[0]), algebra.one, below)
            case "tofloat":
                return args[0]
            case op if op in NODES:
                return self._function(NODES[op], node, args)
        raise NotTranslatable(f"a formula has no {node.op}")

    def _function(self, row: Operation, node: Node, args: Sequence[Value]) -> Value:
        """Return a function: a power by arithmetic if possible, else bounded.

        Nothing else is assumed about it: proofs stay valid, and refutations are replayed.
        """
        algebra, exponent = self.algebra, self._exponent(node)
        power = None if exponent is None else algebra.power(args[0], exponent)
        if power is not None:
            return power
        return algebra.apply(row.node, args, bounds_of(row, algebra.interval(args[0]), exponent))
