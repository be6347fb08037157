"""Drivers that are not learnt, and those of a user's own."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from drlsl.driving.drivers import DRIVERS, Mobil, Situations, is_driver, make_driver, most_wanted
from drlsl.driving.scene import EGO, Action, Scene, SceneBatch, Vehicle
from drlsl.driving.shield import Shield
from drlsl.driving.simulation import idm_acceleration
from drlsl.errors import UserError
from drlsl.traffic import Lane
from tests.scenes import road, scenes

KEEP, LEFT, RIGHT = Action
SHIELD = Shield.default()


def situations(*several: Scene) -> Situations:
    batch = SceneBatch.of(several)
    decisions = SHIELD.decide_batch(batch)
    return Situations(decisions.observation.astype(np.float32), decisions.action_mask, batch)


def scene(
    *vehicles: Vehicle, lane: int = 2, speed: float = 25.0, target: int | None = None, up: int = 0
) -> Scene:
    on = road(up, 3)
    centre = on.lanes[lane - 1].centre
    ego = Vehicle(EGO, lane, 0.0, centre, speed, 0.0, 4.6, 1.9)
    return Scene(on, ego, vehicles, lane if target is None else target)


def car(name: str, lane: int, x: float, speed: float) -> Vehicle:
    return Vehicle(name, lane, x, (lane - 0.5) * 3.5, speed, 0.0, 4.6, 1.9)


def preferred(of: Scene, **parameters: float) -> Action:
    return Action(int(Mobil(**parameters).preferences(situations(of))[0].argmax()))


def pulled(rear: Vehicle, front: Vehicle | None, limit: float, sign: int) -> float:
    """The acceleration of a car behind another."""
    own = max(0.0, sign * rear.vx)
    gap, lead = math.inf, own
    if front is not None:
        gap = sign * (front.x - rear.x) - (rear.length + front.length) / 2
        lead = max(0.0, sign * front.vx)
    return float(idm_acceleration(np.array([gap]), np.array([own]), np.array([lead]), limit)[0])


def nearest(found: Sequence[Vehicle], ego: Vehicle) -> Vehicle | None:
    return min(found, key=lambda one: abs(one.x - ego.x), default=None)


def accelerations(of: Scene, lane: Lane) -> tuple[float, float, float, bool]:
    """With the ego in a lane: its own, its follower's, and that without it; whether nobody is alongside."""
    ego, sign = of.ego, lane.direction.sign
    there = [one for one in of.in_range() if abs(one.y - lane.centre) < (one.width + ego.width) / 2]
    leader = nearest([one for one in there if sign * (one.x - ego.x) >= 0.0], ego)
    follower = nearest([one for one in there if sign * (one.x - ego.x) < 0.0], ego)
    own = pulled(ego, leader, lane.speed_limit, sign)
    beside = [one for one in (leader, follower) if one is not None]
    free = all(abs(one.x - ego.x) > (one.length + ego.length) / 2 for one in beside)
    if follower is None:
        return own, 0.0, 0.0, free
    behind, alone = (pulled(follower, front, lane.speed_limit, sign) for front in (ego, leader))
    return own, behind, alone, free


def by_hand(of: Scene, driver: Mobil) -> list[float]:
    """The preferences of MOBIL for one scene."""
    target = of.road.lane(of.target_lane)
    assert target is not None
    lanes = sorted(of.road.lanes_of(target.direction), key=lambda one: target.direction.sign * one.centre)
    here = lanes.index(target)
    own, behind, alone, _ = accelerations(of, target)
    wanted = [0.0]
    for step, bias in ((-1, -driver.right_bias), (1, driver.right_bias)):
        settled = abs(of.ego.y - target.centre) <= of.road.centre_tolerance
        if not settled or not 0 <= here + step < len(lanes):
            wanted.append(-math.inf)
            continue
        new, pressed, before, free = accelerations(of, lanes[here + step])
        others = driver.politeness * (pressed - before + alone - behind)
        safe = free and pressed >= -driver.safe_braking
        wanted.append(new - own + others - driver.threshold + bias if safe else -math.inf)
    return wanted


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    several=st.lists(scenes(), min_size=1, max_size=4),
    politeness=st.sampled_from([0.0, 0.5, 1.0]),
    bias=st.sampled_from([0.0, 0.3]),
)
def test_mobil_on_arrays_is_mobil_by_hand(several: list[Scene], politeness: float, bias: float) -> None:
    driver = Mobil(politeness=politeness, right_bias=bias)
    found = driver.preferences(
        Situations(np.zeros((0, 0), np.float32), np.zeros((0, 3), bool), SceneBatch.of(several))
    )
    assert found.ravel().tolist() == pytest.approx(
        np.ravel([by_hand(one, driver) for one in several]), abs=1e-9
    )


def test_mobil_overtakes_a_slower_leader_and_follows_a_faster_one() -> None:
    assert preferred(scene(car("a", 2, 40.0, 15.0), car("b", 3, 40.0, 15.0))) is LEFT
    assert preferred(scene(car("a", 2, 40.0, 15.0), car("b", 1, 40.0, 15.0))) is RIGHT
    assert preferred(scene(car("a", 2, 40.0, 40.0))) is KEEP
    assert preferred(scene()) is KEEP


def test_mobil_does_not_cut_off_a_follower() -> None:
    slow = car("a", 2, 40.0, 15.0), car("b", 3, 40.0, 15.0)
    assert preferred(scene(*slow, car("c", 1, -20.0, 35.0))) is KEEP
    assert preferred(scene(*slow, car("c", 1, -20.0, 35.0)), safe_braking=50.0, politeness=0.0) is LEFT
    assert preferred(scene(*slow, car("c", 1, -60.0, 25.0))) is LEFT
    assert preferred(scene(*slow, car("c", 1, 0.0, 25.0)), politeness=0.0, safe_braking=50.0) is KEEP, (
        "alongside"
    )


def test_politeness_threshold_and_bias() -> None:
    pressed = scene(car("a", 2, 60.0, 20.0), car("b", 3, 40.0, 15.0), car("c", 1, -32.0, 27.0))
    assert preferred(pressed, politeness=0.0) is LEFT
    assert preferred(pressed, politeness=1.0) is KEEP
    assert preferred(pressed, politeness=0.0, threshold=5.0) is KEEP
    assert preferred(scene(), right_bias=0.3) is RIGHT


def test_mobil_changes_one_lane_at_a_time() -> None:
    slow = car("a", 2, 40.0, 15.0), car("b", 1, 40.0, 15.0)
    assert preferred(scene(*slow, target=1)) is KEEP
    assert preferred(scene(slow[1], lane=1)) is RIGHT, "there is no lane on the left"


@pytest.mark.parametrize("parameters", [{"politeness": -1.0}, {"threshold": math.nan}, {"polite": 0.5}])
def test_parameters_that_mobil_cannot_have(parameters: dict[str, float]) -> None:
    with pytest.raises(
        UserError, match=f"driver mobil: {next(iter(parameters))}: .*its parameters: politeness"
    ):
        make_driver("mobil", parameters)


@given(
    wanted=st.lists(st.floats(allow_nan=False, max_value=1e300), min_size=3, max_size=3),
    offered=st.lists(st.booleans(), min_size=3, max_size=3).filter(any),
)
def test_what_is_driven_is_offered_and_wanted_most_of_that(wanted: list[float], offered: list[bool]) -> None:
    choice = most_wanted(np.array([wanted]), np.array([offered]))
    (action,), (best,) = choice.actions.tolist(), choice.preferred.tolist()
    assert offered[action]
    assert wanted[action] == max(value for value, may in zip(wanted, offered, strict=True) if may)
    assert wanted[best] == max(wanted)


def test_an_action_that_is_never_wanted_is_driven_where_it_alone_is_offered() -> None:
    choice = most_wanted(np.array([[1.0, 0.0, -np.inf]]), np.array([[False, False, True]]))
    assert (choice.actions.tolist(), choice.preferred.tolist()) == ([2], [0])


@pytest.mark.parametrize(
    ("wanted", "offered"),
    [
        ([[np.nan, 0, 0]], [[1, 1, 1]]),
        ([[np.inf, 0, 0]], [[1, 1, 1]]),
        ([[1.0, 0, 0]], [[0, 0, 0]]),
        ([[1.0, 0]], [[1] * 3]),
    ],
)
def test_what_is_no_choice_is_an_error(wanted: Any, offered: Any) -> None:
    with pytest.raises(ValueError, match=r"preference|no action"):
        most_wanted(np.array(wanted), np.array(offered, bool))


@settings(max_examples=30, deadline=None)
@given(one=scenes())
@pytest.mark.parametrize("name", DRIVERS)
def test_every_driver_chooses_something(name: str, one: Scene) -> None:
    seen = situations(one, one)
    driver = make_driver(name)
    if name == "oracle":
        with pytest.raises(ValueError, match="the oracle needs situations that can be driven on from"):
            driver.preferences(seen)
        return
    choice = most_wanted(driver.preferences(seen), seen.offered)
    assert choice.actions[0] == choice.actions[1]
    if name == "keep":
        assert choice.preferred.tolist() == choice.actions.tolist() == [KEEP, KEEP]
    if name == "always-change":
        assert seen.offered[0, choice.preferred[0]]
        expected = LEFT if seen.offered[0, LEFT] else RIGHT if seen.offered[0, RIGHT] else KEEP
        assert choice.actions[0] == expected


USERS = """
import numpy as np

def right(situations):
    return np.full(len(situations.offered), 2)

def gaps(situations):
    return situations.observations[:, :3]

class Patient:
    window = 3
    def __init__(self, action=0):
        self.action = action
    def preferences(self, situations):
        wanted = np.zeros((len(situations.offered), 3))
        wanted[:, self.action] = 1.0
        return wanted

class Called:
    def __call__(self, situations):
        return [1 for _ in situations.offered]

number = 3
def fails(situations): return 1 / 0
def fractions(situations): return np.zeros(len(situations.offered))
def beyond(situations): return np.full(len(situations.offered), 3)
def short(situations): return np.zeros(1, int)
def nan(situations): return np.full((len(situations.offered), 3), np.nan)
class Lazy:
    window = 0
    def preferences(self, situations): ...
"""


@pytest.fixture
def users(tmp_path: Path) -> str:
    path = tmp_path / "mine.py"
    path.write_text(USERS)
    return str(path)


def chosen(name: str, **arguments: object) -> list[int]:
    seen = situations(scene(), scene(car("a", 1, 0.0, 25.0)))
    choice = most_wanted(make_driver(name, arguments).preferences(seen), seen.offered)
    return [int(action) for action in choice.preferred]


def test_functions_and_classes_of_a_user_drive(users: str) -> None:
    assert chosen(f"{users}:right") == [2, 2]
    assert chosen(f"{users}:gaps") == [0, 0]
    assert chosen(f"{users}:Patient") == [0, 0]
    assert chosen(f"{users}:Patient", action=2) == [2, 2]
    assert chosen(f"{users}:Called") == [1, 1]
    assert make_driver(f"{users}:Patient").window == 3
    assert make_driver(f"{users}:right").window == 1


def test_an_action_that_is_wanted_and_not_offered_becomes_lane_keeping(users: str) -> None:
    seen = situations(scene(car("a", 3, 0.0, 25.0)))
    choice = most_wanted(make_driver(f"{users}:right").preferences(seen), seen.offered)
    assert (choice.preferred.tolist(), choice.actions.tolist()) == ([RIGHT], [KEEP])


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("number", "expected a function or a class, found a int"),
        ("nothing", "has no 'nothing'"),
        ("fails", r"ZeroDivisionError: division by zero \(mine.py:24\)"),
        ("fractions", r"array of float64 of shape \(2,\).*expected 2 actions from 0 to 2"),
        ("beyond", r"3 3\]; expected 2 actions from 0 to 2"),
        ("short", r"shape \(1,\)"),
        ("nan", r"preferences of shape \(2, 3\) below infinity"),
        ("Lazy", "its window is 0"),
    ],
)
def test_what_is_no_driver_is_refused(users: str, name: str, message: str) -> None:
    with pytest.raises(UserError, match=f"driver .*mine.py:{name}.*{message}"):
        chosen(f"{users}:{name}")


def test_names_that_are_no_driver(users: str, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no driver 'mobile': expected keep, always-change, mobil, oracle"):
        make_driver("mobile")
    with pytest.raises(UserError, match="takes no parameters, got action"):
        make_driver(f"{users}:right", {"action": 1})
    with pytest.raises(UserError, match="unexpected keyword argument 'speed'"):
        make_driver(f"{users}:Patient", {"speed": 1})
    assert is_driver("mobil")
    assert is_driver("a.py:b")
    assert not is_driver(str(tmp_path))
