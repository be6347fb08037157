"""No simplification excludes a point: what plain arithmetic says of it, the solver must find possible."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from decimal import Context, Decimal, localcontext
from fractions import Fraction
from typing import Final

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drlsl.verify.smt import Algebra, Bool, Solver, Value

RANGES: Final = ((Fraction(-20), Fraction(20)), (Fraction(0), Fraction(20)), (Fraction(1, 4), Fraction(20)))
"""Of the unknowns: of either sign, not negative, positive."""

DIGITS: Final = Context(prec=80)
EQUAL: Final = Decimal("1e-50")
"""Numbers nearer to each other than this are equal; unlike ones of these tests are far from it."""

Make = Callable[[Algebra, list[Value]], Value]
Plain = Callable[[tuple[Decimal, ...]], Decimal]


class UndefinedError(Exception):
    """Plain arithmetic has no value."""


@dataclass
class Frame:
    """What a solver wants to know besides formulas: nothing."""

    algebra: Algebra
    always: list[Bool] = field(default_factory=list)
    about: dict[str, list[Bool]] = field(default_factory=dict)
    usual: dict[int, tuple[int, Fraction]] = field(default_factory=dict)

    def tidy(self) -> list[Bool]:
        return []


def quotient(one: Decimal, other: Decimal) -> Decimal:
    if abs(other) < EQUAL:
        raise UndefinedError
    return one / other


def root(value: Decimal) -> Decimal:
    if value < -EQUAL:
        raise UndefinedError
    return max(value, Decimal(0)).sqrt()


def _select(compare: Callable[[Decimal, Decimal], bool], one: Plain, two: Plain) -> Plain:
    return lambda p: one(p) if compare(p[0], p[1]) else two(p)


@st.composite
def expressions(draw: st.DrawFn, depth: int = 3) -> tuple[Make, Plain]:
    """An expression over three unknowns with divisions and roots, and the same in plain arithmetic."""
    if depth == 0 or draw(st.integers(0, 4)) == 0:
        if draw(st.integers(0, 3)) == 0:
            number = draw(st.sampled_from([Fraction(n) for n in (-3, -1, 0, 1, 2)] + [Fraction(1, 2)]))
            return (
                lambda a, _: a.ring.const(number),
                lambda _: Decimal(number.numerator) / Decimal(number.denominator),
            )
        place = draw(st.integers(0, 2))
        return lambda _, unknowns: unknowns[place], lambda point: point[place]
    (one, p1), (two, p2) = draw(expressions(depth - 1)), draw(expressions(depth - 1))
    operations: dict[str, tuple[Make, Plain]] = {
        "add": (lambda a, u: a.add(one(a, u), two(a, u)), lambda p: p1(p) + p2(p)),
        "subtract": (lambda a, u: a.subtract(one(a, u), two(a, u)), lambda p: p1(p) - p2(p)),
        "multiply": (lambda a, u: a.multiply(one(a, u), two(a, u)), lambda p: p1(p) * p2(p)),
        "square": (lambda a, u: a.multiply(one(a, u), one(a, u)), lambda p: p1(p) * p1(p)),
        "divide": (lambda a, u: a.divide(one(a, u), two(a, u)), lambda p: quotient(p1(p), p2(p))),
        "invert": (lambda a, u: a.divide(a.one, one(a, u)), lambda p: quotient(Decimal(1), p1(p))),
        "sqrt": (lambda a, u: a.sqrt(one(a, u)), lambda p: root(p1(p))),
        "inverse root": (
            lambda a, u: a.divide(two(a, u), a.sqrt(one(a, u))),
            lambda p: quotient(p2(p), root(p1(p))),
        ),
        "min": (
            lambda a, u: a.extreme(True, [(a.booleans.true, one(a, u)), (a.booleans.true, two(a, u))]),
            lambda p: min(p1(p), p2(p)),
        ),
        "max": (
            lambda a, u: a.extreme(False, [(a.booleans.true, one(a, u)), (a.booleans.true, two(a, u))]),
            lambda p: max(p1(p), p2(p)),
        ),
        "choose": (
            lambda a, u: a.choose(a.less(u[0], u[1]), one(a, u), two(a, u)),
            _select(lambda x, y: x < y, p1, p2),
        ),
        "some": (
            lambda a, u: a.extreme(
                True, [(a.less(u[0], u[1]), one(a, u)), (a.at_least(u[0], u[1]), two(a, u))]
            ),
            _select(lambda x, y: x < y, p1, p2),
        ),
    }
    return operations[draw(st.sampled_from(sorted(operations)))]


@st.composite
def points(draw: st.DrawFn) -> tuple[Fraction, ...]:
    """A point within the ranges, often at an edge or where two unknowns are equal."""
    shared = draw(st.fractions(min_value=-20, max_value=20, max_denominator=4))
    result = []
    for low, high in RANGES:
        special = st.sampled_from([low, high, Fraction(0), Fraction(1), shared])
        x = draw(special | st.fractions(min_value=low, max_value=high, max_denominator=4))
        result.append(min(high, max(low, x)))
    return tuple(result)


def decimals(point: tuple[Fraction, ...]) -> tuple[Decimal, ...]:
    return tuple(Decimal(int(x.numerator)) / Decimal(int(x.denominator)) for x in point)


@pytest.mark.parametrize("clears", [False, True], ids=["as it stands", "cleared"])
@settings(max_examples=150, deadline=None)
@given(one=expressions(), other=expressions(depth=0) | expressions(depth=2), point=points())
def test_what_is_so_is_possible(
    clears: bool, one: tuple[Make, Plain], other: tuple[Make, Plain], point: tuple[Fraction, ...]
) -> None:
    with localcontext(DIGITS):
        try:
            difference = one[1](decimals(point)) - other[1](decimals(point))
        except UndefinedError:
            return
    algebra = Algebra(clears=clears)
    unknowns: list[Value] = [algebra.ring.unknown("abc"[n], *RANGES[n]) for n in range(3)]
    left, right = one[0](algebra, unknowns), other[0](algebra, unknowns)
    pins = [algebra.equal(unknown, algebra.ring.const(x)) for unknown, x in zip(unknowns, point, strict=True)]
    for truth, expected in (
        (algebra.less(left, right), difference < -EQUAL),
        (algebra.less(right, left), difference > EQUAL),
        (algebra.equal(left, right), abs(difference) <= EQUAL),
    ):
        so = truth if expected else algebra.booleans.not_(truth)
        for linear in (True, False) if clears else (True,):
            solver = Solver(Frame(algebra), linear=linear)
            assert solver.holds_nowhere(algebra.booleans.and_([so, *pins]), 0.5).verdict != "none"


@pytest.mark.parametrize("clears", [False, True], ids=["as it stands", "cleared"])
@settings(max_examples=150, deadline=None)
@given(one=expressions(), point=points())
def test_values_lie_in_their_intervals(
    clears: bool, one: tuple[Make, Plain], point: tuple[Fraction, ...]
) -> None:
    with localcontext(DIGITS):
        try:
            value = one[1](decimals(point))
        except UndefinedError:
            return
        algebra = Algebra(clears=clears)
        unknowns: list[Value] = [algebra.ring.unknown("abc"[n], *RANGES[n]) for n in range(3)]
        low, high = algebra.interval(one[0](algebra, unknowns))
        assert low is None or decimals((Fraction(low),))[0] - EQUAL <= value
        assert high is None or value <= decimals((Fraction(high),))[0] + EQUAL
