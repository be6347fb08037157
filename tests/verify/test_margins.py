"""From which margin on doubles decide as a proof in real numbers says."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import product
from pathlib import Path

import pytest

from drlsl.driving.shield import default_rules
from drlsl.lowering.frontend import deep_recursion
from drlsl.lowering.ir import Node, Pool, reach
from drlsl.verify import RANGES, Prover
from drlsl.verify.attack.exact import _Exact, _Floats, judge
from drlsl.verify.attack.sampled_facts import ExactFacts
from drlsl.verify.floats import Floats
from drlsl.verify.floats.assumed import Simplifier
from drlsl.verify.floats.intervals import Context, Values
from drlsl.verify.floats.margins import USUAL_MARGIN
from drlsl.verify.floats.ordering import Order
from drlsl.verify.floats.rounding import Approximation

RULES = default_rules()[0].parent
EGO = "vehicle(ego,_,_,_,V,_,_,_)"


def prover_of(folder: Path, clause: str, more: str = "") -> Prover:
    path = folder / "one.pl"
    path.write_text(f"{more} property(q, 'q').\nviolates(q) :- {clause}", encoding="utf-8")
    return Prover.of((), (path,))


def of(folder: Path, clause: str, more: str = "") -> Floats:
    """The margin of one property, given by the body of its clause."""
    return prover_of(folder, clause, more).floats("q", 6)


def test_a_sum_with_a_large_number_is_proved_in_real_arithmetic_only(tmp_path: Path) -> None:
    found = of(tmp_path, f"{EGO}, V > 1.0, X is (V+1.0e17)-1.0e17, X =< 0.5.")
    assert found.margin is None
    assert found.error == pytest.approx(8.0)
    assert found.comparison is not None
    assert found.comparison.startswith("X =< 0.5 (")
    assert found.comparison.endswith("one.pl:2)")
    assert found.as_json()["because"] == f"{found.comparison} may be off by 8"


@pytest.mark.parametrize(
    "clause",
    [
        f"{EGO}, V > 71.0.",  # no rounding at all
        f"{EGO}, Y is V*0.1, min(Y, 3.0) > Y.",  # doubles keep the order
        f"{EGO}, A is min(V, 7.0), A*0.1 + 0.3 > V*0.1 + 0.3.",
        f"{EGO}, A is max(-8.0, min(3.0, 1.0/(V*V+1.0))), sqrt(A+9.0) > sqrt(3.0+9.0).",
    ],
)
def test_what_doubles_decide_by_their_order_has_no_error(tmp_path: Path, clause: str) -> None:
    found = of(tmp_path, clause)
    assert (found.margin, found.error) == (USUAL_MARGIN, 0.0)


def test_what_a_comparison_has_passed_bounds_what_comes_after_it(tmp_path: Path) -> None:
    inverse = "G is V*V-0.1, {}, X is 1.0/G, X < -1.0."
    assert of(tmp_path, f"{EGO}, " + inverse.format("G > 0.5")).margin == USUAL_MARGIN
    # the sign of 1/G is never in doubt, however near G is to 0
    assert of(tmp_path, f"{EGO}, " + inverse.format("G > 0.0")).margin == USUAL_MARGIN


def test_a_clamp_bounds_the_error_of_what_it_cuts_off(tmp_path: Path) -> None:
    steep = "G is V*V-0.1, G > 0.0, X is (V-3.0)/G"
    free = of(tmp_path, f"{EGO}, {steep}, Y is X*0.1+V, Y*Y*Y < -1000.0.")
    cut = of(tmp_path, f"{EGO}, {steep}, Y is max(-8.0, min(3.0, X))*0.1+V, Y*Y*Y < -1000.0.")
    assert cut.margin is not None
    assert cut.margin <= 1e-5
    assert free.margin is None or free.margin > cut.margin


def test_an_infinite_error_is_said_to_be_one(tmp_path: Path) -> None:
    found = of(tmp_path, f"{EGO}, V > 60.0, exp(V*V) < 0.5.")
    assert found.margin is None
    assert found.because is not None
    assert found.because.endswith("may be off by any amount")


@pytest.mark.parametrize(
    ("clause", "counts"),
    [
        ("V > 0.0, X is 1.0 / V, X < 0.0", True),
        ("X is 1.0 / (V - 30.0), X < 0.0, fail", True),
        ("V > 0.0, X is 1.0 / (V * V + 1.0), X < 0.0", False),
        ("V > 0.5, X is 1.0 / (V * 0.1), X < 0.0", False),
        ("V > 3.0, X is V / 7.0, X < 0.0", False),
    ],
)
def test_a_divisor_that_may_be_0_counts_as_compared_with_it(
    tmp_path: Path, clause: str, counts: bool
) -> None:
    found = of(tmp_path, f"{EGO}, {clause}.")
    assert found.margin == USUAL_MARGIN
    assert found.divisors is counts
    assert found.as_json()["divisors"] is counts


@pytest.mark.parametrize(
    "clause",
    [
        "V > 1.0, D is V * 1.0e-200, X is 1.0e150 / D",  # in every scene that comes so far
        "V > 30.0, D is (V - 30.0) * 1.0e-200, X is 1.0e150 / D",
        "D is max(V, 1.0e-40), A is 1.0 / D, X is A * A * A * A * A * A * A * A",
    ],
)
def test_a_division_that_overflows_at_no_limit_has_no_margin(tmp_path: Path, clause: str) -> None:
    found = of(tmp_path, f"{EGO}, {clause}, X < 0.0.")
    assert found.margin is None
    assert found.because is not None
    assert "one.pl:2) may overflow: no margin keeps its divisor" in found.because


@pytest.mark.parametrize(
    "clause",
    [
        "D is max(V * 0.1, 1.0e-20), X is 1.0 / D, Y is (X + 1.0) - X, Y < 0.5",
        "D is max(V * 0.1, 1.0e-300), X is log(D), Y is X * X * X * X * X * X, Z is (Y + 1.0) - Y, Z < 0.999",
        "D is max(V * 0.1, 1.0e-20), X is D ** -1.0, Y is (X + 1.0) - X, Y < 0.5",
    ],
)
def test_what_no_comparison_keeps_from_0_is_as_near_to_it_as_it_may_be(tmp_path: Path, clause: str) -> None:
    assert of(tmp_path, f"{EGO}, {clause}.").margin is None  # with V = 0 each is broken in floats


@pytest.mark.parametrize("name", ["properties.pl", "dynamics.pl"])
def test_the_default_rules_have_small_margins(name: str) -> None:
    """Every property but those that ask for the braking needed holds with the usual margin."""
    steep = {
        "speed_in_limits",
        "gives_way",
        "nobody_overlooked",
        "left_is_as_right",
        "both_directions_alike",
        "can_stop_after_step",
        "can_stop_before_oncoming",
        "brakes_fully_where_it_cannot",
        "nearer_is_no_softer",
        "front_comes_so_far",
    }
    prover = Prover.of((), (RULES / name,), [one for one in properties_of(name) if one not in steep])
    found = {name: prover.floats(name, 6) for name in prover.answers}
    assert {name: floats.margin for name, floats in found.items() if floats.margin != USUAL_MARGIN} == {}
    assert all(floats.error < 1e-10 for floats in found.values())


def test_the_braking_needed_asks_for_more_room() -> None:
    found = Prover.of((), (RULES / "properties.pl",), ["gives_way"]).floats("gives_way", 6)
    assert found.margin is not None
    assert USUAL_MARGIN < found.margin <= 5e-8
    assert found.comparison is not None
    assert found.comparison.startswith("Needed =< Sure (")


def properties_of(name: str) -> list[str]:
    return list(Prover.of((), (RULES / name,)).answers)


UNKNOWNS = {"a": (0, 1), "b": (-3, 3), "c": (1, 1000), "d": (-1000000, 1000000)}
DECLARED = " ".join(
    f"unknown({name}, {low}, {high}, 'number {name}'). :- dynamic({name}/1)."
    for name, (low, high) in UNKNOWNS.items()
)
BOUND = "a(A), b(B), c(C), d(D), "


def expression(rng: random.Random, depth: int) -> str:
    if depth == 0:
        return rng.choice(["A", "B", "C", "D", "A", "B", "0.1", "0.35", "3.0", "1.0e6"])
    one, other = (expression(rng, depth - 1) for _ in range(2))
    return rng.choice(
        [
            f"({one} + {other})",
            f"({one} - {other})",
            f"({one} * {other})",
            f"({one} / (1.0 + abs({other})))",
            f"({one} / {other})",
            f"sqrt(abs({one}))",
            f"min({one}, {other})",
            f"max({one}, {other})",
            f"abs({one})",
            f"({one}) ** 2.0",
        ]
    )


def clause(rng: random.Random) -> str:
    goals = []
    for number in range(rng.randint(1, 3)):
        op = rng.choice(["<", ">", "=<", ">="])
        left, right = expression(rng, rng.randint(1, 2)), expression(rng, rng.randint(0, 1))
        goals += [f"X{number} is {left}", f"X{number} {op} {right}"]
    if rng.random() < 0.3:
        goals.append(f"( {goals[-1]} -> {expression(rng, 1)} > 0.5 ; {expression(rng, 1)} < {rng.random()} )")
    return BOUND + ", ".join(goals) + "."


def floats_say(root: Node, values: tuple[float, ...]) -> bool | None:
    return _Floats(facts(values)).truth(root)


def facts(values: Sequence[float | Fraction]) -> ExactFacts:
    return {(name, 1): [(value,)] for name, value in zip(UNKNOWNS, values, strict=True)}


def drawn(rng: random.Random) -> tuple[float, ...]:
    """Numbers within their ranges, some at an end."""
    return tuple(
        rng.choice([rng.uniform(low, high), rng.uniform(low, high), float(rng.randint(low, high))])
        for low, high in UNKNOWNS.values()
    )


def near_limits(root: Node, rng: random.Random, pairs: int) -> Iterator[tuple[float, ...]]:
    """Numbers next to where the doubles' answer changes, found by halving."""
    for _ in range(pairs):
        one, other = drawn(rng), drawn(rng)
        before, after = floats_say(root, one), floats_say(root, other)
        if before is after:
            continue
        for _ in range(70):
            middle = tuple((x + y) / 2 for x, y in zip(one, other, strict=True))
            if floats_say(root, middle) is before:
                one = middle
            else:
                other = middle
        yield one
        yield other
        for scale in (1e-15, 1e-13, 1e-11):
            yield tuple(
                min(high, max(low, value + scale * rng.uniform(-1, 1) * max(1.0, abs(value))))
                for value, (low, high) in zip(one, UNKNOWNS.values(), strict=True)
            )


def like(rng: random.Random) -> str:
    """A comparison that the order of doubles may decide, or a choice between two numbers."""
    one, other = expression(rng, 1), expression(rng, 1)
    most, least = f"min({one}, {other})", f"max({one}, {other})"
    third = rng.choice(["A", "B", "C", "0.35"])
    left, right = rng.choice([(most, one), (one, least), (most, least), (least, one), (other, one)])
    op = rng.choice(["<", ">", "=<", ">="])
    if rng.random() < 0.4:
        picked = rng.choice([f"{one} {op} {other}", f"\\+ ( {one} {op} {other}, A < 0.5 )"])
        return f"P is {one}, Q is {other}, once(( {picked}, R = P ; R = Q )), R * {third} {op} {left}."
    frames = ["{} + {}", "{} - {}", "{} * {}", "{} / {}", "{1} - {0}", "{1} - {0} * 0.1"]
    frame = rng.choice(frames)
    return f"{frame.format(left, third)} {op} {frame.format(right, third)}."


@pytest.mark.parametrize("part", range(4))
def test_what_is_put_in_for_a_condition_is_the_same_in_doubles(tmp_path: Path, part: int) -> None:
    """Conditions that are settled by order, and choices that are minima, keep their truth in every scene."""
    fewer = 0
    for seed in range(part * 40, part * 40 + 40):
        rng = random.Random(seed)
        prover = prover_of(tmp_path, BOUND + like(rng), DECLARED)
        if "q" not in prover.answers:
            continue
        found, pool = prover.answers["q"].found, prover._pools["q"]
        values = Values(pool, prover.book.ranges, 0, USUAL_MARGIN)
        made = Simplifier(pool, Order(values).settled).simplified(found, {})
        fewer += made is not found
        for numbers in [*(drawn(rng) for _ in range(30)), *near_limits(found, rng, 2)]:
            if not floats_say(prover.answers["q"].undecided, numbers):
                assert floats_say(made, numbers) is floats_say(found, numbers), (seed, numbers)
    assert fewer > 4


STEEP = (
    "B * 0.1 + D * 1.0e6 ; X is B * 0.1",
    "max(-8.0, min(3.0, (A * B - B * 0.3) / (A - 0.35)))",
    "min(7.0, C / (A * A)) * 0.1",
    "max(-1.0, min(A * B / (A - 0.1), D * D))",
    "min(sqrt(abs(A - 0.7)) * C, max(B, 1.0 / (A - 0.1)))",
    "max(-8.0, (B - A * 3.0) / (A - 0.1)) * A",
)


@pytest.mark.parametrize("steep", STEEP)
@pytest.mark.parametrize("wanted", [1e-9, 1e-6, 1e-4])
def test_no_number_is_further_off_than_its_bound(tmp_path: Path, steep: str, wanted: float) -> None:
    """Clamped quotients next to where their divisor is 0, but for the margin."""
    prover = prover_of(tmp_path, f"{BOUND}once(( A > 0.3, X is {steep} )), X > 0.01234.", DECLARED)
    answer, rng = prover.answers["q"], random.Random(1)
    values = Values(prover._pools["q"], prover.book.ranges, 0, wanted)
    node = next(one for one in reach([answer.found]) if one.op == "lt" and one.args[0].data == 0.01234)
    number = node.args[1]
    bound = values.of(number, values.start).error
    tried = 0
    for _ in range(400):
        numbers = list(drawn(rng))
        numbers[0] = rng.choice([0.1, 0.35, 0.7, 0.0]) + wanted * rng.choice(
            [1.01, 2.0, 10.0, 1e3]
        ) * rng.choice([-1, 1])
        if not 0.0 <= numbers[0] <= 1.0:
            continue
        exact = _Exact(facts(list(map(Fraction, numbers))), 500)
        exact.truth(answer.undecided)
        if min(exact.distances.values(), default=Fraction(1)) <= wanted:
            continue
        tried += 1
        real = exact.value(number)
        off = abs(Fraction(_Floats(facts(numbers)).value(number)) - real.low)
        assert off <= Fraction(bound) + (real.high - real.low)
    assert tried > 100


class Steep(Values):
    """Two numbers of which the error is given: `wild` is the more in error the further it is along `sign`."""

    def __init__(
        self, sign: float, reach: float, errors: Sequence[tuple[float, float]], tame: Approximation
    ) -> None:
        super().__init__(Pool(), RANGES, 0, 1e-9)
        one = self.pool.const(1.0)
        self.wild = self.pool.make("function", "float", (one,), "wild")
        self.tame = self.pool.make("function", "float", (one,), "tame")
        self.sign, self.reach, self.errors, self.known = sign, reach, errors, tame

    def of(self, node: Node, context: Context) -> Approximation:
        if node is self.tame:
            return self.known
        if node is not self.wild:
            return super().of(node, context)
        low, high = context.ranges.get(node, (-self.reach, self.reach))
        return Approximation(low, high, max(self.off(low), self.off(high)))

    def off(self, value: float) -> float:
        """The error of a wild number."""
        return max(error for start, error in self.errors if self.sign * value >= start)


def steep(sign: float, rng: random.Random) -> Steep:
    """A wild number whose error has a jump, often where it matters: next to the tame one."""
    middle, width = rng.uniform(-20.0, 20.0), rng.choice([0.0, 1.0, 5.0])
    tame = Approximation(middle - width / 2, middle + width / 2, rng.choice([0.0, 1e-3, 0.5]))
    edge = sign * middle + width / 2
    start = edge + rng.choice([rng.random(), 10 ** rng.uniform(0, 7), -1.0])
    jump = rng.choice([0.5, 2.0, 0.5 * abs(start), 3.0 * abs(start), 1e6])
    errors = [(-math.inf, 10 ** rng.uniform(-6, 0)), (start, jump)]
    return Steep(sign, 10 ** rng.uniform(2, 8), errors, tame)


@pytest.mark.parametrize(("op", "sign"), [("min", 1.0), ("max", -1.0)])
def test_a_clamp_is_off_by_no_more_than_its_bound_wherever_its_wild_side_is(op: str, sign: float) -> None:
    """What is cut off does no harm only while it is further from the limit than it is in error."""
    rng, pick, less = random.Random(3), {"min": min, "max": max}[op], 0
    for _ in range(300):
        values = steep(sign, rng)
        tame = values.known
        clamp = values.pool.make(op, "float", (values.wild, values.tame))
        bound = values.of(clamp, values.start).error
        less += bound < values.off(sign * values.reach)
        edges = [sign * tame.low, sign * tame.high, values.errors[1][0]]
        places = [edge + step for edge in edges for step in (0.0, 1e-9, 0.5, 1.0, 8.0)]
        places += [10 ** rng.uniform(-2, 8) for _ in range(20)]
        for wild, known in product((sign * place for place in places), (tame.low, tame.high)):
            off = values.off(wild)
            if abs(wild) <= values.reach:
                doubles = product((wild - off, wild + off), (known - tame.error, known + tame.error))
                worst = max(abs(pick(pair) - pick(wild, known)) for pair in doubles)
                assert worst <= bound + 1e-6  # which the sums here may be off by
    assert less > 15


def disagreements(folder: Path, seed: int, pairs: int) -> tuple[int, int]:
    """How many numbers exact arithmetic judges unlike doubles; none further off than the margin says."""
    rng = random.Random(seed)
    prover = prover_of(folder, clause(rng), DECLARED)
    if "q" not in prover.answers:
        return 0, 0
    margin = prover.floats("q", 0).margin
    answer, seen, unlike = prover.answers["q"], 0, 0
    with deep_recursion():
        for values in [*near_limits(answer.found, rng, pairs), *near_limits(answer.undecided, rng, pairs)]:
            seen += 1
            # a number without a value, or a division that may overflow, is what the property is broken by
            root = answer.undecided if floats_say(answer.undecided, values) else answer.found
            verdict = judge(root, facts(list(map(Fraction, values))), facts(values))
            if verdict.holds is None or verdict.holds is floats_say(root, values):
                continue
            unlike += 1
            assert margin is None or verdict.amount is None or verdict.amount <= margin, (seed, values)
    return seen, unlike


def test_no_program_goes_otherwise_in_doubles_outside_its_margin(tmp_path: Path) -> None:
    found = [disagreements(tmp_path, seed, 12) for seed in range(120)]
    seen, unlike = map(sum, zip(*found, strict=True))
    assert seen > 1000
    assert unlike > 50  # so near to limits that doubles often judge otherwise


@pytest.mark.slow
def test_no_program_of_many_goes_otherwise(tmp_path: Path) -> None:
    found = [disagreements(tmp_path, seed, 60) for seed in range(1000, 4000)]
    assert sum(unlike for _, unlike in found) > 5000
