"""Bounds on rounding errors hold, operation by operation, against arithmetic with 400 bits."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from drlsl.logic.core import NODES
from drlsl.verify.floats import rounding
from drlsl.verify.floats.rounding import Approximation

mpmath = pytest.importorskip("mpmath")
mpmath.mp.prec = 400


@dataclass(frozen=True)
class Number:
    """A real number, the double that was computed for it, and what is claimed of the two."""

    exact: Any
    double: float
    claimed: Approximation

    def check(self) -> Number:
        claimed = self.claimed
        if math.isinf(claimed.error):
            return self  # the double may be infinite, or no number
        assert not math.isnan(self.double)
        assert claimed.low <= self.exact <= claimed.high
        assert abs(mpmath.mpf(self.double) - self.exact) <= claimed.error
        return self


magnitudes = st.sampled_from([1e-300, 1e-30, 1e-9, 1e-3, 1.0, 70.0, 2300.0, 1e9, 1e17])


@st.composite
def facts(draw: st.DrawFn) -> Number:
    """A double in a range that holds it; often at an end."""
    size = draw(magnitudes)
    low, high = sorted(size * draw(st.floats(-1, 1, allow_subnormal=False)) + 0.0 for _ in range(2))
    value = draw(st.one_of(st.floats(low, high), st.sampled_from([low, high])))
    return Number(mpmath.mpf(value), value, rounding.between(Fraction(low), Fraction(high))).check()


@st.composite
def constants(draw: st.DrawFn) -> Number:
    value = draw(st.sampled_from([0.1, 0.35, 1.0499999999999998, 2.0, -1.0, 1.0, 0.0, 1e17, 1 / 3, 3e-7]))
    decimal = Fraction(repr(value))
    exact = mpmath.mpf(decimal.numerator) / decimal.denominator
    claimed = rounding.constant(value)
    # 400 bits of a decimal fraction may fall on the other side of a bound
    assert claimed.low - 1e-100 <= exact <= claimed.high + 1e-100
    return Number(exact, value, Approximation(claimed.low, claimed.high, claimed.error))


def binary(
    one: Number,
    other: Number,
    exact: Callable[..., Any],
    double: Callable[..., float],
    claim: Callable[..., Any],
) -> Number:
    return Number(
        exact(one.exact, other.exact), double(one.double, other.double), claim(one.claimed, other.claimed)
    ).check()


def minus(one: Approximation, other: Approximation) -> Approximation:
    return rounding.add(one, rounding.negate(other))


def quotient(one: Approximation, other: Approximation) -> Approximation:
    return rounding.divide(one, other, rounding.quotient(one.low, one.high, other.low, other.high))


def square_root(one: Approximation) -> Approximation:
    return rounding.square_root(one, rounding.root_range(one))


BINARY: dict[str, tuple[Callable[..., Any], Callable[..., float], Callable[..., Any]]] = {
    "add": (lambda a, b: a + b, lambda a, b: a + b, rounding.add),
    "sub": (lambda a, b: a - b, lambda a, b: a - b, minus),
    "mul": (lambda a, b: a * b, lambda a, b: a * b, rounding.multiply),
    "min": (min, min, rounding.least_of),
    "max": (max, max, rounding.greatest_of),
}
UNARY: dict[str, tuple[Callable[..., Any], Callable[..., float], Callable[..., Any]]] = {
    "neg": (lambda a: -a, lambda a: -a, rounding.negate),
    "abs": (abs, abs, rounding.absolute),
    "square": (lambda a: a * a, lambda a: a * a, lambda a: rounding.multiply(a, a, square=True)),
}


def combined(op: str, *args: Number) -> Number:
    """An operation on numbers; where it has no value, the first of them."""
    one, other = args[:2]
    if math.isinf(max(one.claimed.error, other.claimed.error)):
        return one
    if op in BINARY:
        return binary(one, other, *BINARY[op])
    if op in UNARY:
        exact, double, claim = UNARY[op]
        return Number(exact(one.exact), double(one.double), claim(one.claimed)).check()
    if op == "div":
        if other.claimed.least <= other.claimed.error:
            return one
        return binary(one, other, lambda a, b: a / b, lambda a, b: a / b, quotient)
    if op == "sqrt":
        if one.exact < 0 or one.double < 0:
            return one
        return Number(mpmath.sqrt(one.exact), math.sqrt(one.double), square_root(one.claimed)).check()
    claimed = rounding.apply(NODES[op], one.claimed)
    value = NODES[op].compute(one.double)
    if claimed == rounding.ANY or math.isnan(value):
        return one
    curve = NODES[op].curve
    if curve is not None and not curve.domain[0] <= one.exact <= curve.domain[1]:
        return one  # it is just outside, and rounded into the domain
    return Number(getattr(mpmath, op)(one.exact), value, claimed).check()


NAMES = [*BINARY, *UNARY, "div", "sqrt", "div", "sqrt"]
SMOOTH = [name for name, row in NODES.items() if row.curve is not None]
trees = st.recursive(
    st.one_of(facts(), constants()),
    lambda inner: st.builds(combined, st.sampled_from(NAMES), inner, inner),
    max_leaves=12,
)


@settings(max_examples=400, deadline=None)
@given(trees)
def test_no_double_is_further_off_than_its_bound(number: Number) -> None:
    number.check()


@settings(max_examples=400, deadline=None)
@given(st.sampled_from(SMOOTH), trees)
def test_functions_of_the_c_library_are_within_their_bounds(name: str, number: Number) -> None:
    assume(-700 < number.exact < 700)
    combined(name, number, number)


@settings(max_examples=300, deadline=None)
@given(facts(), st.sampled_from([2.0, 3.0, 0.5, 0.25, 1.5, 7.0]), facts())
def test_powers(base: Number, exponent: float, more: Number) -> None:
    moved = combined("add", base, more)
    assume(moved.exact >= 0 and moved.double >= 0 and moved.claimed.magnitude < 1e30)
    claimed = rounding.apply(NODES["pow"], moved.claimed, rounding.constant(exponent))
    if claimed != rounding.ANY:
        Number(moved.exact**exponent, moved.double**exponent, claimed).check()


@settings(max_examples=200, deadline=None)
@given(st.lists(facts(), min_size=1, max_size=6), facts())
def test_sums(members: list[Number], start: Number) -> None:
    bounds = members[0].claimed
    for one in members:
        bounds = rounding.either(bounds, one.claimed)
    claimed = rounding.total(start.claimed, bounds, len(members), whole=False)
    double, exact = start.double, start.exact
    for one in members:
        double, exact = double + one.double, exact + one.exact
    Number(exact, double, claimed).check()


@pytest.mark.parametrize(
    ("value", "off"), [(0.5, 0.0), (0.1, 5.6e-18), (0.35, 2.3e-17), (1e17, 0.0), (3, 0.0), (2**53 + 1, 1.0)]
)
def test_a_constant_is_off_by_what_its_decimals_say(value: float, off: float) -> None:
    assert rounding.constant(value).error == pytest.approx(off, rel=0.02)


def test_what_cancels_leaves_its_error() -> None:
    speed = rounding.between(Fraction(1), Fraction(70))
    large = rounding.constant(1e17)
    back = rounding.add(rounding.add(speed, large), rounding.negate(large))
    assert 8.0 <= back.error < 8.1


@settings(max_examples=200, deadline=None)
@given(st.floats(0.0, 1e-6), st.sampled_from([1.0, 1e3, 1e9, 1e17]))
def test_a_root_next_to_0_is_off_by_the_root_of_the_error(value: float, large: float) -> None:
    small = Number(mpmath.mpf(value), value, rounding.between(Fraction(0), Fraction(1)))
    far = Number(mpmath.mpf(large), large, rounding.constant(large))
    back = combined("sub", combined("add", small, far), far)
    assert combined("sqrt", back, back).claimed.error >= math.sqrt(math.ulp(large) / 2)
