"""Contacts on hand-made tracks: each rule that excuses the ego, and each near miss of it."""

from __future__ import annotations

import numpy as np
import pytest

from drlsl.driving.simulation import BRAKING, REACTION, Verdict
from drlsl.driving.simulation.fault import Track, judge, time_to_avoid
from drlsl.traffic import Direction, Lane

DT = 0.04
LANES = tuple(Lane(i + 1, Direction.LEFT_TO_RIGHT, 1.75 + 3.5 * i, 3.5, 36.0) for i in range(3))
CENTRE = {lane.id: lane.centre for lane in LANES}
LENGTH, WIDTH = 4.6, 1.9


def track(s: float, speed: float, y: float | np.ndarray, steps: int) -> Track:
    """A vehicle at constant speed that ends at `s`."""
    times = (np.arange(steps, dtype=np.float64) - (steps - 1)) * DT
    return Track(
        s + speed * times, np.broadcast_to(y, steps).astype(float), np.full(steps, speed), LENGTH, WIDTH
    )


def sideways(begin: float, end: float, steps: int, moving: int) -> np.ndarray:
    """The y of a vehicle that moves from `begin` to `end` in its last `moving` frames."""
    return np.concatenate((np.full(steps - moving, begin), np.linspace(begin, end, moving)))


def verdict(ego: Track, other: Track, *, other_appeared: bool = False) -> Verdict:
    return judge(ego, other, LANES, DT, other_appeared=other_appeared)


@pytest.mark.parametrize("closing", [0.5, 5.0, 20.0])
def test_a_follower_that_had_time_to_brake_is_to_blame(closing: float) -> None:
    steps = 200
    ego = track(100.0, 20.0, CENTRE[2], steps)
    other = track(100.0 - LENGTH + 0.01, 20.0 + closing, CENTRE[2], steps)
    assert closing * (steps - 1) * DT / closing > time_to_avoid(closing)
    assert verdict(ego, other) is Verdict.STRUCK_FROM_BEHIND


def test_entering_a_lane_right_before_a_faster_follower_is_the_egos_fault() -> None:
    steps = 100
    ego = track(100.0, 20.0, sideways(CENTRE[1], CENTRE[2], steps, 20), steps)
    other = track(100.0 - LENGTH + 0.01, 30.0, CENTRE[2], steps)
    assert verdict(ego, other) is Verdict.AT_FAULT


@pytest.mark.parametrize(
    ("margin", "expected"), [(0.3, Verdict.STRUCK_FROM_BEHIND), (-0.3, Verdict.AT_FAULT)]
)
def test_the_cut_in_criterion_decides_between_ego_and_follower(margin: float, expected: Verdict) -> None:
    closing, steps = 8.0, 400
    # The ego is in lane 2 from one frame to the next; from then the follower has `left` seconds.
    left = time_to_avoid(closing) + margin
    after = round(left / DT)
    y = np.full(steps, CENTRE[2])
    y[: steps - after] = CENTRE[1]
    ego = track(100.0, 20.0, y, steps)
    other = track(100.0 - LENGTH + 0.01, 20.0 + closing, CENTRE[2], steps)
    assert verdict(ego, other) is expected


def test_a_follower_in_the_lane_that_the_ego_is_leaving_is_to_blame() -> None:
    steps = 300
    y = sideways(CENTRE[1], CENTRE[1] + 1.8, steps, 20)
    assert verdict(track(100.0, 20.0, y, steps), track(100.0 - LENGTH + 0.01, 25.0, CENTRE[1], steps)) is (
        Verdict.STRUCK_FROM_BEHIND
    )


def test_a_follower_that_appears_behind_is_not_the_egos_fault() -> None:
    ego = track(100.0, 20.0, CENTRE[2], 200)
    assert verdict(ego, track(100.0 - LENGTH + 0.01, 35.0, CENTRE[2], 5), other_appeared=True) is (
        Verdict.STRUCK_FROM_BEHIND
    )


def test_placing_the_ego_right_before_a_follower_is_the_egos_fault() -> None:
    ego = track(100.0, 20.0, CENTRE[2], 5)
    other = track(100.0 - LENGTH + 0.01, 35.0, CENTRE[2], 5)
    assert verdict(ego, other) is Verdict.AT_FAULT


def test_a_vehicle_that_moves_in_behind_the_ego_is_to_blame() -> None:
    steps = 200
    ego = track(100.0, 15.0, CENTRE[2], steps)
    close = track(100.0 - LENGTH + 0.01, 15.5, sideways(CENTRE[1], CENTRE[2], steps, 60), steps)
    assert verdict(ego, close) is Verdict.STRUCK_FROM_BEHIND


def test_a_follower_that_swerves_back_behind_an_ego_that_changed_lanes_is_to_blame() -> None:
    steps = 240
    ego_y = np.concatenate(
        (np.full(150, CENTRE[1]), np.linspace(CENTRE[1], CENTRE[2], 50), np.full(40, CENTRE[2]))
    )
    other_y = np.concatenate(
        (np.linspace(CENTRE[2], CENTRE[1] + 0.4, 190), np.linspace(CENTRE[1] + 0.4, 3.3, 50))
    )
    ego, other = track(100.0, 26.0, ego_y, steps), track(100.0 - LENGTH + 0.01, 27.5, other_y, steps)
    assert verdict(ego, other) is Verdict.STRUCK_FROM_BEHIND


@pytest.mark.parametrize(
    ("follower_y", "expected"),
    [(CENTRE[1], Verdict.STRUCK_FROM_BEHIND), (CENTRE[1] + 1.0, Verdict.AT_FAULT)],
    ids=["wholly in the ego's lane", "over the line"],
)
def test_where_a_follower_was_at_its_last_chance_decides_though_both_change_lanes_after_it(
    follower_y: float, expected: Verdict
) -> None:
    # At 4 m/s of closing speed the last chance is 17 frames before the contact.
    steps = 300
    ego = track(100.0, 25.0, sideways(CENTRE[1], CENTRE[1] + 2.8, steps, 24), steps)
    other = track(100.0 - LENGTH + 0.01, 29.0, sideways(follower_y, CENTRE[1] + 1.6, steps, 12), steps)
    assert verdict(ego, other) is expected


def test_time_that_was_left_while_the_other_was_ahead_excuses_nothing() -> None:
    # The ego, on the line between two lanes, passes the other and brakes before it.
    speeds = np.repeat([20.0, 40.0, 20.0], [50, 200, 15])
    steps = len(speeds)
    s = np.concatenate(([0.0], np.cumsum(speeds[1:]) * DT))
    ego = Track(s, np.full(steps, CENTRE[2] + 1.0), speeds, LENGTH, WIDTH)
    other = track(s[-1] - LENGTH + 0.01, 25.0, sideways(CENTRE[1], CENTRE[2], steps, 15), steps)
    assert other.s[0] > ego.s[0]
    assert verdict(ego, other) is Verdict.AT_FAULT


def test_a_follower_across_both_lanes_does_not_excuse_entering_the_second() -> None:
    steps = 100
    ego = track(100.0, 20.0, sideways(CENTRE[1], CENTRE[1] + 1.6, steps, 20), steps)
    other = track(100.0 - LENGTH + 0.01, 32.0, (CENTRE[1] + CENTRE[2]) / 2, steps)
    assert verdict(ego, other) is Verdict.AT_FAULT


def test_moving_in_before_a_vehicle_that_moves_in_behind_is_the_egos_fault() -> None:
    steps = 200
    ego = track(100.0, 15.0, sideways(CENTRE[3], CENTRE[2], steps, 40), steps)
    close = track(100.0 - LENGTH + 0.01, 30.0, sideways(CENTRE[1], CENTRE[2], steps, 60), steps)
    assert verdict(ego, close) is Verdict.AT_FAULT


def test_running_into_a_leader_is_the_egos_fault() -> None:
    ego, other = track(100.0, 30.0, CENTRE[2], 200), track(100.0 + LENGTH - 0.01, 20.0, CENTRE[2], 200)
    assert verdict(ego, other) is Verdict.AT_FAULT


@pytest.mark.parametrize(("moving", "expected"), [(15, Verdict.CUT_OFF), (150, Verdict.AT_FAULT)])
def test_a_cut_in_excuses_the_ego_only_if_it_left_no_time(moving: int, expected: Verdict) -> None:
    steps = 250
    ego = track(100.0, 30.0, CENTRE[2], steps)
    other = track(100.0 + LENGTH - 0.01, 20.0, sideways(CENTRE[1], CENTRE[2], steps, moving), steps)
    assert verdict(ego, other) is expected


def test_a_vehicle_that_was_in_the_lane_behind_and_has_passed_does_not_excuse_running_into_it() -> None:
    # It is 0.5 m over the line all along, so that the ego's side stays clear until the end.
    steps = 400
    speeds = np.repeat([40.0, 20.0], [150, 250])
    s = np.concatenate(([0.0], np.cumsum(speeds[1:]) * DT))
    over = CENTRE[1] + (3.5 - WIDTH) / 2 + 0.5
    y = np.concatenate((np.full(20, CENTRE[1]), np.full(steps - 21, over), [CENTRE[2] - 1.0]))
    other = Track(s, y, speeds, LENGTH, WIDTH)
    ego = track(s[-1] - LENGTH + 0.01, 25.0, CENTRE[2], steps)
    assert other.s[20] < ego.s[20] - LENGTH
    assert verdict(ego, other) is Verdict.AT_FAULT


def test_a_cut_in_does_not_excuse_an_ego_that_is_changing_lanes() -> None:
    steps = 250
    ego = track(100.0, 30.0, sideways(CENTRE[3], CENTRE[2], steps, 15), steps)
    other = track(100.0 + LENGTH - 0.01, 20.0, sideways(CENTRE[1], CENTRE[2], steps, 15), steps)
    assert verdict(ego, other) is Verdict.AT_FAULT


def test_a_vehicle_alongside_that_moves_over_is_to_blame() -> None:
    steps = 100
    ego = track(100.0, 30.0, CENTRE[2], steps)
    other = track(101.0, 30.0, sideways(CENTRE[1], CENTRE[2] - WIDTH + 0.05, steps, 40), steps)
    assert verdict(ego, other) is Verdict.STRUCK_FROM_THE_SIDE


def test_moving_over_into_a_vehicle_alongside_is_the_egos_fault() -> None:
    steps = 100
    ego = track(100.0, 30.0, sideways(CENTRE[2], CENTRE[1] + WIDTH - 0.05, steps, 40), steps)
    assert verdict(ego, track(101.0, 30.0, CENTRE[1], steps)) is Verdict.AT_FAULT


def test_two_that_move_into_one_lane_is_the_egos_fault() -> None:
    steps = 100
    ego = track(100.0, 30.0, sideways(CENTRE[1], CENTRE[2] - 0.9, steps, 40), steps)
    other = track(101.0, 30.0, sideways(CENTRE[3], CENTRE[2] + 0.9, steps, 40), steps)
    assert verdict(ego, other) is Verdict.AT_FAULT


def test_a_vehicle_that_appears_inside_the_stopping_distance_is_nobodys_fault() -> None:
    steps = 20
    ego, other = track(100.0, 30.0, CENTRE[2], steps), track(100.0 + LENGTH - 0.01, 5.0, CENTRE[2], steps)
    assert verdict(ego, other, other_appeared=True) is Verdict.OUT_OF_NOWHERE
    assert verdict(ego, other, other_appeared=False) is Verdict.AT_FAULT


def test_a_vehicle_that_appears_right_behind_an_ego_on_its_way_out_is_nobodys_fault() -> None:
    steps = 8
    y = np.linspace(CENTRE[1] + 1.0, CENTRE[1] + 1.6, steps)
    ego, other = track(100.0, 20.0, y, steps), track(100.0 - LENGTH + 0.01, 24.0, CENTRE[1], steps)
    assert verdict(ego, other, other_appeared=True) is Verdict.OUT_OF_NOWHERE
    assert verdict(ego, other, other_appeared=False) is Verdict.AT_FAULT


def test_a_vehicle_that_appeared_long_ago_is_no_surprise() -> None:
    steps = round((REACTION + 30.0 / BRAKING) / DT) + 10
    ego, other = track(100.0, 30.0, CENTRE[2], steps), track(100.0 + LENGTH - 0.01, 25.0, CENTRE[2], steps)
    assert verdict(ego, other, other_appeared=True) is Verdict.AT_FAULT


def test_a_vehicle_that_appears_beyond_the_stopping_distance_is_no_surprise() -> None:
    steps = 90
    ego, other = track(100.0, 10.0, CENTRE[2], steps), track(100.0 + LENGTH - 0.01, 0.0, CENTRE[2], steps)
    gap = float(other.s[0] - ego.s[0]) - LENGTH
    assert gap > 10.0 * REACTION + 100.0 / (2 * BRAKING)
    assert verdict(ego, other, other_appeared=True) is Verdict.AT_FAULT


@pytest.mark.parametrize(
    ("apart", "seconds", "expected"),
    [
        (0.7, 0.4, Verdict.OUT_OF_NOWHERE),
        (1.6, 0.9, Verdict.AT_FAULT),
        (1.0, 1.2, Verdict.AT_FAULT),
    ],
    ids=["too near to stop", "room to stop", "time to stop"],
)
def test_a_vehicle_that_appears_beside_an_ego_in_mid_change(
    apart: float, seconds: float, expected: Verdict
) -> None:
    """The ego moves over at 1.8 m/s: stopping sideways takes 0.95 s and 1.17 m. The other stands."""
    steps = round(seconds / DT) + 1
    y = np.linspace(CENTRE[1] + WIDTH + apart, CENTRE[1] + WIDTH + apart - 1.8 * seconds, steps)
    y[-1] = min(y[-1], CENTRE[1] + WIDTH - 0.01)
    ego = track(100.0 + 10.0 * seconds, 10.0, y, steps)
    ego.s[:] = 100.0 + np.minimum(10.0 * np.arange(steps) * DT, 3.5)
    other = track(99.0, 0.0, CENTRE[1], steps)
    assert verdict(ego, other, other_appeared=True) is expected
    assert verdict(ego, other, other_appeared=False) is Verdict.AT_FAULT


@pytest.mark.parametrize(
    ("ego_moves", "expected"), [(False, Verdict.STRUCK_FROM_THE_SIDE), (True, Verdict.AT_FAULT)]
)
def test_a_follower_that_swerves_past_the_ego_and_back_strikes_it_from_the_side(
    ego_moves: bool, expected: Verdict
) -> None:
    """It is never wholly out of the ego's lane; it had time to brake while it was behind the ego in it."""
    steps = 200
    beside = CENTRE[2] + WIDTH + 0.4
    back = np.linspace(beside, CENTRE[2] + WIDTH - 0.01, 15)
    y = np.concatenate((sideways(CENTRE[2], beside, steps - 15, 60), back))
    ego_y = np.full(steps, CENTRE[2])
    if ego_moves:
        ego_y[:-20] = CENTRE[1]
    ego, other = track(100.0, 20.0, ego_y, steps), track(99.0, 23.0, y, steps)
    assert verdict(ego, other) is expected
