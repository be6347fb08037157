"""Traffic that reacts: who brakes for whom, and that all else is as recorded."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drlsl.driving import EnvConfig, stress
from drlsl.driving.scene import Action
from drlsl.driving.shield import Shield
from drlsl.driving.simulation import StepResult, Verdict, World, in_direction, playbacks_of
from drlsl.driving.simulation.reactive import SIDE_ROOM, _Cars, _followers
from drlsl.logic import Engine
from drlsl.traffic import Recording, Traffic, load_recording
from tests.driving.recordings import Drive, recording

KEEP = np.array([Action.LANE_KEEPING])
CREEP = """
safe_actions(lane_keeping).  safe_actions(left_lane_change).  safe_actions(right_lane_change).
front_is_free.  longitudinal_velocity({speed}).  state([0, 0, 0, 0, 0, 0, 0, 0, 0, 0]).
entry_is_safe :- vehicle(ego, {lane}, _, _, _, _, _, _).
"""


def creeping(speed: float, lane: int) -> Shield:
    """An ego in `lane` that goes for `speed`, whatever is around."""
    engine = Engine()
    engine.consult_text(":- dynamic(vehicle/8).\n" + CREEP.format(speed=speed, lane=lane), name="creep")
    return Shield(engine)


def world(made: Recording, shield: Shield, traffic: str, direction: str = "left_to_right") -> World:
    config = EnvConfig(recording="by-hand", direction=direction, traffic=traffic, track_length=300.0)
    one = World(config, [in_direction(playbacks_of([made], config.radar_range), config)], shield)
    # An episode that begins in the first frames of the recording.
    seed = next(seed for seed in range(10_000) if begin(seed, made.frame_count) < 5)
    one.reset([0], [np.random.default_rng(seed)])
    return one


def begin(seed: int, frames: int) -> int:
    """The frame that an episode of a seed begins in, where there is one playback."""
    rng = np.random.default_rng(seed)
    rng.integers(1)
    return int(rng.integers(frames))


def drive(one: World, steps: int) -> list[StepResult]:
    results = []
    for _ in range(steps):
        results.append(one.step(KEEP))
        if results[-1].terminated[0] or results[-1].truncated[0] or results[-1].entered[0]:
            break
    return results


def place(result: StepResult, vehicle: int) -> tuple[float, float]:
    """The x and vx of a vehicle."""
    slot = result.scenes.id[0].tolist().index(vehicle)
    return float(result.scenes.x[0, slot]), float(result.scenes.vx[0, slot])


@pytest.mark.parametrize(("direction", "lane"), [("left_to_right", 4), ("right_to_left", 2)])
def test_a_follower_brakes_for_the_ego_instead_of_driving_through_it(direction: str, lane: int) -> None:
    back = 0.0 if direction == "left_to_right" else 420.0
    others = [Drive(other, 200.0, 0.0) for other in (1, 3)]
    made = recording([*others, Drive(lane, back, 25.0)], frames=450)
    shield = creeping(10.0, lane)
    recorded = drive(world(made, shield, "recorded", direction), 440)
    assert recorded[-1].contacts[0].verdict is Verdict.STRUCK_FROM_BEHIND
    reactive = drive(world(made, shield, "reactive", direction), 440)
    assert not any(result.contacts for result in reactive)
    ego, follower = place(reactive[len(recorded)], -1), place(reactive[len(recorded)], 2)
    sign = 1 if direction == "left_to_right" else -1
    assert sign * (ego[0] - follower[0]) > 4.6
    assert 0.0 < sign * follower[1] < 20.0


def test_who_follows_a_vehicle_that_brakes_brakes_too() -> None:
    chain = [Drive(4, 0.0, 25.0), *(Drive(4, 0.0, 25.0, begin=frame) for frame in (30, 60, 90, 120))]
    made = recording([*chain, Drive(1, 200.0, 0.0)], frames=450)
    results = drive(world(made, creeping(8.0, 4), "reactive"), 440)
    assert not any(result.contacts for result in results)
    x = sorted(place(results[200], vehicle)[0] for vehicle in (-1, 0, 1, 2, 3, 4))
    assert np.diff(x).min() > 4.6
    assert all(place(results[200], vehicle)[1] < 24.0 for vehicle in (0, 1, 2, 3))


def test_nobody_reacts_where_nobody_is_in_the_way() -> None:
    made = recording([Drive(3, 0.0, 30.0), Drive(5, 0.0, 25.0), Drive(1, 400.0, 30.0)], frames=450)
    runs = [drive(world(made, creeping(20.0, 4), traffic), 200) for traffic in ("recorded", "reactive")]
    assert len(runs[0]) == len(runs[1]) == 200
    for ours, theirs in zip(*runs, strict=True):
        for name in ("x", "y", "vx", "vy", "id", "valid"):
            assert np.array_equal(getattr(ours.scenes, name), getattr(theirs.scenes, name))
        assert np.array_equal(ours.reward, theirs.reward)


def test_a_vehicle_returns_to_the_record_and_stays_on_it() -> None:
    # The ego speeds up and away; who had to brake for it catches up with its recorded place.
    made = recording([Drive(4, 30.0, 15.0), Drive(1, 200.0, 0.0)], frames=600)
    one, shield = None, creeping(30.0, 4)
    for seed in range(2000):
        if begin(seed, made.frame_count) > 60:
            continue
        config = EnvConfig(recording="by-hand", direction="left_to_right", traffic="reactive")
        one = World(config, [in_direction(playbacks_of([made], 100.0), config)], shield)
        one.reset([0], [np.random.default_rng(seed)])
        ego = one.scene(0).ego
        behind = [car for car in one.scene(0).vehicles if car.id == "v0" and 5.0 < ego.x - car.x < 9.0]
        if behind:
            break
    assert one is not None
    assert behind
    lags, speeds, begun = [], [], one.frame_of(0)
    for frame, result in enumerate(drive(one, 300), begun + 1):
        if not result.entered[0]:
            x, speed = place(result, 0)
            speeds.append(speed)
            lags.append(30.0 + 15.0 * frame / 25.0 - x)
    assert max(lags) > 0.5, "it had to brake"
    assert min(lags) > -1e-9, "it never is ahead of the record"
    assert lags[-1] == pytest.approx(0.0, abs=1e-9)
    assert speeds[-1] == 15.0
    returned = next(index for index, lag in enumerate(lags) if lag == max(lags))
    assert np.diff(lags[returned:]).max() < 1e-9
    assert max(speeds) > 15.1, "it catches up"
    assert np.diff(speeds[returned:]).min() > -0.3, "it is slowing down by the time it is there"


def test_contacts_are_judged_by_where_vehicles_drove() -> None:
    made = recording([Drive(4, 0.0, 25.0), Drive(1, 200.0, 0.0)], frames=450)
    one = world(made, creeping(5.0, 4), "reactive")
    results = drive(one, 250)
    playback, frame = one.playback_of(0), one.frame_of(0)
    slot = results[-1].scenes.id[0].tolist().index(0)
    track = playback.track(frame, slot, frame - len(results) + 1)
    reactive = one._reactive
    assert reactive is not None
    driven = reactive.driven(0, slot, track)
    assert driven.s.tolist() == [place(result, 0)[0] for result in results[-len(driven.s) :]]
    assert driven.speed.tolist() == [place(result, 0)[1] for result in results[-len(driven.s) :]]
    assert (driven.s <= track.s).all()
    assert driven.s[-1] < track.s[-1] - 10.0
    assert one._judge(0, slot).closing_speed == abs(one.speed[0] - driven.speed[-1])
    assert one._judge(0, slot).closing_speed < 15.0


def test_who_drove_where_is_part_of_the_state() -> None:
    made = recording([Drive(4, 0.0, 25.0), Drive(1, 200.0, 0.0)], frames=450)
    first, second = (world(made, creeping(5.0, 4), "reactive") for _ in range(2))
    results = drive(first, 200)
    second.set_state(first.get_state())
    frame, slot = first.frame_of(0), results[-1].scenes.id[0].tolist().index(0)
    track = first.playback_of(0).track(frame, slot, 0)
    tracks = []
    for one in (first, second):
        assert one._reactive is not None
        tracks.append(one._reactive.driven(0, slot, track))
    assert tracks[0].s.tolist() == tracks[1].s.tolist()
    assert tracks[0].speed.tolist() == tracks[1].speed.tolist()
    assert tracks[0].s[-1] < track.s[-1] - 10.0


def test_who_need_not_brake_does_not_leave_the_record() -> None:
    # Recorded speeds jump up and down as measured ones do; the ego is as fast, and far ahead.
    made = recording([Drive(4, 0.0, 20.0), Drive(1, 200.0, 0.0)], frames=200)
    cells = made.film.cells.copy()
    cells[::2, 2] += 5000 * (cells[::2, 2] > 0)
    made = replace(made, film=replace(made.film, cells=cells))
    one = world(made, creeping(20.0, 4), "reactive")
    assert one._reactive is not None
    for _ in range(100):
        one.step(KEEP)
        assert not one._reactive.lag.any()


@pytest.mark.parametrize("begin", [0, 1])
def test_nobody_is_ahead_of_the_record(begin: int) -> None:
    # Recorded places jump to and fro as measured ones do.
    made = recording([Drive(4, 0.0, 25.0), Drive(1, 200.0, 0.0)], frames=450)
    cells = made.film.cells.copy()
    cells[begin::2, 0, 1:] += 20_000
    made = replace(made, film=replace(made.film, cells=cells))
    one = world(made, creeping(15.0, 4), "reactive")
    assert one._reactive is not None
    lags = []
    for _ in range(200):
        one.step(KEEP)
        lags.append(one._reactive.lag.copy())
    assert np.max(lags) > 10.0
    assert np.min(lags) >= 0.0


def followed(cars: _Cars, lagging: np.ndarray) -> set[tuple[int, int]]:
    """Who follows whom, one car at a time."""
    found, slots = set(), cars.s.shape[1]
    for scene in range(len(cars.s)):
        cars_here = [slot for slot in range(slots) if cars.there[scene, slot]]
        for rear in cars_here:
            in_way = [
                slot
                for slot in cars_here
                if cars.s[scene, slot] > cars.s[scene, rear]
                and abs(cars.y[scene, slot] - cars.y[scene, rear])
                < (cars.width[scene, slot] + cars.width[scene, rear]) / 2 + SIDE_ROOM
            ]
            if rear == 0 or not in_way:
                continue
            front = min(in_way, key=lambda slot: cars.s[scene, slot])
            if lagging[scene, rear] or lagging[scene, front] or front == 0:
                found.add((scene * slots + rear, scene * slots + front))
    return found


@given(st.integers(0, 10_000), st.integers(1, 25), st.floats(0.0, 0.5))
def test_the_nearest_in_the_way_is_followed(seed: int, slots: int, share: float) -> None:
    rng, shape = np.random.default_rng(seed), (4, slots)
    there = rng.random(shape) < 0.8
    there[:, 0] = True
    lagging = (rng.random(shape) < share) & there
    lagging[:, 0] = False
    y = 3.5 * rng.integers(3, size=shape) + rng.normal(0.0, 0.5, shape)
    cars = _Cars(rng.uniform(0.0, 300.0, shape), y, y, y, rng.uniform(1.7, 2.6, shape), there)
    rear, front = _followers(cars, lagging, np.ones(len(lagging), dtype=np.bool_))
    pairs = list(zip(rear.tolist(), front.tolist(), strict=True))
    assert len(set(rear.tolist())) == len(rear)
    assert set(pairs) == followed(cars, lagging)


def test_the_lag_goes_with_the_vehicle_and_with_the_ego() -> None:
    # One slot, used by one vehicle after the other.
    made = recording([Drive(4, 0.0, 25.0, end=150), Drive(4, 0.0, 25.0, begin=150, end=300)], frames=300)
    assert made.capacity == 1
    one = world(made, creeping(5.0, 4), "reactive")
    lagged, fresh = False, False
    while not fresh:
        result = one.step(KEEP)
        assert not result.contacts
        lagged |= 0 in result.scenes.id[0] and place(result, 0)[1] < 24.0
        if 1 in result.scenes.id[0]:
            assert place(result, 1) == (0.0, 25.0)
            fresh = True
    assert lagged
    one.reset([0], [np.random.default_rng(0)])
    assert one._reactive is not None
    assert not one._reactive.lag.any()


def test_egos_do_not_influence_each_others_traffic() -> None:
    config = EnvConfig(recording="freeway", traffic="reactive")
    freeway, highway = (playbacks_of([load_recording(name)], 100.0) for name in ("freeway", "highway-test"))
    shield = Shield.default(tier="auto")
    many = World(config, [freeway, highway, freeway], shield)
    many.reset([0, 1, 2], [np.random.default_rng(seed) for seed in (5, 6, 7)])
    alone = World(config, [freeway], shield)
    alone.reset([0], [np.random.default_rng(7)])
    for _ in range(400):
        together, single = many.step(np.zeros(3, dtype=np.int64)), alone.step(KEEP)
        assert together.scenes.scene(2) == single.scenes.scene(0)
    assert alone._reactive is not None
    assert alone._reactive.lag.any()
    # And what is taken over goes on alike.
    other = World(config, [freeway], shield)
    other.reset([0], [np.random.default_rng(0)])
    other.set_state(alone.get_state())
    for _ in range(20):
        assert other.step(KEEP).scenes.scene(0) == alone.step(KEEP).scenes.scene(0)


def test_freeway_followers_no_longer_strike_the_ego() -> None:
    shield, made = Shield.default(tier="auto"), load_recording("freeway")
    counts = {}
    for traffic in ("recorded", "reactive"):
        config = EnvConfig(recording="freeway", traffic=traffic)
        *_, report = stress(config, [made], shield, ["random"], episodes=24, seed=0)
        counts[traffic] = report.total
    assert counts["recorded"].contacts_not_at_fault > 20
    assert counts["reactive"].contacts_not_at_fault < 8
    assert counts["reactive"].contacts_at_fault == counts["reactive"].off_road == 0


def outcome(name: str, traffic: str) -> dict[str, object]:
    """The counts of some episodes in a recording."""
    config = EnvConfig(recording=name, traffic=traffic)
    *_, report = stress(
        config, [load_recording(name)], Shield.default(tier="auto"), ["always-change"], episodes=24, seed=3
    )
    return report.as_json()


@pytest.mark.parametrize(("name", "as_said"), [("freeway", "recorded"), ("overtake-dense-test", "reactive")])
def test_traffic_is_as_the_recording_says_unless_configured(name: str, as_said: str) -> None:
    results = {traffic: outcome(name, traffic) for traffic in ("auto", "recorded", "reactive")}
    assert results["auto"] == results[as_said]
    assert results["recorded"] != results["reactive"]


def test_of_several_recordings_each_says_it_of_its_own_traffic() -> None:
    made = recording([Drive(4, 60.0, 30.0), Drive(3, 5.0, 0.0)])
    reactive = replace(made, traffic=Traffic.REACTIVE)
    config = EnvConfig(recording="by-hand", direction="left_to_right")
    playbacks = [in_direction(playbacks_of([one], config.radar_range), config) for one in (made, reactive)]
    both = World(config, playbacks, creeping(10.0, 4))
    alone = [
        World(config.model_copy(update={"traffic": traffic}), [playbacks[0]], creeping(10.0, 4))
        for traffic in ("recorded", "reactive")
    ]
    seed = next(seed for seed in range(10_000) if begin(seed, made.frame_count) < 5)
    both.reset([0, 1], [np.random.default_rng(seed), np.random.default_rng(seed)])
    for one in alone:
        one.reset([0], [np.random.default_rng(seed)])
    behind = []
    for _ in range(100):
        result = both.step(np.zeros(2, dtype=np.int64))
        for ego, one in enumerate(alone):
            expected = one.step(KEEP).scenes
            assert result.scenes.x[ego].tolist() == expected.x[0].tolist()
            assert result.scenes.vx[ego].tolist() == expected.vx[0].tolist()
        behind.append(result.scenes.x[:, 1:].copy())
    assert (behind[-1][0] != behind[-1][1]).any()
