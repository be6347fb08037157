"""Linear prediction: the same as a plain reading of it, scene by scene, and never off the road."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drlsl.benchmarks import random_scenes
from drlsl.driving import EnvConfig
from drlsl.driving.scene import Scene, SceneBatch, Vehicle
from drlsl.driving.shield import Shield
from drlsl.driving.simulation import World, in_direction, playbacks_of
from drlsl.driving.simulation.controllers import LANE_GAIN, LATERAL_SPEED_LIMIT, lane_control, move
from drlsl.driving.simulation.prediction import NOTHING_OFFERED, TICK, predicted_actions, sideways
from drlsl.traffic import Direction, load_recording
from tests.driving.recordings import Drive, recording


def path(y: float, target: float, time: float) -> float:
    """The ego's place across the road: as fast as it moves while it is far, then exponentially slower."""
    error, knee = y - target, LATERAL_SPEED_LIMIT / LANE_GAIN
    far = max(abs(error) - knee, 0.0) / LATERAL_SPEED_LIMIT
    if time < far:
        left = abs(error) - LATERAL_SPEED_LIMIT * time
    else:
        left = min(abs(error), knee) * math.exp(-LANE_GAIN * (time - far))
    return target + math.copysign(left, error)


def oracle(scene: Scene, target: float, low: float, high: float, horizon: float) -> bool:
    """Whether the action that leads to `target` may be offered, one vehicle and one moment at a time."""
    ego = scene.ego
    if math.isnan(target) or target - ego.width / 2 < low or target + ego.width / 2 > high:
        return False
    ticks = math.ceil(horizon / TICK)
    for tick in range(1, ticks + 1):
        time = horizon * tick / ticks
        y = path(ego.y, target, time)
        if y - ego.width / 2 < low or y + ego.width / 2 > high:
            return False
        for car in scene.in_range():
            along = abs(car.x + car.vx * time - ego.x - ego.vx * time) < (car.length + ego.length) / 2
            across = abs(car.y + car.vy * time - y) < (car.width + ego.width) / 2
            if along and across:
                return False
    return True


@given(st.integers(0, 10_000), st.integers(0, 25), st.floats(0.05, 6.0))
def test_it_is_what_a_plain_reading_says(seed: int, vehicles: int, horizon: float) -> None:
    scenes, rng = random_scenes(6, vehicles, seed=seed), random.Random(seed)
    edges, targets = [], []
    for scene in scenes:
        lane = scene.road.lane(scene.ego.lane)
        assert lane is not None
        lanes = scene.road.lanes_of(lane.direction)
        edges.append((lanes[0].centre - lanes[0].width / 2, lanes[-1].centre + lanes[-1].width / 2))
        beside = [lane.centre - lane.width, lane.centre + lane.width]
        targets.append([lane.centre, *(math.nan if rng.random() < 0.2 else y for y in beside)])
    low, high = np.array(edges).T
    batch = SceneBatch.of(scenes)
    # Who is not seen has numbers all the same.
    hidden = np.random.default_rng(seed).random(batch.valid.shape) < 0.3
    hidden[:, 0] = False
    batch = replace(batch, valid=batch.valid & ~hidden)
    scenes = [batch.scene(index) for index in range(len(scenes))]
    ours = predicted_actions(batch, np.array(targets), low, high, horizon)
    expected = [
        [oracle(scene, target, *edge, horizon) for target in row]
        for scene, row, edge in zip(scenes, targets, edges, strict=True)
    ]
    assert ours.tolist() == expected
    for index, scene in enumerate(scenes):
        here = slice(index, index + 1)
        alone = predicted_actions(
            SceneBatch.of([scene]), np.array(targets[here]), low[here], high[here], horizon
        )
        assert np.array_equal(alone[0], ours[index])


@pytest.mark.parametrize("change", [3.75, -3.75, 0.3, 0.0])
def test_the_predicted_way_is_nearly_the_driven_one(change: float) -> None:
    y, vy, integral, target = 10.0, 0.0, 0.0, np.array([10.0 + change])
    times = np.arange(1, 101, dtype=np.float64) * 0.04
    driven = []
    for _ in times:
        acceleration, integral = lane_control(y, vy, target[0], 0.04, integral)
        y, vy = move(y, vy, acceleration, 0.04)
        driven.append(y)
    predicted = sideways(np.array([10.0]), target[None], times)[0, 0]
    assert np.abs(predicted - driven).max() < 0.6
    assert abs(predicted[-1] - target[0]) < 0.1


def test_a_near_leader_that_is_slower_leaves_only_the_other_lanes() -> None:
    scene = random_scenes(1, 0, seed=2)[0]
    lanes = scene.road.lanes_of(Direction.LEFT_TO_RIGHT)
    ego = Vehicle("ego", lanes[1].id, 0.0, lanes[1].centre, 30.0, 0.0, 4.6, 1.9)
    leader = Vehicle("v0", lanes[1].id, 20.0, lanes[1].centre, 10.0, 0.0, 4.6, 1.9)
    batch = SceneBatch.of([Scene(scene.road, ego, (leader,), ego.lane)])
    low = np.array([lanes[0].centre - 2]), np.array([lanes[2].centre + 2])
    targets = np.array([[lane.centre for lane in (lanes[1], lanes[0], lanes[2])]])
    assert predicted_actions(batch, targets, *low, 0.5).tolist() == [[True, True, True]]
    assert predicted_actions(batch, targets, *low, 3.0).tolist() == [[False, False, False]]
    far = SceneBatch.of([Scene(scene.road, ego, (leader._replace(x=60.0),), ego.lane)])
    assert predicted_actions(far, targets, *low, 3.0).tolist() == [[False, True, True]]


def world(name: str, egos: int, horizon: float) -> World:
    config = EnvConfig(recording=name, offers="prediction", prediction_horizon=horizon, track_length=200.0)
    playbacks = in_direction(playbacks_of([load_recording(name)], config.radar_range), config)
    one = World(config, [playbacks] * egos, Shield.default(tier="auto"))
    one.reset(list(range(egos)), [np.random.default_rng(seed) for seed in range(egos)])
    return one


@pytest.mark.parametrize("horizon", [0.1, 2.0])
def test_an_action_that_leaves_the_road_is_never_offered(horizon: float) -> None:
    one, rng = world("highway-test", 8, horizon), np.random.default_rng(0)
    offered = 0
    for _ in range(200):
        mask, targets = one.decisions.action_mask, one.targets()
        edges = one._courses.low[:, None] + 0.95, one._courses.high[:, None] - 0.95
        with np.errstate(invalid="ignore"):
            assert ((targets >= edges[0]) & (targets <= edges[1]))[mask].all()
        offered += int(mask[:, 1:].sum())
        result = one.step((rng.random(mask.shape) * mask).argmax(axis=1))
        assert not result.off_road.any()
        over = np.flatnonzero(result.terminated | result.truncated).tolist()
        if over:
            one.reset(over, [np.random.default_rng(rng.integers(1000)) for _ in over])
    assert offered > 100


def test_where_nothing_is_left_the_lane_is_kept_and_the_failure_counted() -> None:
    jam = [Drive(lane, 250.0, 0.0) for lane in (3, 4, 5)]
    made = recording(jam, frames=700)
    config = EnvConfig(recording="by-hand", direction="left_to_right", offers="prediction")
    rules = EnvConfig(recording="by-hand", direction="left_to_right")
    shield = Shield.default()
    runs = []
    for one in (config, rules):
        made_world = World(one, [in_direction(playbacks_of([made], 100.0), one)], shield)
        made_world.reset([0], [np.random.default_rng(0)])
        runs.append([made_world.step(np.zeros(1, dtype=np.int64)) for _ in range(300)])
    failed = [result for result in runs[0] if result.decisions.failures]
    assert failed
    assert len(failed) < 300
    for result in failed:
        assert result.decisions.failures == {0: NOTHING_OFFERED}
        assert result.decisions.action_mask.tolist() == [[True, False, False]]
    for predicted, asked in zip(*runs, strict=True):
        assert np.array_equal(predicted.decisions.target_speed, asked.decisions.target_speed)
        assert np.array_equal(predicted.decisions.observation, asked.decisions.observation)


def test_a_failure_of_the_rules_stays_their_fail_safe() -> None:
    from drlsl.logic import Engine

    engine = Engine()
    engine.consult_text(
        "safe_actions(lane_keeping). front_is_free. longitudinal_velocity(-1.0). entry_is_safe. "
        "state([0, 0, 0, 0, 0, 0, 0, 0, 0, 0]).",
        name="broken",
    )
    config = EnvConfig(recording="by-hand", direction="left_to_right", offers="prediction")
    playbacks = in_direction(playbacks_of([recording([Drive(1, 200.0, 1.0)])], 100.0), config)
    one = World(config, [playbacks], Shield(engine))
    one.reset([0], [np.random.default_rng(0)])
    assert one.decisions.action_mask.tolist() == [[True, False, False]]
    assert "longitudinal_velocity/1" in one.decisions.failures[0]
