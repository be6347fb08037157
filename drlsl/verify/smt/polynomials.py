"""Polynomials with rational coefficients over unknowns, in a normal form: equal ones are one object.

Exponents may be negative: a division by an unknown is kept as such until a comparison clears it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from math import prod
from typing import Final, TypeAlias

from gmpy2 import mpq

Monomial: TypeAlias = tuple[tuple[int, int], ...]
"""Numbers of unknowns with their exponents, in order."""

Rational: TypeAlias = mpq | int
"""A rational number; whole ones are integers, which are faster. Divide by ``mpq(1, number)``."""


Interval: TypeAlias = tuple[Rational | None, Rational | None]
"""The least and greatest value; None if there is none."""

ONE: Final[Monomial] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Unknown:
    """An unknown real number; `low` and `high` bound it, None without a bound."""

    number: int
    name: str
    low: Rational | None
    high: Rational | None

    @property
    def bounds(self) -> Interval:
        """Both bounds."""
        return self.low, self.high

    @property
    def is_positive(self) -> bool:
        """True if it is above 0."""
        return self.low is not None and self.low > 0


class Polynomial:
    """A sum of monomials with coefficients other than 0. `number` tells polynomials apart."""

    __slots__ = ("number", "terms")

    def __init__(self, terms: Mapping[Monomial, Rational], number: int) -> None:
        self.terms = terms
        self.number = number

    @property
    def constant(self) -> Rational | None:
        """Its value if it has no unknowns, else None."""
        if not self.terms:
            return 0
        return self.terms.get(ONE) if len(self.terms) == 1 else None

    @property
    def unknowns(self) -> dict[int, None]:
        """The numbers of its unknowns, in order."""
        return dict.fromkeys(unknown for monomial in self.terms for unknown, _ in monomial)

    @property
    def only_unknown(self) -> int:
        """The number of the unknown that it is."""
        ((((number, _),), _),) = self.terms.items()
        return number

    def __repr__(self) -> str:
        return " + ".join(
            "*".join([str(factor), *(f"u{unknown}^{power}" for unknown, power in monomial)])
            for monomial, factor in self.terms.items()
        )


def times(one: Monomial, other: Monomial) -> Monomial:
    """Return the product of two monomials."""
    if not one or not other:
        return one or other
    powers = dict(one)
    for unknown, power in other:
        powers[unknown] = powers.get(unknown, 0) + power
    return tuple(sorted((unknown, power) for unknown, power in powers.items() if power))


def exact(value: Fraction | Rational) -> mpq:
    """Return a rational number as gmpy2's; its own conversion refuses fractions that have its integers."""
    return mpq(int(value.numerator), int(value.denominator))


def evaluate(
    polynomial: Polynomial,
    numbers: Mapping[int, Fraction],
    products: Mapping[Monomial, Fraction] | None = None,
) -> Fraction:
    """Return the value of a polynomial for these values of its unknowns, and perhaps of its products."""
    total = mpq(0)
    for monomial, factor in polynomial.terms.items():
        known = products.get(monomial) if products else None
        powers = (exact(numbers[u]) ** power for u, power in monomial) if known is None else (exact(known),)
        total += factor * prod(powers)
    return Fraction(int(total.numerator), int(total.denominator))


class Ring:
    """Makes unknowns and polynomials."""

    def __init__(self) -> None:
        self.unknowns: list[Unknown] = []
        self._made: dict[tuple[tuple[Monomial, Rational], ...], Polynomial] = {}
        self._squares: dict[int, Polynomial] = {}  # of the unknowns that are square roots
        self._intervals: dict[int, Interval] = {}
        self._monomials: dict[Monomial, Interval] = {}

    def unknown(
        self, name: str, low: Fraction | Rational | None, high: Fraction | Rational | None
    ) -> Polynomial:
        """Return a new unknown, as a polynomial."""
        bounds = (None if bound is None else exact(bound) for bound in (low, high))
        made = Unknown(len(self.unknowns), name, *bounds)
        self.unknowns.append(made)
        return self.make({((made.number, 1),): 1})

    def declare_root(self, root: Polynomial, square: Polynomial) -> None:
        """Have the square of the unknown `root` written as `square` from now on."""
        ((unknown, _),) = next(iter(root.terms))
        self._squares[unknown] = square

    def square_of(self, unknown: int) -> Polynomial | None:
        """Return the polynomial of which an unknown is the square root, if it is one."""
        return self._squares.get(unknown)

    def make(self, terms: Mapping[Monomial, Rational]) -> Polynomial:
        """Return the polynomial of these terms."""
        return self._once({monomial: factor for monomial, factor in sorted(terms.items()) if factor})

    def _once(self, terms: Mapping[Monomial, Rational]) -> Polynomial:
        """Return the polynomial of terms that are in order, none of them 0."""
        kept = {
            monomial: factor if factor.denominator != 1 else factor.numerator
            for monomial, factor in terms.items()
        }
        key = tuple(kept.items())
        known = self._made.get(key)
        if known is None:
            known = self._made[key] = Polynomial(kept, len(self._made))
        return known

    def const(self, value: Fraction | Rational) -> Polynomial:
        """Return a constant."""
        return self.make({ONE: exact(value)})

    def add(self, one: Polynomial, other: Polynomial) -> Polynomial:
        """Return the sum."""
        if not other.terms:
            return one
        terms = dict(one.terms)
        for monomial, factor in other.terms.items():
            terms[monomial] = terms.get(monomial, 0) + factor
        return self.make(terms)

    def scale(self, one: Polynomial, factor: Fraction | Rational) -> Polynomial:
        """Return the product with a constant."""
        if factor == 1 or not factor:
            return one if factor else self.const(0)
        by = exact(factor)
        return self._once({monomial: f * by for monomial, f in one.terms.items()})

    def subtract(self, one: Polynomial, other: Polynomial) -> Polynomial:
        """Return the difference."""
        if not other.terms:
            return one
        terms = dict(one.terms)
        for monomial, factor in other.terms.items():
            terms[monomial] = terms.get(monomial, 0) - factor
        return self.make(terms)

    def multiply(self, one: Polynomial, other: Polynomial) -> Polynomial:
        """Return the product."""
        terms: dict[Monomial, Rational] = {}
        rest = self.const(0)
        for left, f in one.terms.items():
            for right, g in other.terms.items():
                product = times(left, right)
                root = next((u for u, power in product if power > 1 and u in self._squares), None)
                if root is None:
                    terms[product] = terms.get(product, 0) + f * g
                else:
                    lowered = self.make({times(product, ((root, -2),)): f * g})
                    rest = self.add(rest, self.multiply(lowered, self._squares[root]))
        return self.add(self.make(terms), rest)

    def power(self, unknown: int, power: int) -> Polynomial:
        """Return a power of one unknown."""
        return self.make({((unknown, power),): 1})

    def interval(self, one: Polynomial) -> Interval:
        """Return bounds on the value that follow from those of the unknowns."""
        known = self._intervals.get(one.number)
        if known is None:
            low: Rational | None = 0
            high: Rational | None = 0
            for monomial, factor in one.terms.items():
                least, most = self._monomials.get(monomial) or self._monomial_interval(monomial)
                if factor < 0:
                    least, most = most, least
                low = None if low is None or least is None else low + factor * least
                high = None if high is None or most is None else high + factor * most
            known = self._intervals[one.number] = (low, high)
        return known

    def _monomial_interval(self, monomial: Monomial) -> Interval:
        result: Interval = (1, 1)
        for number, power in monomial:
            result = _product(result, _power(self.unknowns[number], power))
        self._monomials[monomial] = result
        return result


def _power(unknown: Unknown, power: int) -> Interval:
    low, high = unknown.low, unknown.high
    if power < 0:
        if low is None or low <= 0:
            return (None, None)
        most = mpq(1, low) ** -power
        return (0 if high is None else mpq(1, high) ** -power, most)
    if power % 2:
        return (None if low is None else low**power, None if high is None else high**power)
    if low is not None and low >= 0:
        return (low**power, None if high is None else high**power)
    if high is not None and high <= 0:
        return (high**power, None if low is None else low**power)
    return (0, None if low is None or high is None else max(-low, high) ** power)


def _product(one: Interval, other: Interval) -> Interval:
    if None in one or None in other:
        nonnegative = all(low is not None and low >= 0 for low, _ in (one, other))
        if not nonnegative:
            return (None, None)
        (low1, high1), (low2, high2) = one, other
        assert low1 is not None
        assert low2 is not None
        return (low1 * low2, None if high1 is None or high2 is None else high1 * high2)
    corners = [a * b for a in one for b in other if a is not None and b is not None]
    return (min(corners), max(corners))
