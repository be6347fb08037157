"""The controllers and the motion of the ego."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drlsl.driving.scene import ACCELERATION_LIMIT, BRAKING_LIMIT, CENTRE_TOLERANCE
from drlsl.driving.simulation.controllers import (
    LATERAL_SPEED_LIMIT,
    LaneController,
    SpeedController,
    move,
    move_forward,
)

speeds = st.floats(0.0, 45.0, allow_nan=False)
steps = st.sampled_from([0.04, 0.1])


@given(speed=speeds, target=speeds, dt=steps)
def test_the_ego_does_what_the_rules_ask_within_its_limits(speed: float, target: float, dt: float) -> None:
    control = SpeedController.for_egos(1)
    acceleration = control.acceleration(np.array([speed]), np.array([target]), np.array([dt]))[0]
    assert -BRAKING_LIMIT <= acceleration <= ACCELERATION_LIMIT
    wanted = (target - speed) / dt
    assert acceleration == pytest.approx(np.clip(wanted, -BRAKING_LIMIT, ACCELERATION_LIMIT))


@given(speed=speeds, targets=st.lists(speeds, min_size=1, max_size=200), dt=steps)
def test_the_integral_never_outweighs_the_rules(speed: float, targets: list[float], dt: float) -> None:
    control = SpeedController.for_egos(1)
    now = np.array([speed])
    for target in targets:
        acceleration = control.acceleration(now, np.array([target]), np.array([dt]))
        wanted = np.clip((target - now) / dt, -BRAKING_LIMIT, ACCELERATION_LIMIT)
        assert abs(acceleration - wanted)[0] < 0.5
        _, now = move_forward(now, acceleration, np.array([dt]))


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
    control = SpeedController(np.array([1.0, 2.0]))
    control.reset(0)
    assert control.integral.tolist() == [0.0, 2.0]
