"""The world: what egos meet, where they enter, how their episodes end."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drlsl.driving import EnvConfig
from drlsl.driving.scene import Action
from drlsl.driving.shield import Shield
from drlsl.driving.simulation import StepResult, Verdict, World, in_direction, playbacks_of
from drlsl.driving.simulation.entry import Entries, beginnings, track_length
from drlsl.errors import UserError
from drlsl.traffic import Direction, Film, Recording, load_recording
from tests.driving.recordings import LANES, LENGTH, Drive, recording

KEEP, LEFT, RIGHT = (np.array([action]) for action in Action)
EMPTY = [Drive(1, 410.0, 1.0), Drive(3, 5.0, 0.0)]
"""Nearly no traffic: a recording needs a vehicle, and these are far from where the ego drives."""


@pytest.fixture(scope="module")
def shield() -> Shield:
    return Shield.default()


def world(shield: Shield, made: Recording, direction: str = "left_to_right", **settings: object) -> World:
    config = EnvConfig(recording="by-hand", direction=direction, **settings)
    return World(config, [in_direction(playbacks_of([made], config.radar_range), config)], shield)


def started(one: World, seed: int = 0) -> World:
    one.reset([0], [np.random.default_rng(seed)])
    return one


def drive(one: World, actions: list[np.ndarray]) -> list[StepResult]:
    results = []
    for action in actions:
        results.append(one.step(action))
        if results[-1].terminated[0] or results[-1].truncated[0]:
            break
    return results


@pytest.mark.parametrize("frame_rate", [0.01, 0.1, 1.0, 100.0])
def test_egos_drive_at_any_frame_rate(shield: Shield, frame_rate: float) -> None:
    one = started(world(shield, recording(EMPTY[1:], frames=5, frame_rate=frame_rate)))
    assert drive(one, [KEEP])[0].scenes.scene(0).ego.vx > 0.0


@pytest.mark.parametrize(("direction", "lanes"), [("left_to_right", {3, 4, 5}), ("right_to_left", {1, 2})])
def test_the_ego_drives_its_own_way(shield: Shield, direction: str, lanes: set[int]) -> None:
    one = started(world(shield, recording(EMPTY), direction))
    before = one.scene(0).ego
    after = drive(one, [KEEP] * 10)[-1].scenes.scene(0).ego
    sign = Direction(direction).sign
    assert before.lane in lanes
    assert sign * (after.x - before.x) > 0
    assert sign * after.vx > 0


@pytest.mark.parametrize("direction", ["left_to_right", "right_to_left"])
@pytest.mark.parametrize("action", [LEFT, RIGHT])
def test_left_is_the_drivers_left(shield: Shield, direction: str, action: np.ndarray) -> None:
    one = started(world(shield, recording(EMPTY), direction))
    before = one.scene(0).ego
    after = drive(one, [action] + [KEEP] * 20)[-1].scenes.scene(0).ego
    downward = (action is RIGHT) == (direction == "left_to_right")
    assert (after.y > before.y) == downward
    assert after.y != before.y


def test_a_lane_change_ends_in_the_next_lane_and_is_charged_once(shield: Shield) -> None:
    one = started(world(shield, recording(EMPTY)))
    while one.scene(0).ego.lane != 4:
        started(one, one.frame_of(0) + 1)
    results = drive(one, [LEFT] * 60 + [KEEP] * 60)
    assert results[0].changed[0]
    assert results[-1].scenes.scene(0).ego.lane == 3
    assert sum(result.rewards["lane_change"][0] for result in results[:60]) == -5.0
    assert results[-1].scenes.scene(0).ego.y == pytest.approx(LANES[2].centre, abs=0.1)


def test_leaving_the_road_ends_the_episode(shield: Shield) -> None:
    one = started(world(shield, recording(EMPTY)))
    results = drive(one, [LEFT] * 400)
    assert results[-1].terminated[0]
    assert results[-1].off_road[0]
    assert not results[-1].contacts
    assert results[-1].rewards["off_road"][0] < 0
    assert any(results[-1].decisions.action_mask[0])


def test_a_faster_follower_runs_into_the_ego_and_is_to_blame(shield: Shield) -> None:
    slow = [Drive(lane, 200.0, 5.0) for lane in (3, 4, 5)]
    fast = [Drive(lane, 0.0, 45.0, begin=80) for lane in (3, 4, 5)]
    one = started(world(shield, recording(slow + fast)))
    result = drive(one, [KEEP] * 400)[-1]
    assert result.terminated[0]
    assert result.contacts[0].verdict is Verdict.STRUCK_FROM_BEHIND
    assert result.rewards["collision"][0] < 0


def test_traffic_that_appears_around_the_ego_is_out_of_nowhere(shield: Shield) -> None:
    jam = [Drive(lane, x, 0.0, begin=150) for lane in (3, 4, 5) for x in np.arange(0.0, LENGTH, 8.0)]
    one = started(world(shield, recording([*EMPTY, *jam], frames=200)))
    result = drive(one, [KEEP] * 400)[-1]
    assert result.contacts[0].verdict is Verdict.OUT_OF_NOWHERE
    assert not result.contacts[0].at_fault


def test_the_ego_stops_behind_standing_traffic(shield: Shield) -> None:
    jam = [Drive(lane, 300.0, 0.0) for lane in (3, 4, 5)]
    one = started(world(shield, recording(jam, frames=700)))
    results = drive(one, [KEEP] * 500)
    ego = results[-1].scenes.scene(0).ego
    assert not any(result.contacts for result in results)
    assert abs(ego.vx) < 1.0
    assert 0.0 < 300.0 - ego.x - 4.6 < 8.0


def test_the_end_of_the_stretch_is_the_beginning(shield: Shield) -> None:
    one = started(world(shield, recording(EMPTY, frames=2000), track_length=500.0))
    results = drive(one, [KEEP] * 2000)
    entered = [result for result in results if result.entered[0]]
    assert results[-1].truncated[0]
    assert not results[-1].terminated[0]
    assert entered
    assert 500.0 <= one.distance[0] < 502.0
    assert all(60.0 <= result.scenes.scene(0).ego.x <= 140.0 for result in entered)


def test_the_end_of_the_recording_is_not_the_end_of_the_episode(shield: Shield) -> None:
    one = started(world(shield, recording(EMPTY, frames=30), track_length=200.0))
    results = drive(one, [KEEP] * 400)
    assert results[-1].truncated[0]
    assert sum(result.entered[0] for result in results) > 2


def test_an_episode_on_a_long_stretch_is_the_stretch_in_one_piece(shield: Shield) -> None:
    """It ends before the stretch and, since it begins early enough, before the recording."""
    drives = [Drive(3, 0.0, 25.0, begin=begin) for begin in range(0, 1900, 250)]
    made = replace(recording(drives, frames=2000), x_max=1400.0)
    one = world(shield, made)
    lengths = set()
    for seed in range(12):
        results = drive(started(one, seed), [KEEP] * 2000)
        assert not any(result.entered[0] for result in results)
        assert results[-1].truncated[0]
        assert results[-1].distance[0] >= 1400.0 - 140.0 - 4.6 / 2
        assert results[-1].scenes.scene(0).ego.x + 4.6 / 2 <= 1400.0 + 2.0
        lengths.add(one.frame_of(0))
    assert len(lengths) > 6


@settings(max_examples=60, deadline=None)
@given(
    length=st.floats(200.0, 5000.0),
    frames=st.integers(1, 4000),
    track=st.none() | st.floats(1.0, 6000.0),
    speed=st.floats(0.0, 40.0),
)
def test_how_long_an_episode_is_and_where_it_may_begin(
    length: float, frames: int, track: float | None, speed: float
) -> None:
    made = replace(recording([Drive(4, 100.0, speed)], frames=1), x_max=length)
    config = EnvConfig(recording="by-hand", direction="left_to_right", track_length=track)
    [playback] = in_direction(playbacks_of([made], config.radar_range), config)
    playback = replace(playback, film=repeated(playback.film, frames))
    metres, begins = track_length(playback, config), beginnings(playback, config)
    assert metres == track or (track is None and metres >= 840.0)
    assert 1 <= begins <= frames
    if length < 980.0:
        assert metres == (track or 840.0)
        assert begins == frames
    if begins < frames:
        assert (frames - begins) * playback.road.time_step * max(speed, 1.0) >= metres - 1e-6


def repeated(film: Film, frames: int) -> Film:
    """The first frame of a film, again and again."""
    return Film(np.repeat(film.cells[:1], frames, axis=0), film.pieces)


@pytest.mark.parametrize("name", ["overtake-train", "overtake-test", "overtake-dense-test"])
def test_the_bundled_long_roads_are_driven_in_one_piece(shield: Shield, name: str) -> None:
    config = EnvConfig(recording=name)
    playbacks = in_direction(playbacks_of([load_recording(name)], config.radar_range), config)
    one = World(config, [playbacks] * 16, Shield.default(tier="auto"))
    one.reset(list(range(16)), [np.random.default_rng(seed) for seed in range(16)])
    ended = np.zeros(16, dtype=np.bool_)
    for _ in range(1200):
        result = one.step(np.zeros(16, dtype=np.int64))
        assert not (result.entered & ~ended).any()
        ended |= result.terminated | result.truncated
        if ended.all():
            return
    raise AssertionError("an episode of 1.3 km takes less than two minutes")


def test_an_episode_is_a_function_of_its_seed(shield: Shield) -> None:
    made = recording([Drive(4, 100.0, 25.0), Drive(3, 60.0, 30.0), *EMPTY])
    runs = []
    for _ in range(2):
        one = started(world(shield, made, "both"), seed=7)
        runs.append([result.scenes.scene(0) for result in drive(one, [LEFT] + [KEEP] * 30)])
    assert runs[0] == runs[1]


def test_egos_do_not_influence_each_other(shield: Shield) -> None:
    made = recording([Drive(4, 100.0, 25.0), Drive(3, 60.0, 30.0), *EMPTY])
    config = EnvConfig(recording="by-hand")
    playbacks = playbacks_of([made], config.radar_range)
    many = World(config, [playbacks] * 3, shield)
    many.reset([0, 1, 2], [np.random.default_rng(seed) for seed in (5, 6, 7)])
    alone = World(config, [playbacks], shield)
    alone.reset([0], [np.random.default_rng(6)])
    for _ in range(40):
        together = many.step(np.array([0, 1, 0]))
        single = alone.step(np.array([1]))
        assert together.scenes.scene(1) == single.scenes.scene(0)
        assert together.reward[1] == single.reward[0]
        assert (together.decisions.observation[1] == single.decisions.observation[0]).all()


def test_an_unknown_action_is_refused(shield: Shield) -> None:
    with pytest.raises(ValueError, match="unknown action"):
        started(world(shield, recording(EMPTY))).step(np.array([3]))


def test_a_direction_without_lanes_is_refused(shield: Shield) -> None:
    made = recording(EMPTY)
    upper = replace(made, lanes=LANES[:2])
    with pytest.raises(UserError, match="no lane runs left_to_right"):
        world(shield, upper)


def test_the_entry_is_a_gap_that_the_rules_call_safe(shield: Shield) -> None:
    made = recording([Drive(lane, x, 20.0) for lane in (3, 4) for x in np.arange(0.0, LENGTH, 12.0)])
    playback = playbacks_of([made], 100.0)[0]
    assert playback.direction is Direction.LEFT_TO_RIGHT
    for seed in range(5):
        entry = Entries(playback, shield, (4.6, 1.9)).find(np.random.default_rng(seed), frame=0)
        assert entry.lane.id == 5


def test_entries_are_the_same_however_few_answers_are_kept(shield: Shield) -> None:
    playback = playbacks_of([load_recording("highway-test")], 100.0)[0]
    found = []
    for kept in (1, 9, 1000):
        entries, rng = Entries(playback, shield, (4.6, 1.9), kept), np.random.default_rng(4)
        found.append([entries.find(rng, frame=int(frame)) for frame in rng.integers(0, 90, 40)])
        assert len(entries._known) <= max(kept, 4)
    assert found[0] == found[1] == found[2]


def test_a_road_without_a_gap_is_refused(shield: Shield) -> None:
    made = recording(
        [Drive(lane, x, 0.0) for lane in (3, 4, 5) for x in np.arange(0.0, LENGTH, 12.0)], frames=5
    )
    playback = playbacks_of([made], 100.0)[0]
    assert playback.direction is Direction.LEFT_TO_RIGHT
    with pytest.raises(UserError, match="no gap that the rules call safe"):
        Entries(playback, shield, (4.6, 1.9)).find(np.random.default_rng(0), frame=0)


@pytest.mark.parametrize(("rules", "same"), [("highway.pl", False), ("paper.pl", True)])
def test_a_state_of_before_has_accelerations_of_nought(rules: str, same: bool) -> None:
    """A checkpoint of a version without bounded jerk is read; rules without a comfortable one go on as it."""
    programs = Shield.from_files([rules])
    traffic = recording([Drive(lane, 300.0, 12.0) for lane in (3, 4, 5)])
    first, second, third = (started(world(programs, traffic)) for _ in range(3))
    drive(first, [KEEP] * 160)
    state = first.get_state()
    old = {name: value for name, value in state.items() if name != "acceleration"}
    assert (state["acceleration"] < 0).all()
    second.set_state(old)
    third.set_state({**old, "acceleration": np.zeros(1)})
    speeds = [
        [float(result.speed[0]) for result in drive(one, [KEEP] * 20)] for one in (first, second, third)
    ]
    assert speeds[1] == speeds[2]
    assert (speeds[0] == speeds[1]) is same
