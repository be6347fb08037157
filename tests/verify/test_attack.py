"""Scenes by the hundred thousand against what is said to be proved: what they find, and how it is judged."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from drlsl.driving.scene import EGO
from drlsl.driving.shield import default_rules
from drlsl.lowering.backends import ArrayProgram, compile_numpy
from drlsl.lowering.frontend import Answer, deep_recursion, lower
from drlsl.lowering.ir import NotLowerable
from drlsl.verify import Case
from drlsl.verify.attack import Attack, Orders, attack
from drlsl.verify.attack.closeness import Closeness
from drlsl.verify.attack.exact import judge
from drlsl.verify.attack.sampled_facts import array_facts, exact_facts, float_facts, scene_of
from drlsl.verify.attack.sampling import Drawn, Layout, draw
from drlsl.verify.properties import Book, load
from drlsl.verify.ranges import all_cases
from tests.verify.test_dynamics import DYNAMICS, MOTION_SLIPS, SLIPS, changed
from tests.verify.test_prove import MUTANTS, mutated

RULES = default_rules()[0].parent
EGO_SPEED = "vehicle(ego, _, _, _, V, _, _, _)"
ONE_WAY = (Case(0, 2, 1, 1), Case(0, 2, 2, 1))


def broken(folder: Path, body: str, scenes: int = 30_000, extra: str = "", vehicles: int = 3) -> Attack:
    """What the attack finds of ``violates(p) :- body``."""
    path = folder / "p.pl"
    path.write_text(f"{extra}\nproperty(p, 'p').\nviolates(p) :- {body}.\n", encoding="utf-8")
    book = load([], [path])
    return attack(book, book.properties[0], Orders(ONE_WAY, vehicles, scenes))


def books() -> list[tuple[str, Book]]:
    return [
        ("highway", load([])),
        ("dynamics", load([], [RULES / "dynamics.pl"])),
        ("paper", load([RULES / "paper.pl"])),
    ]


def programs(book: Book) -> list[tuple[str, Answer, ArrayProgram]]:
    found = []
    for one in book.properties:
        try:
            with deep_recursion():
                lowered = lower(book.engine, book.facts, [one.query])
        except NotLowerable:
            continue
        found.append((one.name, lowered.answers[0], compile_numpy(lowered)))
    return found


def drawn(book: Book, count: int, seed: int = 7) -> tuple[Layout, Drawn]:
    layout = Layout(all_cases(), book.ranges, 4, unknowns=book.unknowns)
    return layout, draw(layout, np.random.default_rng(seed), count)


def test_drawn_scenes_are_scenes_that_proofs_are_about() -> None:
    layout, scenes = drawn(load([]), 400)
    outside = 0
    for place in range(len(scenes)):
        one = scenes.take(slice(place, place + 1))
        scene, focus, _ = scene_of(layout, one)
        exact = exact_facts(layout, one)
        outside += exact is None
        assert scene.in_range() == scene.vehicles
        assert focus == "none" or focus in {car.id for car in scene.vehicles}
        for before, after in zip(scene.road.lanes, scene.road.lanes[1:], strict=False):
            touching = before.centre + before.width / 2 == after.centre - after.width / 2
            assert touching or before.direction is not after.direction
        if exact is not None:
            floats = float_facts(scene, focus, {})
            for key, rows in exact.items():
                for row, told in zip(rows, floats[key], strict=True):
                    for cell, other in zip(row, told, strict=True):
                        if isinstance(cell, Fraction):
                            assert abs(cell - Fraction(other)) <= Fraction(2, 2**40)
                        else:
                            assert cell == other
    assert outside <= 4


def test_where_lanes_end_is_told_alike_in_arrays_scenes_and_exact_numbers() -> None:
    layout = Layout(all_cases(), load([]).ranges, 1, ends=True)
    scenes = draw(layout, np.random.default_rng(3), 400)
    codes: dict[str, int] = {}
    rows = array_facts(layout, scenes, lambda atom: codes.setdefault(atom, len(codes)))["lane_end", 2]
    (lanes, places), valid = rows.columns, rows.valid
    assert lanes is not None
    assert places is not None
    assert valid is not None
    near, counts = 0, set()
    for place in range(len(scenes)):
        one = scenes.take(slice(place, place + 1))
        scene, focus, _ = scene_of(layout, one)
        ends = {lane.id: lane.end for lane in scene.road.lanes if lane.end is not None}
        there = np.flatnonzero(valid[place])
        assert ends == {int(lanes[place, n]): places[place, n] for n in there}
        told, exact = float_facts(scene, focus, {})["lane_end", 2], exact_facts(layout, one)
        assert dict(told) == ends
        if exact is not None:
            for (lane, end), (other, number) in zip(exact["lane_end", 2], told, strict=True):
                assert lane == other
                assert abs(end - Fraction(number)) <= Fraction(2, 2**40)
        rooms = [scene.forward * (end - scene.ego.x) - scene.ego.length / 2 for end in ends.values()]
        near += any(0.0 < room < 50.0 for room in rooms)
        counts.add(len(ends))
    assert near > 100
    assert counts >= {0, 1, 2, 3}


def test_edges_and_typical_numbers_are_drawn() -> None:
    layout, scenes = drawn(load([]), 4000)
    for column, (low, high) in enumerate(zip(layout.low, layout.high, strict=True)):
        if layout.kinds[column] not in ("ahead", "right", "aside"):
            assert (scenes.numbers[:, column] == low).any()
            assert (scenes.numbers[:, column] == high).any()
    counts = np.bincount(scenes.present.sum(axis=1), minlength=5)
    assert (counts > 500).all()


def test_vehicles_may_have_names_of_the_program() -> None:
    layout = Layout(ONE_WAY, load([]).ranges, 3, names=("truck", "bus"))
    scenes = draw(layout, np.random.default_rng(1), 3000)
    for place in range(200):
        scene, _, _ = scene_of(layout, scenes.take(slice(place, place + 1)))
        names = [EGO, *(car.id for car in scene.vehicles)]
        assert len(names) == len(set(names))
    assert {-1, 0, 1} <= set(scenes.named.ravel().tolist())


@pytest.mark.parametrize("place", range(3), ids=["highway", "dynamics", "paper"])
def test_distances_are_0_exactly_where_the_array_tier_says_so(place: int) -> None:
    _, book = books()[place]
    layout, scenes = drawn(book, 1500)
    hits = 0
    for name, answer, program in programs(book):
        facts = array_facts(layout, scenes, program.code)
        result = program({key: rows for key, rows in facts.items() if key in program.reads} or facts)
        decided = ~result.undecided
        for wanted in (True, False):
            close = Closeness([[answer.found]], program.code, wanted=wanted)
            (holds,) = close.distances(facts, len(scenes)) == 0
            assert (holds == (result.answers[0].value == wanted))[decided].all(), name
        hits += int(result.answers[0].value.sum())
    assert hits == 0 or book.engine.defines("front_is_free", 0)


@pytest.mark.parametrize("place", range(3), ids=["highway", "dynamics", "paper"])
def test_exact_arithmetic_agrees_with_floats_but_at_limits(place: int) -> None:
    _, book = books()[place]
    layout, scenes = drawn(book, 12)
    judged = 0
    for name, answer, program in programs(book):
        facts = array_facts(layout, scenes, program.code)
        result = program({key: rows for key, rows in facts.items() if key in program.reads} or facts)
        for number in range(len(scenes)):
            one = scenes.take(slice(number, number + 1))
            exact = exact_facts(layout, one)
            if exact is None or result.undecided[number]:
                continue
            verdict = judge(answer.found, exact, float_facts(*scene_of(layout, one)))
            if verdict.holds is None:
                continue  # two roots that are equal
            judged += 1
            if verdict.holds is not bool(result.answers[0].value[number]):
                assert verdict.amount is not None, name
                assert verdict.amount < Fraction(1, 10**9), name
    assert judged > 100


@pytest.mark.parametrize(
    "body",
    [
        f"{EGO_SPEED}, S is V * V, S > 0.0, S < 50.0, X is 1.0 / sqrt(S), X > 10.0",
        f"{EGO_SPEED}, V > 0.0, (1 / sqrt(V)) * (1 / sqrt(V)) > 10",
        "vehicle(truck, _, _, _, _, _, _, _)",
        f"{EGO_SPEED}, abs(V - 31.4159265358) < 1.0e-9",
        "vehicle(A, _, X, _, _, _, _, _), vehicle(B, _, Y, _, _, _, _, _), A \\== B, B \\== ego, A \\== ego, "
        "abs(X - Y - 12.345) < 1.0e-7",
        "aggregate_all(count, vehicle(_, _, _, _, _, _, _, _), 4)",
        "road_lane(1, _, _, W, _), W =:= 5.0, road_lane(2, _, _, W2, _), W2 < 2.6",
        "time_step(T), radar_range(R), abs(T * R - 31.25) < 1.0e-6",
    ],
)
def test_what_breaks_a_property_is_found_and_confirmed_exactly(tmp_path: Path, body: str) -> None:
    result = broken(tmp_path, body)
    assert result.hit is not None
    assert result.hit.kind == "exact"


@pytest.mark.parametrize("term", ["exp(20.0 * V)", "V ** 200.0", "acos(V)", "1 / (V - 12.5)", "log(V - 3.5)"])
def test_what_raises_an_error_is_found_and_confirmed_exactly(tmp_path: Path, term: str) -> None:
    result = broken(tmp_path, f"{EGO_SPEED}, {term} < -1.0e250, fail")
    assert result.hit is not None
    assert result.hit.kind == "exact"
    assert result.hit.counterexample.error is not None
    assert result.undecided >= result.asked > 0


def test_what_only_floats_break_is_told_with_its_amount(tmp_path: Path) -> None:
    result = broken(tmp_path, f"{EGO_SPEED}, V > 1.0, X is (V + 1.0e17) - 1.0e17, X =< 0.5", 6000)
    assert result.hit is not None
    assert result.hit.kind == "float"
    assert result.hit.amount is not None
    assert result.hit.amount > Fraction(1, 2)
    assert result.hit.as_json()["amount"] == float(result.hit.amount)
    slight = broken(tmp_path, f"{EGO_SPEED}, X is V * 0.1 * 10.0, X > V", 6000)
    assert slight.hit is not None
    assert slight.hit.kind == "float"
    assert slight.hit.amount == 0


@pytest.mark.parametrize(
    ("goals", "amount"),
    [
        ("V > 0.0, X is 1.0 / V", 1e-300),
        ("V > 0.0, D is V * V * V * V, X is 1.0 / D", 1e-300),  # in floats it is 0
        ("V > 0.0, A is 1.0 / V, X is A * A * A * A * A * A * A * A", 1e-38),
        ("V > 1.0, D is V * 1.0e-200, X is 1.0e150 / D", 1e-198),
    ],
)
def test_what_overflows_next_to_0_breaks_a_property_in_floats_only(
    tmp_path: Path, goals: str, amount: float
) -> None:
    for last in ("X < 0.0", "fail"):
        hit = broken(tmp_path, f"{EGO_SPEED}, {goals}, {last}", 6000).hit
        assert hit is not None
        assert (hit.kind, hit.counterexample.error is None) == ("float", False)
        assert hit.amount is not None
        assert 0 < hit.amount <= amount


def test_what_holds_is_not_broken_and_the_reader_sees_how_near_scenes_came(tmp_path: Path) -> None:
    result = broken(tmp_path, f"{EGO_SPEED}, V > 69.0, V > 70.0", 20_000)
    assert result.hit is None
    assert result.scenes == 20_000
    assert 0 < result.close < result.near < result.scenes
    never = broken(tmp_path, f"{EGO_SPEED}, V > 71.0, V > 0.0", 4000)
    assert (never.hit, never.near, never.close) == (None, 0, 0)


def test_the_same_orders_try_the_same_scenes(tmp_path: Path) -> None:
    body = f"{EGO_SPEED}, vehicle(C, _, _, _, W, _, _, _), C \\== ego, W > V, V > 69.9, W > 70.0"
    first, second = (broken(tmp_path, body, 9000) for _ in range(2))
    assert (first.near, first.broken) == (second.near, second.broken)
    book = load([], [tmp_path / "p.pl"])
    other = attack(book, book.properties[0], Orders(ONE_WAY, 3, 9000, seed=1))
    assert other.near != first.near


def test_the_default_rules_hold_out() -> None:
    book = load([])
    for one in book.properties[3:8]:
        result = attack(book, one, Orders(ONE_WAY, 4, 6000))
        assert result.hit is None, one.name
        assert result.near > 0


SOME_ERRORS = (
    "missing vehicle: all but the first",
    "half the braking needed",
    "a front vehicle that comes too far",
)
ERRORS = [
    pytest.param(kind, marks=() if kind in SOME_ERRORS else pytest.mark.slow)
    for kind in (*MUTANTS, *SLIPS, *MOTION_SLIPS)
]


@pytest.mark.parametrize("kind", ERRORS)
def test_errors_in_the_rules_are_found_without_a_solver(tmp_path: Path, kind: str) -> None:
    if kind in MUTANTS:
        name, changes = MUTANTS[kind]
        book = load([mutated(tmp_path, changes)])
    elif kind in SLIPS:
        name, old, new = SLIPS[kind]
        changed(tmp_path, old, new, ("highway.pl", "longitudinal.pl", "observation.pl"))
        book = load([tmp_path / "highway.pl"], [DYNAMICS])
    else:
        name, old, new = MOTION_SLIPS[kind]
        changed(tmp_path, old, new, ("dynamics.pl", "spec.pl"))
        book = load([], [tmp_path / "dynamics.pl"])
    prop = next(one for one in book.properties if one.name == name)
    result = attack(book, prop, Orders(all_cases(), 6))
    assert result.hit is not None
    assert result.hit.kind == "exact"
