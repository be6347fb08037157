"""The controllers and the motion of the ego."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drlsl.driving.scene import ACCELERATION_LIMIT, BRAKING_LIMIT, CENTRE_TOLERANCE
from drlsl.driving.shield import NO_WISH
from drlsl.driving.simulation.controllers import (
    COMFORTABLE_JERK,
    LATERAL_SPEED_LIMIT,
    URGENT_JERK,
    lane_control,
    move,
    move_forward,
    speed_control,
)
from drlsl.driving.simulation.measures import HARD_BRAKING

speeds = st.floats(0.0, 45.0, allow_nan=False)
steps = st.sampled_from([0.04, 0.1])


@dataclass
class Control:
    """The speed controller with its memory."""

    integral: float = 0.0
    last: float = 0.0

    def acceleration(self, speed: float, target: float, comfortable: float, dt: float) -> float:
        result, self.integral, self.last = speed_control(
            speed, target, comfortable, dt, self.integral, self.last
        )
        return result


@given(speed=speeds, target=speeds, dt=steps)
def test_the_ego_does_what_the_rules_ask_within_its_limits(speed: float, target: float, dt: float) -> None:
    acceleration = Control().acceleration(speed, target, NO_WISH, dt)
    assert -BRAKING_LIMIT <= acceleration <= ACCELERATION_LIMIT
    wanted = (target - speed) / dt
    assert acceleration == pytest.approx(np.clip(wanted, -BRAKING_LIMIT, ACCELERATION_LIMIT))


@given(speed=speeds, targets=st.lists(speeds, min_size=1, max_size=200), dt=steps)
def test_the_integral_never_outweighs_the_rules(speed: float, targets: list[float], dt: float) -> None:
    control, now = Control(), speed
    for target in targets:
        acceleration = control.acceleration(now, target, NO_WISH, dt)
        wanted = np.clip((target - now) / dt, -BRAKING_LIMIT, ACCELERATION_LIMIT)
        assert abs(acceleration - wanted) < 0.5
        _, now = move_forward(now, acceleration, dt)


wishes = st.floats(-8.0, 3.0, allow_nan=False)


@given(speed=speeds, asked=st.lists(st.tuples(speeds, wishes), min_size=1, max_size=100), dt=steps)
def test_the_ego_is_never_above_the_target_speed_nor_brakes_harder_than_it_can(
    speed: float, asked: list[tuple[float, float]], dt: float
) -> None:
    """Whatever is comfortable, the target speed is a ceiling, unless even full braking is not enough."""
    control, now = Control(), speed
    for target, wish in asked:
        acceleration = control.acceleration(now, target, wish, dt)
        assert -BRAKING_LIMIT <= acceleration <= ACCELERATION_LIMIT
        _, later = move_forward(now, acceleration, dt)
        assert later <= max(target, now - BRAKING_LIMIT * dt) + 1e-12
        now = later


@given(speed=speeds, asked=st.lists(wishes, min_size=1, max_size=100), dt=steps)
def test_jerk_is_bounded_below_the_target_speed(speed: float, asked: list[float], dt: float) -> None:
    control, now, before = Control(), speed, 0.0
    for wish in asked:
        acceleration = control.acceleration(now, 100.0, wish, dt)
        hard = min(wish, before) < -HARD_BRAKING
        assert abs(acceleration - before) <= (URGENT_JERK if hard else COMFORTABLE_JERK) * dt + 1e-9
        assert min(before, wish) - 1e-9 <= acceleration <= max(before, wish) + 1e-9
        _, later = move_forward(now, acceleration, dt)
        # What the ego did: at standstill it brakes no more.
        before, now = (later - now) / dt, later


def test_the_target_speed_takes_any_jerk_and_comfort_returns_by_degrees() -> None:
    control = Control()
    assert control.acceleration(20.0, 19.68, 1.0, 0.04) == pytest.approx(-8.0)
    assert control.acceleration(20.0, 30.0, 1.0, 0.04) == pytest.approx(-8.0 + URGENT_JERK * 0.04)


def test_a_wish_that_is_reached_is_held() -> None:
    control = Control()
    reached = [control.acceleration(20.0, 99.0, 1.4, 0.04) for _ in range(30)]
    assert reached[0] == pytest.approx(COMFORTABLE_JERK * 0.04)
    assert reached[-1] == 1.4


def test_a_wish_ends_what_the_target_speed_has_added_up() -> None:
    """Else an ego would drive on in another way beside an ego without a wish than alone."""
    control = Control()
    control.acceleration(20.0, 20.04, NO_WISH, 0.04)
    assert control.integral > 0.0
    control.acceleration(20.0, 20.04, 0.5, 0.04)
    assert control.integral == 0.0


def test_braking_ends_at_standstill() -> None:
    place, speed = move_forward(0.1, -8.0, 0.04)
    assert speed == 0.0
    assert place >= 0.0


@pytest.mark.parametrize("dt", [0.04, 0.1])
@pytest.mark.parametrize("width", [3.0, 3.5, 3.75, -3.75])
def test_a_lane_change_takes_about_three_seconds_and_does_not_swing_out(width: float, dt: float) -> None:
    y, vy, integral = 0.0, 0.0, 0.0
    path = []
    for _ in range(round(8.0 / dt)):
        acceleration, integral = lane_control(y, vy, width, dt, integral)
        y, vy = move(y, vy, acceleration, dt)
        path.append(y)
        assert abs(vy) <= LATERAL_SPEED_LIMIT + 1e-9
    settled = next(i for i, place in enumerate(path) if abs(place - width) <= CENTRE_TOLERANCE) * dt
    assert 1.5 < settled < 3.5
    assert max(np.abs(path)) < abs(width) + 0.1
    assert path[-1] == pytest.approx(width, abs=0.05)
