"""The ego on an on-ramp: its lane is one that ends, where the ego enters and which it must leave."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drlsl.driving.config import EnvConfig
from drlsl.driving.envs import HighwayEnv, HighwayVectorEnv
from drlsl.driving.scene import Action, road_facts
from drlsl.driving.shield import Shield
from drlsl.driving.simulation import World, in_direction, load_playbacks, playbacks_of
from drlsl.driving.simulation.ego_loops import OFF_ROAD
from drlsl.driving.simulation.entry import RAMP_ZONE, Entry, room_to_drive, track_length
from drlsl.driving.simulation.playback import Playback
from drlsl.driving.simulation.prediction import lane_goes_on, sideways
from drlsl.errors import UserError
from drlsl.traffic import RAMP_LIMIT, Direction, MergingLane, Recording, load_recording
from tests.driving.recordings import LANES, WIDTH, Drive, recording

SIZE = (4.6, 1.9)
RAMPS = (
    MergingLane(Direction.RIGHT_TO_LEFT, LANES[0].centre - WIDTH, WIDTH, 320.0, 120.0),
    MergingLane(Direction.LEFT_TO_RIGHT, LANES[-1].centre + WIDTH, WIDTH, 100.0, 300.0),
)


def with_ramps(*ramps: MergingLane) -> Recording:
    made = recording([Drive(1, 400.0, 20.0), Drive(3, 5.0, 20.0)], frames=200)
    made = replace(made, merging_lanes=ramps)
    made.validate()
    return made


def both_ways() -> list[Playback]:
    return playbacks_of([with_ramps(*RAMPS)], 100.0, entry="ramp")


def test_a_ramp_is_a_lane_of_its_direction_that_ends() -> None:
    for playback, ramp in zip(sorted(both_ways(), key=lambda one: one.sign), RAMPS, strict=True):
        (lane,) = playback.entry_lanes
        right = LANES[0 if ramp.direction.sign < 0 else -1]
        assert (lane.centre, lane.width, lane.end) == (ramp.centre, ramp.width, ramp.end)
        assert (lane.direction, lane.speed_limit) == (ramp.direction, right.speed_limit)
        go_on = {one for one in LANES if one.direction is ramp.direction}
        assert {one for one in playback.lanes if one.end is None} == go_on
        assert [one.centre for one in playback.road.lanes] == sorted(
            one.centre for one in playback.road.lanes
        )
        ends = {one.id: one.end for one in playback.road.lanes if one.end is not None}
        assert road_facts(playback.road)["lane_end", 2] == list(ends.items())


def test_without_entry_on_a_ramp_it_is_no_lane() -> None:
    for playback in playbacks_of([with_ramps(*RAMPS)], 100.0):
        assert playback.road.lanes == LANES
        assert playback.ramp is None
        assert road_facts(playback.road)["lane_end", 2] == []


@pytest.mark.parametrize("ramps", [(), RAMPS[:1], (*RAMPS, RAMPS[1])])
def test_a_direction_needs_one_ramp(ramps: tuple[MergingLane, ...]) -> None:
    with pytest.raises(UserError, match="; expected one, as in"):
        playbacks_of([with_ramps(*ramps)], 100.0, entry="ramp")
    with pytest.raises(UserError, match="highway-test has 0 merging lanes"):
        HighwayEnv(recording="highway-test", entry="ramp")


def test_vehicles_on_a_ramp_are_in_its_lane_and_all_others_where_they_were() -> None:
    made = load_recording("merge-test")
    before, (playback,) = made.frames, playbacks_of([made], 100.0, entry="ramp")
    (lane,), lanes = playback.entry_lanes, playback.film.lane(slice(None))
    assert lane.end is not None
    ramp = before.valid & (np.abs(before.y - lane.centre) <= lane.width / 2) & (before.x <= lane.end)
    assert ramp.sum() > 1000
    assert (lanes[:, 1:][ramp] == lane.id).all()
    assert np.array_equal(lanes[:, 1:][~ramp], before.lane[~ramp])


def test_the_ego_enters_where_the_ramp_begins_no_faster_than_ramps_allow() -> None:
    env = HighwayVectorEnv(recording="merge-test", rules=("merge.pl",), entry="ramp", num_envs=64)
    _, info = env.reset(seed=3)
    playback = env.world.playback_of(0)
    assert playback.ramp is not None
    scenes = env.scenes()
    (lane,) = playback.entry_lanes
    assert (scenes.target_lane == lane.id).all()
    assert (scenes.lane[:, 0] == lane.id).all()
    along = np.array([playback.along(x) for x in scenes.x[:, 0]]) - playback.along(playback.ramp.begin)
    assert along.min() >= 0.0
    assert along.max() <= RAMP_ZONE
    assert len(set(along.tolist())) > 8
    assert info["speed"].max() <= RAMP_LIMIT


def test_an_episode_from_a_ramp_is_one_merge() -> None:
    config = EnvConfig(recording="merge-test", entry="ramp")
    ((playback,),) = load_playbacks([config])
    assert playback.ramp is not None
    room = playback.along(playback.x_max) - playback.along(playback.ramp.begin) - RAMP_ZONE
    assert track_length(playback, config) == room_to_drive(playback, SIZE[0])
    assert track_length(playback, config) == pytest.approx(room - SIZE[0] / 2)


@cache
def world_of(way: Direction) -> World:
    playbacks = in_direction(both_ways(), EnvConfig(direction=way.value))
    world = World(EnvConfig(), [playbacks], Shield.default(tier="scalar"))
    world.reset([0], [np.random.default_rng(1)])
    return world


@settings(max_examples=300, deadline=None)
@given(
    way=st.sampled_from(list(Direction)),
    x=st.one_of(st.floats(90.0, 330.0), st.sampled_from([120.0, 117.7, 122.3, 297.7, 300.0, 302.3])),
    y=st.floats(-5.0, 35.0),
)
def test_past_the_end_of_its_lane_an_ego_is_off_the_road(way: Direction, x: float, y: float) -> None:
    world = world_of(way)
    playback = world.playback_of(0)
    world._egos.place(0, Entry(0, playback.lanes[0], x, 20.0))
    world._egos.at.y[0], world._egos.at.ended[0] = y, False
    nobody = np.zeros((1, world.playbacks.films.slots), dtype=np.bool_)
    events, _, _ = world._finish(nobody, np.zeros(1, dtype=np.bool_), np.ones(1, dtype=np.bool_))
    lanes = [
        (lane.centre - lane.width / 2, lane.centre + lane.width / 2)
        for lane in playback.lanes
        if lane.end is None or way.sign * x + SIZE[0] / 2 <= way.sign * lane.end
    ]
    low, high = min(low for low, _ in lanes), max(high for _, high in lanes)
    expected = y - SIZE[1] / 2 < low or y + SIZE[1] / 2 > high
    assert events[OFF_ROAD].tolist() == [expected]


def test_who_keeps_the_lane_without_rules_for_its_end_runs_past_it() -> None:
    env = HighwayEnv(recording="merge-test", entry="ramp")
    env.reset(seed=5)
    end = env.world.playback_of(0).entry_lanes[0].end
    assert end is not None
    while True:
        *_, terminated, truncated, info = env.step(Action.LANE_KEEPING)
        front = env.world.traffic_around(0).ego.x + SIZE[0] / 2
        assert terminated == info["off_road"] == (front > end)
        assert not truncated
        if terminated:
            break


@pytest.mark.parametrize("action", list(Action))
def test_prediction_offers_nothing_that_runs_past_the_end(action: Action) -> None:
    env = HighwayVectorEnv(recording="merge-test", entry="ramp", offers="prediction", num_envs=32)
    env.reset(seed=2)
    courses, horizon = env.world._courses, env.config.prediction_horizon
    seen = set()
    for _ in range(80):
        scenes, targets = env.scenes(), env.world.targets()
        found = lane_goes_on(scenes, targets, courses, horizon)[:, action]
        times = horizon * np.arange(1, 31) / 30
        for row in range(32):
            path = sideways(scenes.y[row : row + 1, 0], targets[row : row + 1], times)[0, action]
            front = scenes.x[row, 0] + SIZE[0] / 2 + scenes.vx[row, 0] * times
            beside = ~((path - 0.95 >= courses.low_after[row]) & (path + 0.95 <= courses.high_after[row]))
            assert found[row] == (not (beside & (front > courses.end[row])).any())
            seen.add(bool(found[row]))
        mask = env.action_masks()
        ok = lane_goes_on(scenes, targets, courses, horizon)
        stuck = np.array([row in env.world.decisions.failures for row in range(32)])
        assert (ok | ~mask | stuck[:, None]).all()
        env.step(np.zeros(32, dtype=np.int64))
    assert seen == {True, False}


def test_many_ramps_together_are_the_same_as_each_alone() -> None:
    kind: dict[str, Any] = {"recording": "merge-test", "rules": ("merge.pl",), "entry": "ramp"}
    many = HighwayVectorEnv(num_envs=3, **kind)
    alone = [HighwayEnv(**kind) for _ in range(3)]
    together, _ = many.reset(seed=7)
    each = [env.reset(seed=7 + number)[0] for number, env in enumerate(alone)]
    rng, running = np.random.default_rng(1), np.ones(3, dtype=np.bool_)
    for _ in range(400):
        assert np.array_equal(together[running], np.array(each)[running])
        masks = many.action_masks()
        actions = np.array([rng.choice(np.flatnonzero(mask)) for mask in masks])
        together, reward, terminated, truncated, info = many.step(actions)
        for number, env in enumerate(alone):
            if not running[number]:
                continue
            each[number], one, *over, told = env.step(int(actions[number]))
            assert (one, over) == (reward[number], [terminated[number], truncated[number]])
            assert told["action_mask"].tolist() == info["action_mask"][number].tolist()
        running &= ~(terminated | truncated)
        if not running.any():
            return
    raise AssertionError("no episode ended")
