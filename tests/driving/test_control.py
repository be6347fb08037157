"""The controllers and the motion of the ego."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drlsl.driving.scene import ACCELERATION_LIMIT, BRAKING_LIMIT, CENTRE_TOLERANCE
from drlsl.driving.shield import NO_WISH
from drlsl.driving.simulation.controllers import (
    COMFORTABLE_JERK,
    LATERAL_SPEED_LIMIT,
    URGENT_JERK,
    LaneController,
    SpeedController,
    move,
    move_forward,
)
from drlsl.driving.simulation.measures import HARD_BRAKING

speeds = st.floats(0.0, 45.0, allow_nan=False)
steps = st.sampled_from([0.04, 0.1])


def one(value: float) -> npt.NDArray[np.float64]:
    return np.array([value])


@given(speed=speeds, target=speeds, dt=steps)
def test_the_ego_does_what_the_rules_ask_within_its_limits(speed: float, target: float, dt: float) -> None:
    control = SpeedController.for_egos(1)
    acceleration = control.acceleration(one(speed), one(target), one(NO_WISH), one(dt))[0]
    assert -BRAKING_LIMIT <= acceleration <= ACCELERATION_LIMIT
    wanted = (target - speed) / dt
    assert acceleration == pytest.approx(np.clip(wanted, -BRAKING_LIMIT, ACCELERATION_LIMIT))


@given(speed=speeds, targets=st.lists(speeds, min_size=1, max_size=200), dt=steps)
def test_the_integral_never_outweighs_the_rules(speed: float, targets: list[float], dt: float) -> None:
    control = SpeedController.for_egos(1)
    now = np.array([speed])
    for target in targets:
        acceleration = control.acceleration(now, one(target), one(NO_WISH), one(dt))
        wanted = np.clip((target - now) / dt, -BRAKING_LIMIT, ACCELERATION_LIMIT)
        assert abs(acceleration - wanted)[0] < 0.5
        _, now = move_forward(now, acceleration, np.array([dt]))


wishes = st.floats(-8.0, 3.0, allow_nan=False)


@given(speed=speeds, asked=st.lists(st.tuples(speeds, wishes), min_size=1, max_size=100), dt=steps)
def test_the_ego_is_never_above_the_target_speed_nor_brakes_harder_than_it_can(
    speed: float, asked: list[tuple[float, float]], dt: float
) -> None:
    """Whatever is comfortable, the target speed is a ceiling, unless even full braking is not enough."""
    control, now = SpeedController.for_egos(1), one(speed)
    for target, wish in asked:
        acceleration = control.acceleration(now, one(target), one(wish), one(dt))
        assert -BRAKING_LIMIT <= acceleration[0] <= ACCELERATION_LIMIT
        _, later = move_forward(now, acceleration, one(dt))
        assert later[0] <= max(target, now[0] - BRAKING_LIMIT * dt) + 1e-12
        now = later


@given(speed=speeds, asked=st.lists(wishes, min_size=1, max_size=100), dt=steps)
def test_jerk_is_bounded_below_the_target_speed(speed: float, asked: list[float], dt: float) -> None:
    control, now, before = SpeedController.for_egos(1), one(speed), 0.0
    for wish in asked:
        acceleration = float(control.acceleration(now, one(100.0), one(wish), one(dt))[0])
        hard = min(wish, before) < -HARD_BRAKING
        assert abs(acceleration - before) <= (URGENT_JERK if hard else COMFORTABLE_JERK) * dt + 1e-9
        assert min(before, wish) - 1e-9 <= acceleration <= max(before, wish) + 1e-9
        _, later = move_forward(now, one(acceleration), one(dt))
        # What the ego did: at standstill it brakes no more.
        before, now = float((later - now)[0] / dt), later


def test_the_target_speed_takes_any_jerk_and_comfort_returns_by_degrees() -> None:
    control, speed = SpeedController.for_egos(1), one(20.0)
    first = control.acceleration(speed, one(19.68), one(1.0), one(0.04))
    assert first[0] == pytest.approx(-8.0)
    second = control.acceleration(speed, one(30.0), one(1.0), one(0.04))
    assert second[0] == pytest.approx(-8.0 + URGENT_JERK * 0.04)


def test_a_wish_that_is_reached_is_held() -> None:
    control, speed = SpeedController.for_egos(1), one(20.0)
    reached = [control.acceleration(speed, one(99.0), one(1.4), one(0.04))[0] for _ in range(30)]
    assert reached[0] == pytest.approx(COMFORTABLE_JERK * 0.04)
    assert reached[-1] == 1.4


def test_each_ego_has_its_own_wish_and_those_without_one_drive_the_target_speed() -> None:
    control = SpeedController.for_egos(2)
    for _ in range(5):
        found = control.acceleration(
            np.array([20.0, 20.0]), np.array([20.04, 20.04]), np.array([0.5, NO_WISH]), np.array([0.04, 0.04])
        )
    alone = SpeedController.for_egos(1)
    for _ in range(5):
        expected = alone.acceleration(one(20.0), one(20.04), one(NO_WISH), one(0.04))
    assert found[1] == expected[0]
    assert found[0] == pytest.approx(5 * COMFORTABLE_JERK * 0.04)
    assert control.integral[0] == 0.0


def test_braking_ends_at_standstill() -> None:
    place, speed = move_forward(np.array([0.1]), np.array([-8.0]), np.array([0.04]))
    assert speed[0] == 0.0
    assert place[0] >= 0.0


@pytest.mark.parametrize("dt", [0.04, 0.1])
@pytest.mark.parametrize("width", [3.0, 3.5, 3.75, -3.75])
def test_a_lane_change_takes_about_three_seconds_and_does_not_swing_out(width: float, dt: float) -> None:
    control = LaneController.for_egos(1)
    y, vy = np.zeros(1), np.zeros(1)
    path = []
    for _ in range(round(8.0 / dt)):
        y, vy = move(y, vy, control.acceleration(y, vy, np.array([width]), np.array([dt])), np.array([dt]))
        path.append(float(y[0]))
        assert abs(vy[0]) <= LATERAL_SPEED_LIMIT + 1e-9
    settled = next(i for i, place in enumerate(path) if abs(place - width) <= CENTRE_TOLERANCE) * dt
    assert 1.5 < settled < 3.5
    assert max(np.abs(path)) < abs(width) + 0.1
    assert path[-1] == pytest.approx(width, abs=0.05)


def test_a_reset_forgets_the_past_of_the_chosen_alone() -> None:
    control = SpeedController(np.array([1.0, 2.0]), np.array([-3.0, -4.0]))
    control.reset(0)
    assert control.integral.tolist() == [0.0, 2.0]
    assert control.last.tolist() == [0.0, -4.0]
