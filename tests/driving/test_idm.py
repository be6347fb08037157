"""The Intelligent Driver Model: it never runs into its leader, and drives as fast as it may."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drlsl.driving.scene import BRAKING_LIMIT
from drlsl.driving.simulation import idm
from drlsl.driving.simulation.controllers import move_forward

SPEED = st.floats(0.0, 40.0)


def acceleration(gap: float, speed: float, leader: float) -> float:
    return float(idm.idm_acceleration(np.array([gap]), np.array([speed]), np.array([leader]))[0])


@given(SPEED, st.floats(0.0, 8.0), st.sampled_from([0.04, 0.1]), st.floats(0.0, 20.0), st.floats(0.0, 1.0))
def test_who_follows_safely_never_runs_into_a_leader_that_brakes(
    speed: float, braking: float, dt: float, more: float, release: float
) -> None:
    # Both as fast; the gap is what the model keeps; the leader brakes, to a stop or for a while.
    gap = idm.MINIMUM_GAP + speed * idm.TIME_GAP + more
    own = leader = speed
    for index in range(round(15 / dt)):
        asked = acceleration(gap, own, leader)
        pressed = braking if index * dt < release * 15 else -1.0
        ahead, leader = move_forward(leader, -pressed, dt)
        way, own = move_forward(own, asked, dt)
        gap += ahead - way
        assert gap > 0.0


@given(st.floats(-5.0, 300.0), SPEED, SPEED)
def test_it_stays_within_what_a_car_can_do(gap: float, speed: float, leader: float) -> None:
    assert -BRAKING_LIMIT <= acceleration(gap, speed, leader) <= idm.ACCELERATION


@given(st.floats(1.0, 200.0), st.floats(0.1, 50.0), SPEED, SPEED, st.floats(0.1, 5.0))
def test_more_room_and_a_faster_leader_never_ask_for_more_braking(
    gap: float, more: float, speed: float, leader: float, faster: float
) -> None:
    assert acceleration(gap + more, speed, leader) >= acceleration(gap, speed, leader)
    assert acceleration(gap, speed, leader + faster) >= acceleration(gap, speed, leader)


def test_a_free_road_is_driven_at_the_desired_speed() -> None:
    assert idm.free_acceleration(np.array([0.0]))[0] == idm.ACCELERATION
    assert idm.free_acceleration(np.array([idm.DESIRED_SPEED, 50.0])).tolist() == [0.0, 0.0]
    assert acceleration(1e6, 20.0, 20.0) == pytest.approx(idm.ACCELERATION * (1 - (20 / 33.333333) ** 4))


def test_the_equilibrium_gap_is_the_models() -> None:
    speed = 20.0
    gap = (idm.MINIMUM_GAP + speed * idm.TIME_GAP) / np.sqrt(1 - (speed / idm.DESIRED_SPEED) ** 4)
    assert acceleration(float(gap), speed, speed) == pytest.approx(0.0, abs=1e-12)
