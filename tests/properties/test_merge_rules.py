"""merge.pl equals what is written by hand here, on generated scenes, and all else is as in highway.pl."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import pytest
from hypothesis import HealthCheck, given, settings

from drlsl.assurance import DrivingRules, measure, reasons_of, run_cases, score
from drlsl.cli import run
from drlsl.driving.scene import Action, Scene, SceneBatch
from drlsl.driving.shield import Shield
from drlsl.errors import UserError
from tests.assurance.evidence import RULES, table_cases
from tests.properties.oracle import Oracle
from tests.scenes import scenes, scenes_with_ends

MERGE = RULES / "merge.pl"
HIGHWAY = Shield.default()
SHIELD = Shield.from_files([MERGE])
MANY = settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
SOME = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])


def test_the_table_passes_and_notices_every_mutant() -> None:
    cases = table_cases(MERGE)
    rules = DrivingRules.of([MERGE])
    outcome = run_cases(rules, cases)
    assert outcome.failures == []
    coverage = measure(rules, cases)[0]
    assert coverage.missed == ()
    found = score(rules, cases, reasons_of([MERGE]))
    assert len(found.verdicts) >= 200
    assert [verdict.name for verdict in found.unexplained] == []


def test_nothing_looks_wrong(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["rules", "check", "merge.pl"]) == 0
    assert "no findings" in capsys.readouterr().out


class MergeOracle(Oracle):
    """The rules of merge.pl by hand."""

    def rooms(self) -> dict[int, float]:
        """The room in front of the ego up to where each lane of its direction ends, by lane."""
        front = self.sign * self.ego.x + self.ego.length / 2
        return {
            lane.id: self.sign * lane.end - front
            for lane in self.scene.road.lanes_of(self.lane.direction)
            if lane.end is not None
        }

    def lane_beside(self, action: Action) -> int | None:
        """The lane to which an action leads."""
        turn = -self.sign if action is Action.LEFT_LANE_CHANGE else self.sign
        for lane in self.scene.road.lanes_of(self.lane.direction):
            away = turn * (lane.centre - self.lane.centre)
            if 0.0 < away < 0.75 * (lane.width + self.lane.width):
                return lane.id
        return None

    def offered(self, highway: list[Action]) -> set[Action]:
        rooms, offered = self.rooms(), set[Action]()
        own = rooms.get(self.lane.id, math.inf)
        for action in set(highway) - {Action.LANE_KEEPING}:
            lane = self.lane_beside(action)
            assert lane is not None
            if lane not in rooms or own < rooms[lane]:
                offered.add(action)
        speed = self.speed(self.ego)
        must = own < 5.0 * speed + speed * speed / 12.0 and bool(offered)
        return offered if must else offered | {Action.LANE_KEEPING}

    def ends_in_way(self) -> list[float]:
        low = min(self.ego.y, self.target.centre) - self.ego.width / 2
        high = max(self.ego.y, self.target.centre) + self.ego.width / 2
        lanes = {lane.id: lane for lane in self.scene.road.lanes}
        return [
            room
            for lane, room in self.rooms().items()
            if low < lanes[lane].centre + lanes[lane].width / 2
            and high > lanes[lane].centre - lanes[lane].width / 2
        ]


def without_ends(scene: Scene) -> Scene:
    lanes = tuple(replace(lane, end=None) for lane in scene.road.lanes)
    return replace(scene, road=replace(scene.road, lanes=lanes))


@MANY
@given(scene=scenes_with_ends())
def test_what_is_offered(scene: Scene) -> None:
    highway = list(HIGHWAY.decide(without_ends(scene)).safe_actions)
    assert set(SHIELD.decide(scene).safe_actions) == MergeOracle(scene).offered(highway)


@MANY
@given(scene=scenes_with_ends())
def test_how_fast_it_goes(scene: Scene) -> None:
    """No faster than without ends; full braking where else it may be too late; else comfortably."""
    oracle = MergeOracle(scene)
    ends, speed, dt = oracle.ends_in_way(), oracle.speed(oracle.ego), scene.road.time_step
    found = SHIELD.decide(scene).target_speed
    before = HIGHWAY.decide(without_ends(scene)).target_speed
    assert found <= before
    full = max(0.0, speed - 8.0 * dt)
    if any(room - speed * dt <= speed * speed / 16 + dt * dt for room in ends):
        assert found == pytest.approx(min(full, before))
        return
    own = oracle.rooms().get(oracle.lane.id)
    if own is not None:
        most = max(0.1, math.sqrt(4.0 * max(0.0, own - 2.0)))
        assert found <= max(most, speed - 2.0 * dt) + 1e-9
    elif not ends:
        assert found == before


@MANY
@given(scene=scenes_with_ends())
def test_where_it_may_enter(scene: Scene) -> None:
    oracle = MergeOracle(scene)
    room, speed = oracle.rooms().get(oracle.lane.id, math.inf), oracle.speed(oracle.ego)
    stops = 0.35 * speed + 3.0 * 0.35**2 / 2 + (speed + 1.05) ** 2 / 12 + 2.0
    if abs(room - stops) < 1e-9:
        return
    assert SHIELD.entry_is_safe(scene) == (HIGHWAY.entry_is_safe(without_ends(scene)) and room > stops)


@SOME
@given(scene=scenes())
def test_where_no_lane_ends_it_is_highway(scene: Scene) -> None:
    here, there = SHIELD.decide(scene), HIGHWAY.decide(scene)
    assert here == replace(there, safe_actions=here.safe_actions)
    assert set(here.safe_actions) == set(there.safe_actions)
    assert SHIELD.entry_is_safe(scene) == HIGHWAY.entry_is_safe(scene)


@cache
def tier(name: str) -> Shield | None:
    try:
        return SHIELD.with_tier(name)
    except UserError:  # its library is not installed
        return None


@pytest.mark.parametrize("name", ["interpreter", "scalar", "numpy", "numba", "torch"])
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(scene=scenes_with_ends())
def test_every_tier_decides_the_same(name: str, scene: Scene) -> None:
    other = tier(name)
    if other is None:
        pytest.skip(f"{name} is not installed")
    several = [scene, without_ends(scene), replace(scene, vehicles=()), scene]
    batch = other.decide_batch(SceneBatch.of(several))
    assert batch.failures == {}
    for row, one in enumerate(several):
        decision = SHIELD.decide(one)
        assert other.decide(one).target_speed == decision.target_speed
        assert tuple(map(int, batch.action_mask[row])) == decision.action_mask
        assert batch.target_speed[row] == decision.target_speed
        assert batch.comfortable_acceleration[row] == decision.comfortable_acceleration
        assert tuple(batch.observation[row].tolist()) == decision.observation
        assert batch.lane_to_keep[row] == decision.lane_to_keep


@SOME
@given(scene=scenes_with_ends())
def test_an_action_is_offered_exactly_when_nothing_speaks_against_it(scene: Scene) -> None:
    offered = {action.atom for action in SHIELD.decide(scene).safe_actions}
    SHIELD.state_facts(scene)
    opposed = {solution["A"] for solution in SHIELD.engine.query("objection(A, _)")}
    assert offered == {action.atom for action in Action} - opposed
