"""The least change that makes an action offered, or no longer: against closed forms, and against trying."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, given, settings

from drlsl.counterfactual import Answer, Finding, what_if
from drlsl.driving.scene import Action, Scene, Vehicle, load_scene
from drlsl.driving.shield import RuleFailure, Shield, default_rules
from drlsl.driving.shield.compiled import ScalarTier
from drlsl.errors import UserError
from tests.scenes import road, scenes, turned

RULES = default_rules()[0].parent
LEFT, RIGHT = Action.LEFT_LANE_CHANGE, Action.RIGHT_LANE_CHANGE
FINE = 3e-6
"""How far a least change may be from the true one."""

STEPS = 24
"""Smaller changes that are tried."""


@cache
def shield(name: str = "highway.pl") -> Shield:
    return Shield.from_files([RULES / name])


def car(name: str, lane: int, x: float, speed: float, *, on: Scene | None = None) -> Vehicle:
    """A vehicle in the middle of a lane of `plain()`'s road, or `on`'s."""
    own = (on or plain()).road.lane(lane)
    assert own is not None
    return Vehicle(name, lane, x, own.centre, own.direction.sign * speed, 0.0, 4.6, 1.9)


def plain(*vehicles: Vehicle, lanes: int = 2, speed: float = 30.0, lane: int = 2) -> Scene:
    """A one-way road with the ego at 0 in its lane, the lowest of two if not said otherwise."""
    on = road(0, lanes)
    centre = on.lanes[lane - 1].centre
    return Scene(on, Vehicle("ego", lane, 0.0, centre, speed, 0.0, 4.6, 1.9), vehicles, lane)


def ask(scene: Scene, action: Action, name: str = "highway.pl") -> Answer:
    (answer,) = what_if(shield(name), scene, [action])
    return answer


def sole(finding: Finding | None) -> tuple[str, str, float]:
    """The one vehicle that changes, the quantity, and by how much."""
    assert finding is not None
    assert finding.status == "found", finding
    (change,) = finding.changes
    return change.vehicle, change.quantity, change.change


def needed(rear: float, front: float) -> float:
    """RSS, Definition 1, with the parameters of highway.pl, and the room kept at standstill."""
    after = rear + 3.0 * 0.35
    return max(0.0, rear * 0.35 + 3.0 * 0.35**2 / 2 + after**2 / 12.0 - front**2 / 16.0) + 2.0


def test_a_follower_that_is_too_close() -> None:
    scene = plain(car("v", 1, -40.0, 33.0))
    answer = ask(scene, LEFT)
    assert not answer.offered
    missing = needed(33.0, 30.0) - (40.0 - 4.6)
    assert answer.gap.least == pytest.approx(missing, abs=FINE)
    assert sole(answer.gap) == ("v", "x", -math.ceil(10 * missing) / 10)
    assert answer.gap_without_passing is None

    # (v + 1.05)^2 / 12 + 0.35 v = gap - 2 - 0.18375 + 30^2 / 16, for the rear speed
    right = 35.4 - 2.0 - 0.18375 + 900 / 16
    half = 1.05 + 0.35 * 6
    slower = 33.0 - (-half + math.sqrt(half**2 - 1.05**2 + 12 * right))
    assert answer.speed.least == pytest.approx(slower, abs=FINE)
    assert sole(answer.speed) == ("v", "vx", -math.ceil(10 * slower) / 10)

    faster = math.sqrt(16 * (needed(33.0, 0.0) - 35.4)) - 30.0
    assert answer.ego_speed.least == pytest.approx(faster, abs=FINE)
    assert sole(answer.ego_speed) == ("ego", "vx", math.ceil(10 * faster) / 10)
    assert answer.gaps is None


def test_a_lane_change_that_is_offered() -> None:
    scene = plain(car("near", 1, 60.0, 29.0), car("far", 1, -95.0, 31.0))
    answer = ask(scene, LEFT)
    assert answer.offered
    closer = (60.0 - 4.6) - needed(30.0, 29.0)
    assert closer < (95.0 - 4.6) - needed(31.0, 30.0)
    assert answer.gap.least == pytest.approx(closer, abs=FINE)
    assert sole(answer.gap) == ("near", "x", -math.ceil(10 * closer) / 10)
    assert answer.gap.changes[0].after == 60.0 + answer.gap.changes[0].change


def test_the_least_of_several_vehicles() -> None:
    """Not the nearest vehicle, but the one that needs to move least."""
    scene = plain(car("near", 1, 56.0, 30.0), car("far", 1, -57.0, 31.0))
    answer = ask(scene, LEFT)
    ahead, behind = (56.0 - 4.6) - needed(30.0, 30.0), (57.0 - 4.6) - needed(31.0, 30.0)
    assert ahead / 2 < behind < ahead
    assert answer.gap.least == pytest.approx(behind, abs=FINE)
    assert sole(answer.gap)[0] == "far"


def test_a_fast_follower_may_as_well_have_passed() -> None:
    scene = plain(car("v", 1, -20.0, 38.0))
    answer = ask(scene, LEFT)
    # in front of the ego it needs little, as it is faster
    assert answer.gap.least == pytest.approx(20.0 + 4.6 + needed(30.0, 38.0), abs=FINE)
    behind = needed(38.0, 30.0) - (20.0 - 4.6)
    assert answer.gap_without_passing is not None
    assert answer.gap_without_passing.least == pytest.approx(behind, abs=FINE)
    assert sole(answer.gap_without_passing)[2] < 0 < sole(answer.gap)[2]


def test_a_slow_leader_may_as_well_be_behind() -> None:
    answer = ask(plain(car("v", 1, 10.0, 15.0)), LEFT)
    assert answer.gap.least == pytest.approx(10.0 + 4.6 + needed(15.0, 30.0), abs=FINE)
    ahead = needed(30.0, 15.0) - (10.0 - 4.6)
    assert answer.gap_without_passing is not None
    assert answer.gap_without_passing.least == pytest.approx(ahead, abs=FINE)
    assert sole(answer.gap)[2] < 0 < sole(answer.gap_without_passing)[2]


def test_a_vehicle_out_of_sight_objects_no_more() -> None:
    scene = plain(car("v", 1, -98.0, 45.0), speed=20.0)
    answer = ask(scene, LEFT)
    (change,) = answer.gap.changes
    assert change.out_of_sight
    aside = scene.road.lanes[1].centre - scene.road.lanes[0].centre
    assert answer.gap.least == pytest.approx(math.sqrt(100.0**2 - aside**2) - 98.0, abs=FINE)


def test_two_that_object_must_both_be_elsewhere() -> None:
    scene = plain(car("front", 1, 20.0, 29.0), car("back", 1, -30.0, 33.0))
    answer = ask(scene, LEFT)
    assert {answer.gap.status, answer.speed.status} == {"none"}
    forward = needed(30.0, 29.0) - (20.0 - 4.6)
    backward = needed(33.0, 30.0) - (30.0 - 4.6)
    assert answer.gaps is not None
    assert answer.gaps.least == pytest.approx(forward + backward, abs=FINE)
    assert [(one.vehicle, one.change) for one in answer.gaps.changes] == [
        ("front", math.ceil(10 * forward) / 10),
        ("back", -math.ceil(10 * backward) / 10),
    ]
    assert answer.gaps.scene is not None
    assert LEFT in shield().decide(answer.gaps.scene).safe_actions


def test_no_lane_and_a_lane_change_under_way_are_nobodys_fault() -> None:
    for scene, action in [
        (plain(car("v", 1, -30.0, 33.0)), RIGHT),
        (replace(plain(car("v", 1, -30.0, 33.0)), target_lane=1), LEFT),
    ]:
        answer = ask(scene, action)
        assert not answer.offered
        assert {answer.gap.status, answer.speed.status, answer.ego_speed.status} == {"none"}
        assert answer.gaps is None


def test_keeping_the_lane_is_always_offered() -> None:
    answer = ask(plain(car("v", 2, 8.0, 0.0)), Action.LANE_KEEPING)
    assert answer.offered
    assert all(one is None or one.status == "none" for one in answer.findings().values())


def test_no_vehicle_is_moved_onto_another() -> None:
    scene = plain(car("v", 1, -40.0, 33.0), car("w", 1, -57.0, 28.0))
    missing = needed(33.0, 30.0) - (40.0 - 4.6)
    assert abs(-40.0 - missing + 57.0) < 4.6
    answer = ask(scene, LEFT)
    assert answer.gap.least == pytest.approx(57.0 + 4.6 - 40.0, abs=FINE)  # behind w
    apart = replace(scene, vehicles=(scene.vehicles[0], scene.vehicles[1]._replace(y=-20.0)))
    assert ask(apart, LEFT).gap.least == pytest.approx(missing, abs=FINE)


def test_a_scene_that_only_rounding_decides() -> None:
    """8.3 m is alongside by exact numbers, and 208.3 m - 200 m is more than that in floating point."""
    touching = car("v", 1, 208.3, 0.0)._replace(length=12.0)
    scene = plain(touching, speed=0.0)
    answer = ask(replace(scene, ego=scene.ego._replace(x=200.0)), LEFT, "paper.pl")
    assert answer.offered
    assert sole(answer.gap)[2] == -0.001
    assert answer.speed.status == "unknown"
    assert "rounding limit" in answer.speed.reason


def test_a_gap_at_the_limit() -> None:
    """Where the gap is exactly the needed one, the least change is next to nothing, and still confirmed."""
    scene = plain(car("v", 1, 4.6 + 2.0, 38.0), speed=25.0)
    answer = ask(scene, LEFT)
    assert answer.gap.least == pytest.approx(0.0, abs=FINE)
    assert abs(sole(answer.gap)[2]) <= 1e-3


def test_both_directions_alike() -> None:
    scene = load_scene(RULES.parent / "examples" / "scene.json")
    here, there = (what_if(shield(), one) for one in (scene, turned(scene)))
    for one, other in zip(here, there, strict=True):
        assert one.offered == other.offered
        for kind, finding in one.findings().items():
            same = other.findings()[kind]
            if finding is None or same is None:
                assert finding is same
                continue
            assert (finding.status, finding.least) == (same.status, same.least)
            assert [(change.vehicle, change.change) for change in finding.changes] == [
                (change.vehicle, change.change) for change in same.changes
            ]


def moved(scene: Scene, name: str, quantity: str, amount: float) -> Scene | None:
    """The scene with one number moved in its direction; None where vehicles would come to touch."""
    cars = {one.id: one for one in (scene.ego, *scene.vehicles)}
    own = scene.road.lane(scene.ego.lane)
    assert own is not None
    one = cars[name]
    if quantity == "x":
        one = one._replace(x=one.x + own.direction.sign * amount)
        for other in cars.values():
            if other.id != name and touch(one, other) and not touch(cars[name], other):
                return None
    else:
        sign = math.copysign(1.0, one.vx)
        if not 0.0 <= abs(one.vx) + amount <= 70.0:
            return None
        one = one._replace(vx=one.vx + sign * amount)
    cars[name] = one
    ego, *others = cars.values()
    return replace(scene, ego=ego, vehicles=tuple(others))


def touch(one: Vehicle, other: Vehicle) -> bool:
    """Whether two boxes touch, or nearly: to be on the safe side of rounding."""
    return (
        abs(one.x - other.x) <= (one.length + other.length) / 2 + 1e-9
        and abs(one.y - other.y) <= (one.width + other.width) / 2 + 1e-9
    )


def smaller(scene: Scene, kind: str, below: float) -> Iterator[Scene]:
    """Scenes with one number changed by less than `below`, in equal steps up to it."""
    quantity = "x" if kind == "gap" else "vx"
    names = ["ego"] if kind == "ego_speed" else [one.id for one in scene.in_range()]
    if quantity == "vx":
        names = [name for name in names if (scene.ego if name == "ego" else found(scene, name)).vx]
    for name in names:
        for step in range(1, STEPS + 1):
            for sign in (1.0, -1.0):
                other = moved(scene, name, quantity, sign * (0.99 * below - FINE) * step / STEPS)
                if other is not None and below > 2 * FINE:
                    yield other


def found(scene: Scene, name: str) -> Vehicle:
    return next(one for one in scene.vehicles if one.id == name)


@cache
def oracle(name: str) -> ScalarTier:
    """Generated code: a second opinion, and quick."""
    return ScalarTier(shield(name).engine, shield(name).observation)


def offers(name: str, scene: Scene, action: Action) -> bool:
    return action in oracle(name).decide_scene(scene).safe_actions


MOST = {"gap": 205.0, "speed": 70.0, "ego_speed": 70.0}


def check_against_trying(scene: Scene, name: str) -> None:
    for answer in what_if(shield(name), scene, [LEFT, RIGHT]):
        assert answer.offered == (answer.action in shield(name).decide(scene).safe_actions)
        for kind in ("gap", "speed", "ego_speed"):
            finding = answer.findings()[kind]
            assert finding is not None
            assert finding.status in ("found", "none"), finding
            below = MOST[kind] if finding.least is None else finding.least
            for other in smaller(scene, kind, below):
                assert offers(name, other, answer.action) == answer.offered, (kind, finding)
        for finding in answer.findings().values():
            if finding is not None and finding.scene is not None:
                check_confirmed(scene, answer, finding, name)


def check_confirmed(scene: Scene, answer: Answer, finding: Finding, name: str) -> None:
    """The changed scene decides otherwise, and differs in what is said alone."""
    assert finding.scene is not None
    assert (answer.action in shield(name).decide(finding.scene).safe_actions) is not answer.offered
    again = {one.id: one for one in (scene.ego, *scene.vehicles)}
    for change in finding.changes:
        one = again[change.vehicle]
        assert getattr(one, change.quantity) == change.before
        value: dict[str, Any] = {change.quantity: change.after}
        again[one.id] = one._replace(**value)
        assert change.out_of_sight == (one.id not in {"ego", *(car.id for car in finding.scene.in_range())})
    assert [finding.scene.ego, *finding.scene.vehicles] == list(again.values())
    assert finding.least is not None
    total = sum(abs(change.change) for change in finding.changes)
    assert finding.least - FINE <= total <= max(1.05 * finding.least + FINE, finding.least + 2e-3)


def nudged(scene: Scene) -> Scene:
    """The scene with nobody exactly at a limit, where rounding would decide and not the rules."""
    vehicles = tuple(
        one._replace(x=one.x + 0.0137 * number, y=one.y + 0.0031 * number)
        for number, one in enumerate(scene.vehicles, start=1)
    )
    return replace(scene, vehicles=vehicles)


TRY = settings(
    max_examples=12,
    deadline=None,
    suppress_health_check=list(HealthCheck),
    phases=[Phase.explicit, Phase.reuse, Phase.generate],  # a scene says enough, and shrinking takes minutes
)


@TRY
@given(scene=scenes(most=5))
def test_nothing_smaller_does_it(scene: Scene) -> None:
    check_against_trying(nudged(scene), "highway.pl")


@TRY
@given(scene=scenes(most=4))
def test_nothing_smaller_does_it_by_the_published_rules(scene: Scene) -> None:
    check_against_trying(nudged(scene), "paper.pl")


@pytest.mark.slow
@settings(TRY, max_examples=150)
@given(scene=scenes(most=8))
def test_nothing_smaller_does_it_in_many_scenes(scene: Scene) -> None:
    check_against_trying(nudged(scene), "highway.pl")
    check_against_trying(nudged(scene), "paper.pl")


REST = (
    "front_is_free. longitudinal_velocity(20.0). entry_is_safe. state([0, 0, 0, 0, 0, 0, 0, 0, 0, 0]).\n"
    ":- dynamic(vehicle/8).\nsafe_actions(lane_keeping).\n"
)


def program(tmp_path: Path, text: str) -> Shield:
    path = tmp_path / "mine.pl"
    path.write_text(REST + text, encoding="utf-8")
    return Shield.from_files([path])


def test_any_rules_that_can_be_lowered(tmp_path: Path) -> None:
    rules = program(
        tmp_path,
        ":- discontiguous(safe_actions/1).\n"
        "safe_actions(left_lane_change) :- vehicle(ego, _, X, _, V, _, _, _), "
        "\\+ ( vehicle(C, _, Y, _, _, _, _, _), C \\== ego, abs(X - Y) / V < 2.0 ).\n",
    )
    (answer,) = what_if(rules, plain(car("v", 1, 30.0, 20.0), speed=20.0), [LEFT])
    assert sole(answer.gap) == ("v", "x", 10.0) or sole(answer.gap) == ("v", "x", 10.1)
    assert answer.gap.least == pytest.approx(10.0, abs=FINE)
    assert answer.speed.status == "none"
    assert answer.ego_speed.least == pytest.approx(5.0, abs=FINE)


def test_a_function_that_the_solver_does_not_know_is_confirmed_or_unknown(tmp_path: Path) -> None:
    rules = program(
        tmp_path,
        "safe_actions(left_lane_change) :- vehicle(v, _, X, _, _, _, _, _), 0 is truncate(X) mod 7.\n",
    )
    scene = plain(car("v", 1, 30.0, 20.0))
    (answer,) = what_if(rules, scene, [LEFT])
    assert answer.gap.status == "unknown"
    assert "do not confirm" in answer.gap.reason
    assert not answer.gap.changes


def test_an_error_nearer_than_the_change_is_said(tmp_path: Path) -> None:
    rules = program(
        tmp_path,
        "safe_actions(left_lane_change) :- "
        "vehicle(v, _, X, _, _, _, _, _), 1.0 / (X - 31.0) < 5.0, X > 40.0.\n",
    )
    (answer,) = what_if(rules, plain(car("v", 1, 30.0, 20.0)), [LEFT])
    assert sole(answer.gap) == ("v", "x", 10.1)
    assert answer.gap.least == pytest.approx(10.0, abs=FINE)
    assert answer.gap.reason == "at a change of 1 the rules may raise an error"
    assert answer.speed.status == "none"


def test_an_error_is_not_the_other_decision(tmp_path: Path) -> None:
    rules = program(
        tmp_path,
        "safe_actions(left_lane_change) :- vehicle(v, _, X, _, _, _, _, _), abs(1.0 / (X - 31.0)) > 0.001.\n",
    )
    (answer,) = what_if(rules, plain(car("v", 1, 30.0, 20.0)), [LEFT])
    assert answer.offered
    assert answer.gap.changes[0].out_of_sight
    assert answer.gap.least == pytest.approx(math.sqrt(100.0**2 - 3.5**2) - 30.0, abs=FINE)
    assert answer.gap.reason == "at a change of 1 the rules may raise an error"


def test_where_there_is_only_an_error_nobody_knows(tmp_path: Path) -> None:
    rules = program(
        tmp_path,
        "safe_actions(left_lane_change) :- "
        "vehicle(v, _, X, _, _, _, _, _), 1.0 / (X - 31.0) < 5.0, X > 999.0.\n",
    )
    (answer,) = what_if(rules, plain(car("v", 1, 30.0, 20.0)), [LEFT])
    assert (answer.gap.status, answer.gap.changes) == ("unknown", ())
    assert answer.gap.reason == "at a change of 1 the rules may raise an error"


def test_speeds_keep_their_direction_and_end_somewhere(tmp_path: Path) -> None:
    rules = program(
        tmp_path,
        "safe_actions(left_lane_change) :- vehicle(C, _, _, _, V, _, _, _), C \\== ego, V < -1.0.\n"
        "safe_actions(right_lane_change) :- vehicle(C, _, _, _, V, _, _, _), C \\== ego, V > 70.0.\n",
    )
    scene = plain(car("v", 1, 30.0, 20.0))
    for answer in what_if(rules, scene, [LEFT, RIGHT]):
        assert answer.speed.status == "none"
    coming = replace(scene, vehicles=(scene.vehicles[0]._replace(vx=-0.5),))
    left, right = what_if(rules, coming, [LEFT, RIGHT])
    assert sole(left.speed) == ("v", "vx", 0.51)
    assert left.speed.changes[0].after == -1.01
    assert right.speed.status == "none"


def test_time_that_runs_out_is_said() -> None:
    (answer,) = what_if(shield(), plain(car("v", 1, -40.0, 33.0)), [LEFT], time_limit=1e-9)
    assert (answer.gap.status, answer.gap.reason) == ("unknown", "the time limit")
    assert not answer.gap.changes
    assert answer.ego_speed.status == "unknown"


def test_rules_that_cannot_be_lowered_are_refused(tmp_path: Path) -> None:
    rules = program(tmp_path, "safe_actions(left_lane_change) :- nb_setval(n, 1).\n")
    with pytest.raises(UserError, match=r"rules that can be lowered: .*mine\.pl:4: .*nb_setval"):
        what_if(rules, plain(), [LEFT])


def test_rules_that_fail_in_the_scene_are_refused(tmp_path: Path) -> None:
    rules = program(
        tmp_path,
        "safe_actions(left_lane_change) :- vehicle(ego, _, _, _, V, _, _, _), 1 / (V - 30.0) > 1.\n",
    )
    with pytest.raises(RuleFailure, match="zero_divisor"):
        what_if(rules, plain(), [LEFT])


def test_vehicles_need_names_of_their_own() -> None:
    with pytest.raises(UserError, match="two vehicles of the scene have one name"):
        what_if(shield(), plain(car("v", 1, 30.0, 20.0), car("v", 1, 60.0, 20.0)), [LEFT])
