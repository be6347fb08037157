"""Truth values over linear and polynomial comparisons: a graph in which equal formulas are one object.

The graph is Python's own, so that a formula of ten thousand parts is built in milliseconds and most of it is
gone before a solver sees it; `drlsl.verify.smt.solver` hands on what is left.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fractions import Fraction
from typing import Any, Final, Literal, TypeAlias

from drlsl.verify.smt.polynomials import Monomial, evaluate

Op: TypeAlias = Literal["true", "false", "flag", "above", "atleast", "zero", "not", "and", "or"]


class Bool:
    """A truth value.

    A `flag` is a free truth value with a name. `above`, `atleast` and `zero` say of a polynomial, in `data`,
    that it is > 0, >= 0 or = 0. `number` tells formulas apart and orders them by their making.
    """

    __slots__ = ("args", "data", "number", "op")

    def __init__(self, op: Op, args: tuple[Bool, ...], data: Any, number: int) -> None:
        self.op = op
        self.args = args
        self.data = data
        self.number = number

    def __repr__(self) -> str:
        if self.op in ("and", "or", "not"):
            return f"{self.op}({', '.join(map(repr, self.args))})"
        return self.op if self.data is None else f"{self.op}({self.data!r})"


class Booleans:
    """Makes truth values, each only once."""

    def __init__(self) -> None:
        self._made: dict[Any, Bool] = {}
        self.true: Final = self._make("true")
        self.false: Final = self._make("false")

    def _make(self, op: Op, args: tuple[Bool, ...] = (), data: Any = None) -> Bool:
        key = (op, data, *(arg.number for arg in args))
        known = self._made.get(key)
        if known is None:
            known = self._made[key] = Bool(op, args, data, len(self._made))
        return known

    def const(self, value: bool) -> Bool:
        """Return true or false."""
        return self.true if value else self.false

    def flag(self, name: str) -> Bool:
        """Return a free truth value."""
        return self._make("flag", (), name)

    def comparison(self, op: Op, polynomial: Any) -> Bool:
        """Return the comparison of a polynomial, normalised by its maker: `above`, `atleast` or `zero`."""
        return self._make(op, (), polynomial)

    def not_(self, one: Bool) -> Bool:
        """Return the negation."""
        if one is self.true or one is self.false:
            return self.const(one is self.false)
        return one.args[0] if one.op == "not" else self._make("not", (one,))

    def and_(self, parts: Iterable[Bool]) -> Bool:
        """Return the conjunction."""
        return self._junction("and", parts, self.true, self.false)

    def or_(self, parts: Iterable[Bool]) -> Bool:
        """Return the disjunction."""
        return self._junction("or", parts, self.false, self.true)

    def _junction(self, op: Op, parts: Iterable[Bool], neutral: Bool, dominant: Bool) -> Bool:
        kept: dict[int, Bool] = {}
        for part in parts:
            for one in part.args if part.op == op else (part,):
                if one is dominant:
                    return dominant
                if one is not neutral:
                    kept[one.number] = one
        for one in kept.values():
            if one.op == "not" and one.args[0].number in kept:
                return dominant
        if len(kept) < 2:
            return next(iter(kept.values()), neutral)
        return self._make(op, tuple(kept[number] for number in sorted(kept)))

    def implies(self, condition: Bool, then: Bool) -> Bool:
        """Return the implication."""
        return self.or_((self.not_(condition), then))

    def choose(self, condition: Bool, then: Bool, els: Bool) -> Bool:
        """Return `then` if the condition holds, else `els`."""
        if condition is self.true or then is els:
            return then
        if condition is self.false:
            return els
        return self.or_((self.and_((condition, then)), self.and_((self.not_(condition), els))))


def leaves(roots: Iterable[Bool]) -> dict[Bool, None]:
    """Return the flags and comparisons of formulas."""
    found: dict[Bool, None] = {}
    seen: set[int] = set()
    stack = list(roots)
    while stack:
        one = stack.pop()
        if one.number in seen:
            continue
        seen.add(one.number)
        if one.op in ("and", "or", "not"):
            stack.extend(one.args)
        elif one.op not in ("true", "false"):
            found[one] = None
    return found


def holds(
    truth: Bool,
    numbers: Mapping[int, Fraction],
    flags: Mapping[str, bool],
    products: Mapping[Monomial, Fraction] | None = None,
) -> bool:
    """Return whether a formula is true for these numbers; `products` may be numbers of their own."""
    if truth.op in ("true", "false"):
        return truth.op == "true"
    if truth.op == "not":
        return not holds(truth.args[0], numbers, flags, products)
    if truth.op in ("and", "or"):
        parts = (holds(arg, numbers, flags, products) for arg in truth.args)
        return all(parts) if truth.op == "and" else any(parts)
    if truth.op == "flag":
        return flags[truth.data]
    value = evaluate(truth.data, numbers, products)
    return value == 0 if truth.op == "zero" else value > 0 if truth.op == "above" else value >= 0
