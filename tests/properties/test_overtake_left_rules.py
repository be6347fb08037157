"""overtake_left.pl equals a predicate written by hand, on generated scenes; all else is as in highway.pl."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, find, given, settings
from hypothesis import strategies as st

from drlsl.driving.scene import EGO, Scene, Vehicle
from drlsl.driving.shield import Shield
from tests.properties.oracle import Oracle
from tests.scenes import EGO_LENGTH, EGO_WIDTH, road, scenes

RULES = Path(__file__).parents[2] / "rules"
MANY = settings(max_examples=120, deadline=None, suppress_health_check=[HealthCheck.too_slow])

STAY = 20.0
QUEUE_SPEED, QUEUE_EXCESS = 60 / 3.6, 20 / 3.6


class LeftOracle(Oracle):
    """What the rules should say where overtaking is on the left."""

    def queue(self) -> bool:
        ahead = sorted(self.section("front"), key=self.gap)
        slow = [car for car in ahead if car.lane == self.ego.lane and self.speed(car) <= QUEUE_SPEED]
        return (
            len(slow) > 1 and slow[0] is ahead[0] and any(self.gap(car) > self.gap(ahead[0]) for car in slow)
        )

    def reach(self, offset: float) -> float | None:
        """How fast the ego may become in the lane to its right, up to a place ahead."""
        lane = self.side_lane("right")
        if lane is None:
            return None
        leader = min(self.section("front_right"), key=self.gap, default=None)
        if leader is None or self.offset(leader) > offset:
            return lane.speed_limit
        return min(lane.speed_limit, self.speed(leader))

    def overtaken(self) -> Iterator[tuple[str, float, float]]:
        """Whom the ego would overtake on the right: how far it goes for that, and how much faster."""
        for car in self.targets():
            lane, offset = self.scene.road.lane(car.lane), self.offset(car)
            reach = self.reach(offset)
            if lane is None or lane.direction is not self.lane.direction or reach is None or offset <= 0:
                continue
            if self.sign * (self.lane.centre - lane.centre) < 0 or self.velocity(car) < 0:
                continue
            way, excess = offset + (self.ego.length + car.length) / 2, reach - self.speed(car)
            lawful = self.queue() and self.speed(car) <= QUEUE_SPEED and excess <= QUEUE_EXCESS
            if way < excess * STAY and not lawful:
                yield car.id, way, excess

    def actions(self) -> list[str]:
        barred = any(True for _ in self.overtaken())
        return [action for action in super().actions() if action != "right_lane_change" or not barred]


@st.composite
def crowds(draw: st.DrawFn) -> Scene:
    """The ego is settled, with a lane to its right, and vehicles mostly ahead of it, often slow."""
    lane = draw(st.sampled_from([1, 2]))
    on = road(0, 3, limit=draw(st.sampled_from([16.0, 22.0, 30.0, 36.0])))
    top = draw(st.sampled_from([9.0, 18.0, 36.0]))
    speeds = st.one_of(st.sampled_from([0.0, QUEUE_SPEED, top]), st.floats(0.0, top))
    ego = Vehicle(EGO, lane, 0.0, on.lanes[lane - 1].centre, draw(speeds), 0.0, EGO_LENGTH, EGO_WIDTH)
    cars = []
    for number in range(draw(st.integers(1, 7))):
        place = draw(st.sampled_from(on.lanes))
        offset = draw(st.one_of(st.floats(-30.0, 95.0), st.sampled_from([10.0, 30.0, 60.0])))
        length = draw(st.sampled_from([4.0, 12.0]))
        cars.append(Vehicle(f"v{number}", place.id, offset, place.centre, draw(speeds), 0.0, length, 1.9))
    return Scene(on, ego, tuple(cars), lane)


@pytest.fixture(scope="module")
def shield() -> Shield:
    return Shield.from_files([RULES / "overtake_left.pl"])


@pytest.fixture(scope="module")
def highway() -> Shield:
    return Shield.default()


def overtaken(shield: Shield, scene: Scene) -> list[tuple[object, ...]]:
    shield.state_facts(scene)
    found = shield.engine.query("overtaken_on_the_right(Car, Way, Excess)")
    return [tuple(solution[name] for name in ("Car", "Way", "Excess")) for solution in found]


@MANY
@given(scene=st.one_of(scenes(), crowds()))
def test_whom_it_would_overtake(shield: Shield, scene: Scene) -> None:
    oracle = LeftOracle(scene)
    assert overtaken(shield, scene) == list(oracle.overtaken())
    assert shield.engine.holds("in_a_queue") == oracle.queue()
    assert [action.atom for action in shield.decide(scene).safe_actions] == oracle.actions()
    reasons = {
        str(solution["Car"]): solution["T"]
        for solution in shield.engine.query(
            "objection(right_lane_change, would_overtake_on_the_right(Car, T))"
        )
    }
    assert reasons == {car: way / excess for car, way, excess in oracle.overtaken()}
    assert all(0 < time < STAY * 1.0000001 for time in reasons.values())  # type: ignore[operator]  # floats


@MANY
@given(scene=st.one_of(scenes(), crowds()))
def test_all_else_is_as_in_highway(shield: Shield, highway: Shield, scene: Scene) -> None:
    here, there = shield.decide(scene), highway.decide(scene)
    assert here.action_mask[:2] == there.action_mask[:2]
    assert here.action_mask[2] <= there.action_mask[2]
    for field in ("target_speed", "front_is_free", "lane_to_keep"):
        assert getattr(here, field) == getattr(there, field)
    assert shield.observation.names[-1] == "right_offered"
    assert here.observation == (*there.observation[:-1], float(here.action_mask[2]))
    assert shield.entry_is_safe(scene) == highway.entry_is_safe(scene)


@MANY
@given(scene=st.one_of(scenes(), crowds()))
def test_an_action_is_offered_exactly_when_nothing_speaks_against_it(shield: Shield, scene: Scene) -> None:
    offered = {action.atom for action in shield.decide(scene).safe_actions}
    opposed = {solution["A"] for solution in shield.engine.query("objection(A, _)")}
    assert offered.isdisjoint(opposed)
    assert offered | opposed == {"lane_keeping", "left_lane_change", "right_lane_change"}


@pytest.mark.parametrize("reason", ["nobody is slower", "held back", "a queue"])
def test_the_generated_scenes_have_each_way_to_be_allowed(reason: str) -> None:
    """So that the tests above say something about each."""

    def is_allowed(scene: Scene) -> bool:
        oracle = LeftOracle(scene)
        slower = [
            car
            for car in oracle.targets()
            if oracle.offset(car) > 0 and car.lane <= scene.ego.lane and oracle.speed(car) < 12
        ]
        if "right_lane_change" not in oracle.actions():
            return False
        held = bool(oracle.section("front_right"))
        return {
            "nobody is slower": not slower,
            "held back": bool(slower) and held and not oracle.queue(),
            "a queue": oracle.queue()
            and any(
                (oracle.reach(oracle.offset(car)) or 0) - oracle.speed(car) > 4 and oracle.offset(car) < 40
                for car in slower
            ),
        }[reason]

    assert find(crowds(), is_allowed, settings=settings(max_examples=200_000, derandomize=True))
