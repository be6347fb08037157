"""The safe distances of highway.pl beside those of ad-rss-lib, the C++ implementation of RSS by Intel."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from drlsl.driving.scene import SCHEMA
from drlsl.logic import Engine
from drlsl.lowering.backends import Rows, compile_numpy, compile_scalar
from drlsl.lowering.frontend import Lowered, Query, lower
from drlsl.lowering.ir import Relation, Schema
from drlsl.shield import consult_rules

pytest.importorskip(
    "ad_physics", reason="needs ad-physics and ad-rss, which have wheels for Linux on x86-64 only"
)
ad_rss = pytest.importorskip("ad_rss", reason="needs ad-rss, which has wheels for Linux on x86-64 only")

Floats = npt.NDArray[np.float64]

FASTEST = 98.0
"""ad-rss-lib takes speeds of up to 100 m/s, that after the response time included."""

SPEEDS = Relation("speeds", ("float", "float"), single=True)


PREDICATES = ("critical_distance", "opposite_distance")


def lowered(engine: Engine, predicate: str) -> Lowered:
    engine.consult_text(f":- dynamic(speeds/2). asked(C) :- speeds(One, Other), {predicate}(One, Other, C).")
    return lower(engine, Schema([*SCHEMA.relations.values(), SPEEDS]), [Query("asked", 1, "first")])


def random_speeds(count: int) -> tuple[Floats, Floats]:
    """Speeds behind and in front, or of two that meet; some stand, some are as fast as each other."""
    rng = np.random.default_rng(5)
    rear, front = rng.uniform(0.0, FASTEST, (2, count))
    rear[::20], front[7::20] = 0.0, 0.0
    front[13::20] = rear[13::20]
    return rear, front


def filled(values: Any) -> None:
    """Give every number in an object some value: those that are not set are refused."""
    for name in dir(values):
        value = getattr(values, name)
        if name.startswith("_") or name == "assign":
            continue
        if type(value) is int:
            setattr(values, name, 1)
        elif hasattr(value, "cMaxValue"):
            setattr(values, name, type(value)(1.0))
        else:
            filled(value)


def object_of_ad_rss() -> Any:
    """A vehicle with the dynamics that highway.pl assumes of every one."""
    physics, vehicle = ad_rss.physics, ad_rss.rss.core.RelativeObjectState()
    vehicle.object_type = ad_rss.rss.world.ObjectType.OtherVehicle
    filled(vehicle.unstructured_object_state)
    filled(vehicle.structured_object_state.velocity)
    filled(vehicle.dynamics.unstructured_settings)
    vehicle.structured_object_state.distance_to_enter_intersection = physics.Distance(1.0)
    vehicle.structured_object_state.distance_to_leave_intersection = physics.Distance(1.0)
    dynamics = vehicle.dynamics
    dynamics.alpha_lon.accel_max = physics.Acceleration(3.0)
    dynamics.alpha_lon.brake_max = physics.Acceleration(-8.0)
    dynamics.alpha_lon.brake_min = physics.Acceleration(-6.0)
    dynamics.alpha_lon.brake_min_correct = physics.Acceleration(-6.0)
    dynamics.alpha_lat.accel_max = physics.Acceleration(0.1)
    dynamics.alpha_lat.brake_min = physics.Acceleration(-0.1)
    dynamics.lateral_fluctuation_margin = physics.Distance(0.0)
    dynamics.min_longitudinal_safety_distance = physics.Distance(0.0)
    dynamics.response_time = physics.Duration(0.35)
    dynamics.max_speed_on_acceleration = physics.Speed(100.0)
    return vehicle


def oracle(predicate: str) -> Callable[[float, float], float]:
    """The safe distance of ad-rss-lib for a speed behind and one in front, or for two that meet.

    It leaves what is less than a millimetre below 0 as it is, and makes 0 of what is further below. Both of
    two that meet have a positive speed.
    """
    behind, in_front, distance = object_of_ad_rss(), object_of_ad_rss(), ad_rss.physics.Distance(0.0)
    behind_velocity = behind.structured_object_state.velocity
    front_velocity = in_front.structured_object_state.velocity
    speed = ad_rss.physics.Speed
    formulas = ad_rss.rss.structured
    calculate = {
        "critical_distance": formulas.calculateSafeLongitudinalDistanceSameDirection,
        "opposite_distance": formulas.calculateSafeLongitudinalDistanceOppositeDirection,
    }[predicate]

    def safe_distance(rear: float, front: float) -> float:
        behind_velocity.speed_lon_min = behind_velocity.speed_lon_max = speed(rear)
        front_velocity.speed_lon_min = front_velocity.speed_lon_max = speed(front)
        assert calculate(in_front, behind, distance)
        return max(0.0, float(distance.mDistance))

    return safe_distance


def by_ad_rss(predicate: str, rear: Floats, front: Floats) -> Floats:
    return np.array(list(map(oracle(predicate), rear.tolist(), front.tolist())))


@pytest.fixture
def engine() -> Engine:
    engine = Engine()
    consult_rules(engine, "highway.pl")
    return engine


@pytest.mark.parametrize("predicate", PREDICATES)
def test_arrays_have_the_safe_distance_of_ad_rss(engine: Engine, predicate: str) -> None:
    rear, front = random_speeds(100_000)
    result = compile_numpy(lowered(engine, predicate))({("speeds", 2): Rows([rear, front])})
    assert not result.undecided.any()
    distances = result.answers[0].value
    assert np.abs(distances - by_ad_rss(predicate, rear, front)).max() <= 1e-9
    if predicate == "critical_distance":
        assert 0.1 < np.mean(distances == 0.0) < 0.6  # both kinds of answers are there


@pytest.mark.parametrize("predicate", PREDICATES)
def test_interpreter_and_scalar_code_have_the_safe_distance_of_ad_rss(engine: Engine, predicate: str) -> None:
    answer = compile_scalar(lowered(engine, predicate))
    rear, front = random_speeds(2_000)
    distances = by_ad_rss(predicate, rear, front).tolist()
    for one, other, expected in zip(rear.tolist(), front.tolist(), distances, strict=True):
        solution = engine.once(f"{predicate}({one!r}, {other!r}, C)")
        assert solution is not None
        assert solution["C"] == pytest.approx(expected, abs=1e-9)
        assert answer({("speeds", 2): [(one, other)]})[0] == solution["C"]


def test_a_wrong_sign_would_be_noticed() -> None:
    same, opposite = map(oracle, PREDICATES)
    assert same(30.0, 28.0) == pytest.approx(42.025625)
    assert same(30.0, 28.0) < same(30.0, 27.0)
    assert same(0.0, 70.0) == 0.0
    assert opposite(30.0, 40.0) == opposite(40.0, 30.0) == pytest.approx(245.634583)
