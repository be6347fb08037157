"""Sensing faults: how large they are, whom they concern, and that without strength they are none."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from drlsl.driving import EnvConfig
from drlsl.driving.config import SensingConfig
from drlsl.driving.scene import SceneBatch
from drlsl.driving.shield import Shield
from drlsl.driving.simulation import World, in_direction, playbacks_of
from drlsl.driving.simulation.sensing import Sensing
from drlsl.traffic import Recording, load_recording
from tests.driving.recordings import LANES, Drive, recording

CRAWL = [Drive(lane, x, 0.5) for lane in (1, 2) for x in range(100, 400, 3)]
"""Traffic on the other side that the ego passes."""

KEEP = np.zeros(1, dtype=np.int64)


@pytest.fixture(scope="module")
def shield() -> Shield:
    return Shield.default(tier="auto")


def world(made: Recording, shield: Shield, *, seed: int = 0, **sensing: Any) -> World:
    config = EnvConfig(
        recording="by-hand",
        direction="left_to_right",
        sensing=SensingConfig.model_validate(sensing),
        track_length=300.0,
    )
    one = World(config, [in_direction(playbacks_of([made], config.radar_range), config)], shield)
    one.reset([0], [np.random.default_rng(seed)])
    return one


def rows(scenes: SceneBatch, name: str) -> dict[int, float]:
    """A column by the vehicles' ids."""
    seen = scenes.valid[0]
    return dict(zip(scenes.id[0][seen].tolist(), getattr(scenes, name)[0][seen].tolist(), strict=True))


def test_faults_without_strength_are_none(shield: Shield) -> None:
    one = world(load_recording("highway-test"), shield)
    assert one._sensing is None
    sensing = Sensing(SensingConfig(), one.playbacks, 100.0, 1)
    sensing.begin(0, np.random.default_rng(0))
    everyone = np.zeros(1, dtype=np.int64)
    for _ in range(100):
        scenes = one.step(KEEP).scenes
        seen = sensing.perceive(scenes, one._courses, one._egos.at.frame, everyone)
        for field in fields(SceneBatch):
            ours, theirs = getattr(seen, field.name), getattr(scenes, field.name)
            if field.name == "roads":
                assert ours == theirs
            else:
                assert np.array_equal(ours, theirs), field.name


@pytest.mark.parametrize(
    "sensing", [{"position_noise": 1.0}, {"speed_noise": 1.0}, {"drop_rate": 0.5}, {"latency": 0.5}]
)
def test_the_ego_and_the_road_are_as_they_are(shield: Shield, sensing: dict[str, Any]) -> None:
    made = load_recording("highway-test")
    faulty = world(made, shield, **sensing)
    differ = False
    for _ in range(60):
        result = faulty.step(KEEP)
        assert faulty.scene(0).ego == result.scenes.scene(0).ego
        differ |= faulty.scene(0) != result.scenes.scene(0)
        playback, row = faulty.playback_of(0), faulty.frame_of(0)
        assert np.array_equal(result.scenes.x[0, 1:], playback.film.numbers(np.array([row]))[0, 0, 1:])
    assert differ


def test_an_episode_begins_as_without_faults(shield: Shield) -> None:
    made = load_recording("highway-test")
    for seed in range(5):
        clear, faulty = (world(made, shield, seed=seed, **one) for one in ({}, {"position_noise": 2.0}))
        assert clear.frame_of(0) == faulty.frame_of(0)
        assert clear.rngs[0].bit_generator.state == faulty.rngs[0].bit_generator.state
        assert clear.scene(0).ego == faulty.scene(0).ego


def errors(one: World, steps: int, name: str) -> np.ndarray:
    """The errors of a column, a row a step, a column a vehicle that is seen throughout."""
    found = []
    for _ in range(steps):
        truth = one.step(KEEP).scenes
        assert not one._egos.at.ended[0]
        seen, true = rows(one.seen, name), rows(truth, name)
        found.append({car: seen[car] - true[car] for car in true if car in seen and car >= 0})
    cars = set.intersection(*map(set, found))
    return np.array([[row[car] for car in sorted(cars)] for row in found])


@pytest.mark.parametrize(("name", "setting"), [("x", "position_noise"), ("vy", "speed_noise")])
def test_noise_is_as_strong_and_as_slow_as_asked(shield: Shield, name: str, setting: str) -> None:
    made = recording(CRAWL, frames=300)
    pooled, steps = [], []
    for seed in range(8):
        one = world(made, shield, seed=seed, **{setting: 0.4, "noise_time": 0.5})
        found = errors(one, 60, name)
        pooled.append(found.ravel())
        steps.append(np.corrcoef(found[:-1].ravel(), found[1:].ravel())[0, 1])
    values = np.concatenate(pooled)
    assert values.std() == pytest.approx(0.4, rel=0.08)
    assert abs(values.mean()) < 0.04
    assert np.mean(steps) == pytest.approx(np.exp(-0.04 / 0.5), abs=0.02)
    white = errors(world(made, shield, seed=0, **{setting: 0.4, "noise_time": 0.0}), 60, name)
    assert abs(np.corrcoef(white[:-1].ravel(), white[1:].ravel())[0, 1]) < 0.1


def test_vehicles_are_lost_as_often_and_for_as_long_as_asked(shield: Shield) -> None:
    made = recording(CRAWL, frames=400)
    there = lost = begun = 0
    for seed in range(8):
        one = world(made, shield, seed=seed, drop_rate=0.3, drop_time=0.4)
        before: set[int] = set()
        for _ in range(60):
            true, seen = set(rows(one.step(KEEP).scenes, "x")), set(rows(one.seen, "x"))
            assert -1 in seen
            assert seen <= true
            there, lost = there + len(true) - 1, lost + len(true - seen)
            begun += len((true - seen) & before)
            before = seen
    assert lost / there == pytest.approx(0.3, abs=0.03)
    assert lost * 0.04 / begun == pytest.approx(0.4, rel=0.15)


def test_what_is_seen_is_as_old_as_the_latency(shield: Shield) -> None:
    one = world(recording(CRAWL, frames=400), shield, latency=0.2)
    past = [rows(one.seen, "x")]
    for step in range(1, 40):
        truth = one.step(KEEP).scenes
        past.append(rows(truth, "x"))
        seen = rows(one.seen, "x")
        then = past[max(0, step - 5)]
        assert len(seen) > 10
        assert all(seen[car] == then[car] for car in seen if car >= 0 and car in then)
        assert seen[-1] == past[step][-1]
    # Placed anew, the ego does not remember what it saw elsewhere.
    one.reset([0], [np.random.default_rng(1)])
    assert one._scenes is not None
    assert rows(one.seen, "x") == rows(one._scenes, "x")


def test_a_vehicle_has_errors_of_its_own(shield: Shield) -> None:
    # One slot, used by one vehicle after the other; errors that hardly change.
    made = recording([Drive(1, 300.0, 0.5, end=150), Drive(1, 310.0, 0.5, begin=150)], frames=300)
    assert made.capacity == 1
    found: dict[int, set[float]] = {0: set(), 1: set()}
    one = world(made, shield, position_noise=1.0, noise_time=1e12)
    while not (found[0] and found[1]):
        one.reset([0], [np.random.default_rng(one.frame_of(0))])
        found = {0: set(), 1: set()}
        for _ in range(150):
            result = one.step(KEEP)
            if result.entered[0]:
                break
            seen, true = rows(one.seen, "y"), rows(result.scenes, "y")
            for car in {0, 1} & set(seen) & set(true):
                found[car].add(round(seen[car] - true[car], 4))
    assert len(found[0]) == len(found[1]) == 1
    assert found[0] != found[1]


def test_a_vehicle_is_in_the_lane_where_it_is_seen(shield: Shield) -> None:
    one = world(recording(CRAWL), shield, position_noise=2.0, noise_time=0.0)
    found = set()
    for _ in range(40):
        one.step(KEEP)
        for car in one.scene(0).vehicles:
            found.add(car.lane)
            inside = [lane.id for lane in LANES if abs(car.y - lane.centre) <= lane.width / 2]
            assert ([car.lane] if car.lane else []) == inside[:1]
    assert found >= {0, 1, 2}


def test_contacts_are_those_of_the_road_as_it_is(shield: Shield) -> None:
    # Nobody is ever seen, so the ego drives into standing traffic, and that is its fault.
    jam = [Drive(lane, 330.0, 0.0) for lane in (3, 4, 5)]
    one = world(recording(jam, frames=4000), shield, drop_rate=0.999, drop_time=1e6)
    for _ in range(600):
        result = one.step(KEEP)
        if result.terminated[0]:
            break
    assert result.contacts[0].at_fault
    assert not one.scene(0).vehicles


def test_it_is_a_function_of_the_episodes_seed(shield: Shield) -> None:
    made = load_recording("highway-test")
    runs = []
    for seed in (3, 3, 4):
        one = world(made, shield, seed=seed, position_noise=0.5, drop_rate=0.2, latency=0.1)
        runs.append([one.scene(0) for _ in range(30) if one.step(KEEP)])
    assert runs[0] == runs[1]
    assert runs[0] != runs[2]


@pytest.mark.parametrize("bad", [{"drop_rate": 1.0}, {"latency": -1.0}, {"position_noise": float("nan")}])
def test_impossible_faults_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(bad))):
        SensingConfig.model_validate(bad)


def test_what_the_others_see_outlasts_a_reset(shield: Shield) -> None:
    config = EnvConfig(recording="highway-test", sensing=SensingConfig(position_noise=1.0))
    playbacks = in_direction(playbacks_of([load_recording("highway-test")], 100.0), config)
    one = World(config, [playbacks] * 3, shield)
    one.reset([0, 1, 2], [np.random.default_rng(seed) for seed in range(3)])
    one.step(np.zeros(3, dtype=np.int64))
    before = [one.scene(ego) for ego in range(3)]
    one.reset([1], [np.random.default_rng(9)])
    assert [one.scene(ego) == before[ego] for ego in range(3)] == [True, False, True]
