"""Polynomials and values against plain arithmetic on rational numbers."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

from hypothesis import given, settings
from hypothesis import strategies as st

from drlsl.verify.smt import Algebra, Bool, Polynomial, Value
from drlsl.verify.smt.polynomials import evaluate
from drlsl.verify.smt.signature import signature
from drlsl.verify.smt.values import Choice

NUMBERS = st.fractions(min_value=-20, max_value=20, max_denominator=8)
POINTS = st.tuples(NUMBERS, NUMBERS, NUMBERS)
LOW, HIGH = Fraction(-20), Fraction(20)

Expression = Callable[[Algebra, list[Value]], Value]
Plain = Callable[[tuple[Fraction, ...]], Fraction]


@st.composite
def expressions(draw: st.DrawFn, depth: int = 3) -> tuple[Expression, Plain]:
    """An expression over three unknowns, and the same in plain arithmetic."""
    if depth == 0 or draw(st.integers(0, 3)) == 0:
        if draw(st.booleans()):
            number = draw(NUMBERS)
            return lambda algebra, _: algebra.ring.const(number), lambda _: number
        place = draw(st.integers(0, 2))
        return lambda _, unknowns: unknowns[place], lambda point: point[place]
    (one, plain_one), (two, plain_two) = draw(expressions(depth - 1)), draw(expressions(depth - 1))
    match draw(st.sampled_from(["add", "subtract", "multiply", "min", "max", "abs", "choose"])):
        case "add":
            return lambda a, u: a.add(one(a, u), two(a, u)), lambda p: plain_one(p) + plain_two(p)
        case "subtract":
            return lambda a, u: a.subtract(one(a, u), two(a, u)), lambda p: plain_one(p) - plain_two(p)
        case "multiply":
            return lambda a, u: a.multiply(one(a, u), two(a, u)), lambda p: plain_one(p) * plain_two(p)
        case "min":
            return (
                lambda a, u: a.extreme(True, [(a.booleans.true, one(a, u)), (a.booleans.true, two(a, u))]),
                lambda p: min(plain_one(p), plain_two(p)),
            )
        case "max":
            return (
                lambda a, u: a.extreme(False, [(a.booleans.true, one(a, u)), (a.booleans.true, two(a, u))]),
                lambda p: max(plain_one(p), plain_two(p)),
            )
        case "abs":
            return (
                lambda a, u: a.extreme(
                    False, [(a.booleans.true, one(a, u)), (a.booleans.true, a.negate(one(a, u)))]
                ),
                lambda p: abs(plain_one(p)),
            )
        case _:
            return (
                lambda a, u: a.choose(a.less(u[0], u[1]), one(a, u), two(a, u)),
                lambda p: plain_one(p) if p[0] < p[1] else plain_two(p),
            )


def holds(truth: Bool, point: dict[int, Fraction]) -> bool:
    """The truth of a formula at a point."""
    if truth.op in ("true", "false", "flag"):  # a flag: a division by 0, which no point here has
        return truth.op == "true"
    if truth.op == "not":
        return not holds(truth.args[0], point)
    if truth.op in ("and", "or"):
        return (all if truth.op == "and" else any)(holds(arg, point) for arg in truth.args)
    value = evaluate(truth.data, point)
    return {"above": value > 0, "atleast": value >= 0, "zero": value == 0}[truth.op]


def value_at(algebra: Algebra, value: Value, point: dict[int, Fraction], made: dict[int, Value]) -> Fraction:
    """A value at a point; unknowns that stand for values are looked up in `made`."""
    if isinstance(value, Polynomial):
        for monomial in value.terms:
            for unknown, _ in monomial:
                if unknown not in point:
                    point[unknown] = value_at(algebra, made[unknown], point, made)
        return evaluate(value, point)
    if isinstance(value, Choice):
        complete(algebra, value.cond, point, made)
        side = value.then if holds(value.cond, point) else value.els
        return value_at(algebra, side, point, made)
    values = []
    for guard, part in value.members:
        complete(algebra, guard, point, made)
        if holds(guard, point):
            values.append(value_at(algebra, part, point, made))
    return min(values) if value.least else max(values)


def complete(algebra: Algebra, truth: Bool, point: dict[int, Fraction], made: dict[int, Value]) -> None:
    """Give the unknowns in a formula their values."""
    for arg in truth.args:
        complete(algebra, arg, point, made)
    if truth.op in ("above", "atleast", "zero"):
        value_at(algebra, truth.data, point, made)


class Recording(Algebra):
    """An algebra that remembers which values its unknowns stand for."""

    def __init__(self, *, clears: bool) -> None:
        super().__init__(clears=clears)
        self.made: dict[int, Value] = {}

    def as_unknown(self, value: Value) -> Polynomial:
        known = super().as_unknown(value)
        if not isinstance(value, Polynomial):
            ((((unknown, _),), factor),) = known.terms.items()
            self.made.setdefault(unknown, self.scale(value, 1 / Fraction(factor)))
        return known


@settings(max_examples=80, deadline=None)
@given(one=expressions(), other=expressions(), point=POINTS, clears=st.booleans())
def test_comparisons_are_those_of_plain_arithmetic(
    one: tuple[Expression, Plain], other: tuple[Expression, Plain], point: tuple[Fraction, ...], clears: bool
) -> None:
    algebra = Recording(clears=clears)
    unknowns: list[Value] = [algebra.ring.unknown(name, LOW, HIGH) for name in "abc"]
    left, right = one[0](algebra, unknowns), other[0](algebra, unknowns)
    values = dict(enumerate(point))
    for made, expected in (
        (algebra.less(left, right), one[1](point) < other[1](point)),
        (algebra.at_least(left, right), one[1](point) >= other[1](point)),
        (algebra.equal(left, right), one[1](point) == other[1](point)),
    ):
        complete(algebra, made, values, algebra.made)
        assert holds(made, values) == expected


@settings(max_examples=80, deadline=None)
@given(one=expressions(), point=POINTS)
def test_values_lie_in_their_intervals(one: tuple[Expression, Plain], point: tuple[Fraction, ...]) -> None:
    algebra = Algebra()
    unknowns: list[Value] = [algebra.ring.unknown(name, LOW, HIGH) for name in "abc"]
    low, high = algebra.interval(one[0](algebra, unknowns))
    value = one[1](point)
    assert low is None or low <= value
    assert high is None or value <= high


def test_a_quotient_times_its_divisor_is_the_dividend() -> None:
    algebra = Algebra()
    x, y = (algebra.ring.unknown(name, LOW, HIGH) for name in "xy")
    divisor = algebra.add(y, algebra.one)
    named = algebra.divide(algebra.one, algebra.divide(algebra.one, divisor))
    assert algebra.multiply(algebra.divide(x, y), y) is x
    assert algebra.multiply(algebra.divide(x, divisor), named) is x


def test_the_sign_of_a_quotient_turns_with_the_divisor() -> None:
    algebra = Algebra()
    y = algebra.ring.unknown("y", LOW, HIGH)
    truth = algebra.less(algebra.divide(algebra.one, y), algebra.zero)
    for value, expected in ((Fraction(3), False), (Fraction(-3), True)):
        assert holds(truth, {0: value}) is expected


def test_a_lone_root_is_squared() -> None:
    algebra = Algebra()
    x = algebra.ring.unknown("x", Fraction(0), Fraction(100))
    bound = algebra.ring.unknown("bound", Fraction(-10), Fraction(10))
    truth = algebra.less(algebra.sqrt(x), bound)
    for value, limit, expected in ((4, 3, True), (4, 2, False), (4, -3, False), (9, 3, False)):
        assert holds(truth, {0: Fraction(value), 1: Fraction(limit)}) is expected


def test_equal_questions_have_equal_signatures() -> None:
    def question(names: str, before: int) -> bytes:
        algebra = Algebra()
        for _ in range(before):
            algebra.ring.unknown("unused", LOW, HIGH)
        x, y = (algebra.ring.unknown(name, LOW, HIGH) for name in names)
        return signature([algebra.less(algebra.multiply(x, x), algebra.add(y, algebra.one))], algebra.ring)

    assert question("ab", 0) == question("cd", 3)


def test_unlike_questions_have_unlike_signatures() -> None:
    seen = set()
    algebra = Algebra()
    x = algebra.ring.unknown("x", LOW, HIGH)
    narrow = algebra.ring.unknown("x", Fraction(0), HIGH)
    for truth in (
        algebra.less(x, algebra.one),
        algebra.less(narrow, algebra.one),
        algebra.less(x, algebra.number(2)),
        algebra.less(algebra.one, x),
        algebra.less(x, algebra.number(0.5)),
        algebra.less(x, algebra.number(0.25)),
    ):
        seen.add(signature([truth], algebra.ring))
    assert len(seen) == 6
