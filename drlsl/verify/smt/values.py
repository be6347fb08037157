"""Arithmetic on unknown values, and comparisons of them in a form that a solver finds easy.

A value is a polynomial, a choice between two values, or the least or greatest of some. Comparisons are
pushed through choices and extremes down to polynomials, divisions are cleared and single square roots
squared, so that the signs of polynomials remain. Only the product or root of a choice or extreme, or the sum
of two extremes, makes it an unknown of its own, with its definition beside it.

Each of these parts pays: without it, properties are no longer proved (docs/verify.md, How it works).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Final, TypeAlias

from gmpy2 import mpq

from drlsl.verify.ranges import decimal
from drlsl.verify.smt.booleans import Bool, Booleans, leaves
from drlsl.verify.smt.polynomials import Interval, Monomial, Polynomial, Rational, Ring

_MOST_LEAVES: Final = 64
"""Number of leaves above which the values in a sum or product become unknowns."""

_MOST_MULTIPLICATIONS: Final = 16
"""Largest exponent of a power that is written as a product."""

_DENOMINATOR: Final = 10**12
"""Bounds on roots are rounded outward to fractions of this."""


class Choice:
    """`then` if `cond` holds, else `els`."""

    __slots__ = ("cond", "els", "number", "size", "then")

    def __init__(self, cond: Bool, then: Value, els: Value, number: int) -> None:
        self.cond = cond
        self.then = then
        self.els = els
        self.number = number
        self.size = size(then) + size(els)


class Extreme:
    """The least or greatest of the values whose conditions hold; an arbitrary number if none does."""

    __slots__ = ("least", "members", "number", "size")

    def __init__(self, least: bool, members: tuple[tuple[Bool, Value], ...], number: int) -> None:
        self.least = least
        self.members = members
        self.number = number
        self.size = sum(size(value) for _, value in members)


Value: TypeAlias = "Polynomial | Choice | Extreme"
_Key: TypeAlias = "tuple[type[object], int]"


def size(value: Value) -> int:
    """Return the number of polynomials in a value."""
    return 1 if isinstance(value, Polynomial) else value.size


def key(value: Value) -> _Key:
    """Return a key that identifies a value."""
    return (type(value), value.number)


class Algebra:
    """Makes values and compares them.

    `definitions` holds, by the number of an unknown, the conditions that define it. If it `clears`, no
    comparison is left with a division or a single root in it; else they are unchanged, and comparisons of the
    same values stay equal; `lemmas` then has, by comparison, the implications to others.
    """

    def __init__(self, *, clears: bool = True) -> None:
        self.clears = clears
        self.booleans: Final = Booleans()
        self.ring: Final = Ring()
        self.definitions: Final[dict[int, list[Bool]]] = {}
        self.lemmas: Final[dict[Bool, list[Bool]]] = {}
        self._assumed: dict[Bool, Bool] = {}
        self.zero: Final = self.ring.const(0)
        self.one: Final = self.ring.const(1)
        self._made: dict[object, Value] = {}
        self._unknowns: dict[object, Polynomial] = {}
        self._less: dict[tuple[_Key, _Key], Bool] = {}
        self._above: dict[int, Bool] = {}
        self._intervals: dict[_Key, Interval] = {}

    def number(self, value: float) -> Polynomial:
        """Return a constant; a float stands for the decimal fraction that it prints as."""
        return self.ring.const(decimal(value))

    def assume(self, truth: Bool) -> None:
        """Record that a comparison, or the negation of one, is true from now on."""
        if truth.op == "not":
            self._assumed[truth.args[0]] = self.booleans.false
        elif truth is not self.booleans.true:
            self._assumed[truth] = self.booleans.true
        self._above.clear()
        self._less.clear()

    def choose(self, cond: Bool, then: Value, els: Value) -> Value:
        """Return `then` if `cond` holds, else `els`."""
        if cond is self.booleans.true or then is els:
            return then
        if cond is self.booleans.false:
            return els
        if cond.op == "not":
            return self.choose(cond.args[0], els, then)
        made = ("choice", cond.number, key(then), key(els))
        return self._made.setdefault(made, Choice(cond, then, els, len(self._made)))

    def extreme(self, least: bool, members: Iterable[tuple[Bool, Value]]) -> Value:
        """Return the least or greatest of the values whose conditions hold."""
        false = self.booleans.false
        distinct = {
            (guard.number, key(value)): (guard, value) for guard, value in members if guard is not false
        }
        order = sorted(distinct, key=lambda place: (place[1][0].__name__, place[1][1], place[0]))
        kept = [distinct[place] for place in order]
        kept = self._undominated(least, kept)
        if not kept:
            return self.zero
        if len(kept) == 1:
            return kept[0][1]
        made = (least, *((guard.number, key(value)) for guard, value in kept))
        return self._made.setdefault(made, Extreme(least, tuple(kept), len(self._made)))

    def _undominated(self, least: bool, members: list[tuple[Bool, Value]]) -> list[tuple[Bool, Value]]:
        """Return the members that can be the extreme, given those that always exist."""
        always = [value for guard, value in members if guard is self.booleans.true]
        for best in always:
            members = [
                (guard, value)
                for guard, value in members
                if value is best or not self._never_better(least, value, best)
            ]
        return members

    def _never_better(self, least: bool, value: Value, best: Value) -> bool:
        if not isinstance(value, Polynomial) or not isinstance(best, Polynomial):
            return False
        difference = self.ring.subtract(value, best) if least else self.ring.subtract(best, value)
        low, high = self.ring.interval(difference)
        # of two that always exist and are always equal only the later may go
        return low is not None and low >= 0 and not (high == 0 and value.number < best.number)

    def as_unknown(self, value: Value) -> Polynomial:
        """Return a value as a polynomial: itself, or an unknown that equals it."""
        if isinstance(value, Polynomial):
            return value
        known = self._unknowns.get(key(value))
        if known is None:
            turned = self._unknowns.get(key(self.negate(value)))
            if turned is not None:
                return self.ring.scale(turned, -1)
            known = self._new("value", self.interval(value))
            self._unknowns[key(value)] = known
            self._define(known, self.equal(known, value))
        return known

    def _new(self, name: str, bounds: Interval) -> Polynomial:
        return self.ring.unknown(f"{name}_{len(self.ring.unknowns)}", *bounds)

    def _define(self, unknown: Polynomial, truth: Bool) -> None:
        self.definitions.setdefault(unknown.only_unknown, []).append(truth)

    def indicator(self, cond: Bool) -> Polynomial:
        """Return 1 if the condition holds, else 0."""
        return self.as_unknown(self.choose(cond, self.one, self.zero))

    def leafwise(
        self, value: Value, function: Callable[[Polynomial], Value], *, turns: bool = False
    ) -> Value:
        """Apply a growing (or falling: `turns`) function to every polynomial of a value."""
        if isinstance(value, Polynomial):
            return function(value)
        if isinstance(value, Choice):
            then, els = (self.leafwise(part, function, turns=turns) for part in (value.then, value.els))
            return self.choose(value.cond, then, els)
        return self.extreme(
            value.least is not turns,
            [(guard, self.leafwise(part, function, turns=turns)) for guard, part in value.members],
        )

    def add(self, one: Value, other: Value) -> Value:
        """Return the sum."""
        if isinstance(one, Polynomial) and isinstance(other, Polynomial):
            return self.ring.add(one, other)
        if isinstance(one, Polynomial):
            return self.leafwise(other, lambda leaf: self.ring.add(leaf, one))
        if isinstance(other, Polynomial):
            return self.leafwise(one, lambda leaf: self.ring.add(leaf, other))
        if one.size * other.size > _MOST_LEAVES:
            return self.add(self.as_unknown(one), self.as_unknown(other))
        for left, right in ((one, other), (other, one)):
            if isinstance(left, Choice):
                return self.choose(left.cond, self.add(left.then, right), self.add(left.els, right))
        return self.add(one, self.as_unknown(other))

    def scale(self, value: Value, factor: Rational) -> Value:
        """Return the product with a constant."""
        if not factor:
            return self.zero
        return self.leafwise(value, lambda leaf: self.ring.scale(leaf, factor), turns=factor < 0)

    def negate(self, value: Value) -> Value:
        """Return the value with the other sign."""
        return self.scale(value, -1)

    def subtract(self, one: Value, other: Value) -> Value:
        """Return the difference."""
        return self.add(one, self.negate(other))

    def multiply(self, one: Value, other: Value) -> Value:
        """Return the product."""
        if isinstance(other, Polynomial):
            one, other = other, one
        if isinstance(one, Polynomial):
            if one.constant is not None:
                return self.scale(other, one.constant)
            if isinstance(other, Polynomial):
                return self.ring.multiply(one, other)
            return self._multiply_leaves(one, other)
        for left, right in ((one, other), (other, one)):
            if isinstance(left, Choice) and size(one) * size(other) <= _MOST_LEAVES and left is not right:
                return self.choose(left.cond, self.multiply(left.then, right), self.multiply(left.els, right))
        return self.multiply(self.as_unknown(one), self.as_unknown(other))

    def _multiply_leaves(self, factor: Polynomial, value: Choice | Extreme) -> Value:
        low, high = self.ring.interval(factor)
        if isinstance(value, Choice):
            return self.choose(
                value.cond, self.multiply(factor, value.then), self.multiply(factor, value.els)
            )
        if (low is not None and low >= 0) or (high is not None and high <= 0):
            falls = not (low is not None and low >= 0)
            members = [(guard, self.multiply(factor, part)) for guard, part in value.members]
            return self.extreme(value.least is not falls, members)
        return self.ring.multiply(factor, self.as_unknown(value))

    def divide(self, one: Value, other: Value) -> Value:
        """Return the quotient; undefined for a divisor of 0."""
        divisor = self.as_unknown(other)
        if divisor.constant is not None:
            return self.scale(one, mpq(1, divisor.constant)) if divisor.constant else self.zero
        if len(divisor.terms) > 1:
            divisor, factor = self._named(divisor)
            one = self.scale(one, mpq(1, factor))
        ((monomial, factor),) = divisor.terms.items()
        inverse = {tuple((unknown, -power) for unknown, power in monomial): mpq(1, factor)}
        return self.multiply(self.ring.make(inverse), one)

    def _named(self, polynomial: Polynomial) -> tuple[Polynomial, Rational]:
        """Return an unknown and a factor whose product is the polynomial."""
        factor = next(iter(polynomial.terms.values()))
        normal = self.ring.scale(polynomial, mpq(1, factor))
        known = self._unknowns.get(normal.number)
        if known is None:
            known = self._unknowns[normal.number] = self._new("divisor", self.ring.interval(normal))
            self._define(known, self._zero(self.ring.subtract(known, normal)))
        return known, factor

    def sqrt(self, value: Value) -> Value:
        """Return the square root; undefined for a negative number."""
        square = self.as_unknown(value)
        if square.constant is not None and square.constant >= 0:
            root = _exact_root(square.constant)
            if root is not None:
                return self.ring.const(root)
        known = self._unknowns.get(("sqrt", square.number))
        if known is None:
            known = self._new("sqrt", _root_interval(self.ring.interval(square)))
            self._unknowns["sqrt", square.number] = known
            raw = self.ring.subtract(self.ring.make({((known.only_unknown, 2),): 1}), square)
            # an undefined root has no constraint: scenes that do not use it stay possible
            self._define(known, self.booleans.implies(self.at_least(square, self.zero), self._zero(raw)))
            self._define(known, self.at_least(known, self.zero))
            self.ring.declare_root(known, square)
        return known

    def power(self, base: Value, exponent: mpq) -> Value | None:
        """Return a power by arithmetic and roots if the exponent is a small multiple of a half; else None.

        It may be undefined for a negative base, or for 0 with a negative exponent.
        """
        if (2 * exponent).denominator != 1 or abs(exponent) > _MOST_MULTIPLICATIONS:
            return None
        result: Value = self.one if exponent.denominator == 1 else self.sqrt(base)
        for _ in range(int(abs(exponent))):
            result = self.multiply(result, base)
        return self.divide(self.one, result) if exponent < 0 else result

    def apply(self, function: str, arguments: Sequence[Value], bounds: Interval = (None, None)) -> Value:
        """Return an unknown function within `bounds`, with equal values for equal arguments."""
        polynomials = [self.as_unknown(argument) for argument in arguments]
        place = (function, *(polynomial.number for polynomial in polynomials))
        if place not in self._unknowns:
            self._unknowns[place] = self._new(function, bounds)
        return self._unknowns[place]

    def interval(self, value: Value) -> Interval:
        """Return bounds on a value."""
        if isinstance(value, Polynomial):
            return self.ring.interval(value)
        known = self._intervals.get(key(value))
        if known is None:
            known = self._intervals[key(value)] = self._interval(value)
        return known

    def _interval(self, value: Choice | Extreme) -> Interval:
        parts = [value.then, value.els] if isinstance(value, Choice) else [part for _, part in value.members]
        lows, highs = zip(*(self.interval(part) for part in parts), strict=True)
        low = None if None in lows else min(lows)
        high = None if None in highs else max(highs)
        if isinstance(value, Extreme):
            always = [self.interval(part) for guard, part in value.members if guard is self.booleans.true]
            if value.least:
                high = _tightest(min, [high, *(bound for _, bound in always)])
            else:
                low = _tightest(max, [low, *(bound for bound, _ in always)])
        return (low, high)

    def less(self, one: Value, other: Value) -> Bool:
        """Return one < other."""
        if isinstance(one, Polynomial) and isinstance(other, Polynomial):
            return self.above(self.ring.subtract(other, one))
        if one is other:
            return self.booleans.false
        place = (key(one), key(other))
        known = self._less.get(place)
        if known is None:
            known = self._less[place] = self._less_structured(one, other)
        return known

    def _less_structured(self, one: Value, other: Value) -> Bool:
        booleans = self.booleans
        if isinstance(one, Choice):
            both = isinstance(other, Choice) and other.cond is one.cond
            then, els = (other.then, other.els) if isinstance(other, Choice) and both else (other, other)
            return booleans.choose(one.cond, self.less(one.then, then), self.less(one.els, els))
        if isinstance(other, Choice):
            return booleans.choose(other.cond, self.less(one, other.then), self.less(one, other.els))
        if isinstance(one, Extreme):
            parts = [(guard, self.less(part, other)) for guard, part in one.members]
            some = one.least
        else:
            assert isinstance(other, Extreme)
            parts = [(guard, self.less(one, part)) for guard, part in other.members]
            some = not other.least
        if some:
            return booleans.or_(booleans.and_(part) for part in parts)
        return booleans.and_(booleans.implies(*part) for part in parts)

    def at_least(self, one: Value, other: Value) -> Bool:
        """Return one >= other."""
        return self.booleans.not_(self.less(one, other))

    def equal(self, one: Value, other: Value) -> Bool:
        """Return one = other."""
        booleans = self.booleans
        if isinstance(one, Polynomial) and isinstance(other, Polynomial):
            return self._zero(self.ring.subtract(one, other))
        if one is other:
            return booleans.true
        if isinstance(one, Polynomial):
            one, other = other, one
        if isinstance(one, Choice):
            return booleans.choose(one.cond, self.equal(one.then, other), self.equal(one.els, other))
        assert isinstance(one, Extreme)
        guards = [guard for guard, _ in one.members]
        bound = [
            booleans.implies(guard, self.at_least(part, other) if one.least else self.at_least(other, part))
            for guard, part in one.members
        ]
        reached = [booleans.and_((guard, self.equal(part, other))) for guard, part in one.members]
        return booleans.and_([*bound, booleans.or_([*reached, booleans.not_(booleans.or_(guards))])])

    def above(self, polynomial: Polynomial) -> Bool:
        """Return the comparison of a polynomial > 0."""
        known = self._above.get(polynomial.number)
        if known is None:
            known = self._above[polynomial.number] = self._sign(polynomial)
        return known

    def _sign(self, polynomial: Polynomial) -> Bool:
        low, high = self.ring.interval(polynomial)
        if low is not None and low > 0:
            return self.booleans.true
        if high is not None and high <= 0:
            return self.booleans.false
        for unknown, power in _least_powers(polynomial).items():
            if power and self.clears:
                return self._sign_without(polynomial, unknown, power)
            if power and self.ring.unknowns[unknown].is_positive:
                return self._sign_beside(polynomial, unknown, power)
        return self._sign_of_root(polynomial) or self._normal("above", polynomial)

    def _sign_without(self, polynomial: Polynomial, unknown: int, power: int) -> Bool:
        """Return the sign of a polynomial by that of its quotient by a common power of one unknown."""
        booleans, ring = self.booleans, self.ring
        rest = ring.multiply(polynomial, ring.power(unknown, -power))
        if ring.unknowns[unknown].is_positive:
            return self.above(rest)
        itself = ring.power(unknown, 1)
        up = self.above(itself)
        down = self.above(ring.scale(itself, -1))
        turned = rest if power % 2 == 0 else ring.scale(rest, -1)
        cases = [booleans.and_((up, self.above(rest))), booleans.and_((down, self.above(turned)))]
        if power < 0:
            # a division by 0 is undefined: nothing is known about it
            free = booleans.flag(f"undefined_{polynomial.number}")
            cases.append(booleans.and_((self._zero(itself), free)))
        return booleans.or_(cases)

    def _sign_beside(self, polynomial: Polynomial, unknown: int, power: int) -> Bool:
        """Return the sign of the quotient by a power of a positive unknown, with a lemma that they agree."""
        booleans, ring = self.booleans, self.ring
        rest = ring.multiply(polynomial, ring.power(unknown, -power))
        result = self.above(rest)
        for one, other in ((polynomial, rest), (self.ring.scale(polynomial, -1), ring.scale(rest, -1))):
            product, factor = self._normal("above", one), self.above(other)
            agree = booleans.choose(product, factor, booleans.not_(factor))
            for leaf in leaves([factor]):
                self.lemmas.setdefault(leaf, []).append(agree)
        return result

    def _sign_of_root(self, polynomial: Polynomial) -> Bool | None:
        """Return the sign of a·√s + q by those of q and of a²·s - q², if there is one root."""
        ring, booleans = self.ring, self.booleans
        roots = [
            (monomial, unknown)
            for monomial in polynomial.terms
            for unknown, _ in monomial
            if ring.square_of(unknown) is not None
        ]
        if len(roots) != 1:
            return None
        monomial, unknown = roots[0]
        if monomial != ((unknown, 1),):
            return None
        square = ring.square_of(unknown)
        assert square is not None
        factor = polynomial.terms[monomial]
        rest = ring.subtract(polynomial, ring.make({monomial: factor}))
        low, high = ring.interval(rest)
        if not self.clears and (low is None or low < 0) and (high is None or high > 0):
            return None
        difference = ring.subtract(ring.scale(square, factor * factor), ring.multiply(rest, rest))
        if factor > 0:
            return booleans.or_((self.above(rest), self.above(difference)))
        return booleans.and_((self.above(rest), self.above(ring.scale(difference, -1))))

    def _normal(self, op: str, polynomial: Polynomial) -> Bool:
        """Return the comparison with the leading coefficient 1."""
        factor = list(polynomial.terms.values())[-1]
        normal = self.ring.scale(polynomial, mpq(1, factor))
        if op == "zero":
            return self.booleans.comparison("zero", normal)
        truth = self.booleans.comparison("above" if factor > 0 else "atleast", normal)
        truth = self._assumed.get(truth, truth)
        return truth if factor > 0 else self.booleans.not_(truth)

    def _zero(self, polynomial: Polynomial) -> Bool:
        """Return the comparison of a polynomial = 0."""
        low, high = self.ring.interval(polynomial)
        if (low is not None and low > 0) or (high is not None and high < 0):
            return self.booleans.false
        if not polynomial.terms:
            return self.booleans.true
        for unknown, power in _least_powers(polynomial).items():
            if power and self.clears:
                rest = self.ring.multiply(polynomial, self.ring.power(unknown, -power))
                if self.ring.unknowns[unknown].is_positive:
                    return self._zero(rest)
                itself = self.booleans.comparison("zero", self.ring.power(unknown, 1))
                if power > 0:
                    return self.booleans.or_((itself, self._zero(rest)))
                # a flag of its own: an undefined value may be neither greater than nor equal to a number
                free = self.booleans.flag(f"undefined_zero_{polynomial.number}")
                return self.booleans.choose(itself, free, self._zero(rest))
        return self._normal("zero", polynomial)


def _least_powers(polynomial: Polynomial) -> dict[int, int]:
    """Return, by unknown, the power common to all monomials, or the most negative one.

    A single unknown has none: its sign needs no reduction.
    """
    monomials: list[Monomial] = list(polynomial.terms)
    if len(monomials) == 1 and [power for _, power in monomials[0]] in ([], [1]):
        return {}
    result: dict[int, int] = {}
    for unknown in polynomial.unknowns:
        powers = [dict(monomial).get(unknown, 0) for monomial in monomials]
        result[unknown] = min(powers)
    return result


def _tightest(pick: Callable[[list[Rational]], Rational], bounds: list[Rational | None]) -> Rational | None:
    """Return the tightest of the existing bounds."""
    known = [bound for bound in bounds if bound is not None]
    return pick(known) if known else None


def _exact_root(square: Rational) -> Rational | None:
    """Return the square root of a fraction if it is a fraction."""
    root = mpq(math.isqrt(square.numerator), math.isqrt(square.denominator))
    return root if root * root == square else None


def _root_interval(bounds: Interval) -> Interval:
    low, high = bounds
    least = mpq(0)
    if low is not None and low > 0:
        least = mpq(math.isqrt(int(low * _DENOMINATOR**2)), _DENOMINATOR)
    if high is None:
        return (least, None)
    return (least, mpq(math.isqrt(max(0, math.ceil(high * _DENOMINATOR**2))) + 1, _DENOMINATOR))
