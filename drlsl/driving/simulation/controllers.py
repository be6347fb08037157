"""The two controllers and the motion of one ego: plain functions, also readable for a compiler."""

from __future__ import annotations

import math
from typing import Final

from drlsl.driving.scene import ACCELERATION_LIMIT, BRAKING_LIMIT
from drlsl.driving.simulation.measures import HARD_BRAKING

LATERAL_ACCELERATION_LIMIT: Final = 3.0
"""Largest sideways acceleration of the ego [m/s²]."""

LATERAL_SPEED_LIMIT: Final = 1.8
"""Largest sideways speed of the ego [m/s]; a lane change of 3.5 m takes about 3 s."""

COMFORTABLE_JERK: Final = 2.0
"""Largest jerk while the ego brakes comfortably or not at all [m/s³]."""

URGENT_JERK: Final = 12.0
"""Largest jerk on the way to and from hard braking [m/s³]; only the target speed may take more.

Source: the reference driver of UN R157 reaches its braking with 1.2 g/s (Westhofen et al. 2023, Criticality
Metrics for Automated Driving, longitudinal jerk).
"""

SPEED_INTEGRAL_GAIN: Final = 0.1
"""Integral gain of the speed controller [1/s²]."""

LANE_GAIN: Final = 1.2
"""Proportional gain of the lane controller [1/s]: offset from the centre to sideways speed."""

LANE_INTEGRAL_GAIN: Final = 0.05
"""Integral gain of the lane controller [1/s²]."""

LANE_INTEGRAL_BAND: Final = 0.5
"""Offset [m] beyond which the lane controller does not integrate: a lane change must not wind it up."""


def speed_control(
    speed: float, target: float, comfortable: float, dt: float, integral: float, last: float
) -> tuple[float, float, float]:
    """Return the acceleration [m/s²] towards a `comfortable` one [m/s²] with bounded jerk.

    Behind it stand the integral [m] and the acceleration of this step [m/s²], `integral` and `last` of the
    next one. The acceleration is never above what leads to the target speed [m/s] within a time step `dt`
    [s], whatever jerk that takes. Where `comfortable` is infinite, the ego drives the target speed.
    """
    if math.isfinite(comfortable):
        integral = 0.0
        result = min(_bounded(comfortable, last, dt), (target - speed) / dt)
        result = min(max(result, -BRAKING_LIMIT), ACCELERATION_LIMIT)
    else:
        # The proportional gain is one over the time step, so that the ego accelerates exactly as the rules
        # demand: any less would brake less than the rules derived to be safe.
        error = target - speed
        wanted = error / dt + SPEED_INTEGRAL_GAIN * integral
        result = min(max(wanted, -BRAKING_LIMIT), ACCELERATION_LIMIT)
        integral = integral + error * dt if wanted == result else 0.0
    # Braking ends at standstill.
    return result, integral, max(result, -speed / dt)


def _bounded(comfortable: float, last: float, dt: float) -> float:
    """Return the acceleration nearest to a comfortable one that the bounds of jerk allow."""
    down = (URGENT_JERK if comfortable < -HARD_BRAKING else COMFORTABLE_JERK) * dt
    up = (URGENT_JERK if last < -HARD_BRAKING else COMFORTABLE_JERK) * dt
    return min(max(comfortable, last - down), last + up)


def lane_control(y: float, vy: float, target_y: float, dt: float, integral: float) -> tuple[float, float]:
    """Return the sideways acceleration [m/s²] towards a lane's centre, and the integral [m s].

    The offset [m] from the centre demands a sideways speed, limited; the sideways acceleration, limited too,
    aims at that speed [m/s] within one time step `dt` [s].
    """
    error = target_y - y
    integral = integral + error * dt if abs(error) < LANE_INTEGRAL_BAND else 0.0
    wanted = LANE_GAIN * error + LANE_INTEGRAL_GAIN * integral
    speed = min(max(wanted, -LATERAL_SPEED_LIMIT), LATERAL_SPEED_LIMIT)
    needed = (speed - vy) / dt
    return min(max(needed, -LATERAL_ACCELERATION_LIMIT), LATERAL_ACCELERATION_LIMIT), integral


def move(place: float, speed: float, acceleration: float, dt: float) -> tuple[float, float]:
    """Return place and speed one step later under constant acceleration."""
    later = speed + acceleration * dt
    return place + (speed + later) / 2 * dt, later


def move_forward(speed: float, acceleration: float, dt: float) -> tuple[float, float]:
    """Return the distance of one step and the speed after it; braking ends at standstill and never reverses.

    `speed` >= 0.
    """
    later = max(speed + acceleration * dt, 0.0)
    return (speed + later) / 2 * dt, later
