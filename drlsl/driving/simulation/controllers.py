"""The two controllers and the motion of the ego, for N egos at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Self

import numpy as np

from drlsl.driving.scene import ACCELERATION_LIMIT, BRAKING_LIMIT
from drlsl.driving.simulation.measures import HARD_BRAKING
from drlsl.traffic import Floats

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


@dataclass
class _Controller:
    """The memory of both controllers: the integral of the error, shape (N,)."""

    integral: Floats

    @classmethod
    def for_egos(cls, count: int) -> Self:
        """Return a controller for `count` egos, at rest."""
        return cls(np.zeros(count))

    def reset(self, ego: int) -> None:
        """Reset the integral of one ego."""
        self.integral[ego] = 0.0


@dataclass
class SpeedController(_Controller):
    """The speed along the road: a comfortable driver's below the target speed, or else PI control.

    `last` (N,): the acceleration of the last step [m/s²].
    """

    last: Floats

    @classmethod
    def for_egos(cls, count: int) -> Self:
        """Return a controller for `count` egos, at rest."""
        return cls(np.zeros(count), np.zeros(count))

    def reset(self, ego: int) -> None:
        """Reset the memory of one ego: it drives at a constant speed."""
        super().reset(ego)
        self.last[ego] = 0.0

    def acceleration(self, speed: Floats, target: Floats, comfortable: Floats, dt: Floats) -> Floats:
        """Return accelerations [m/s²] towards `comfortable` ones [m/s²] with bounded jerk.

        They are never above what leads to the target speed [m/s] within a time step [s], whatever jerk that
        takes. Where `comfortable` is infinite, the ego drives the target speed. All of shape (N,).
        """
        wanted = np.isfinite(comfortable)
        if not wanted.any():
            result = self._to_target(speed, target, dt)
        else:
            result = np.minimum(self._bounded(comfortable, dt), (target - speed) / dt)
            result = np.minimum(np.maximum(result, -BRAKING_LIMIT), ACCELERATION_LIMIT)
            if not wanted.all():
                result = np.where(wanted, result, self._to_target(speed, target, dt))
                self.integral[wanted] = 0.0
        # Braking ends at standstill.
        self.last = np.maximum(result, -speed / dt)
        return result

    def _bounded(self, comfortable: Floats, dt: Floats) -> Floats:
        """Return the accelerations nearest to `comfortable` ones that the bounds of jerk allow."""
        down = np.where(comfortable < -HARD_BRAKING, URGENT_JERK, COMFORTABLE_JERK) * dt
        up = np.where(self.last < -HARD_BRAKING, URGENT_JERK, COMFORTABLE_JERK) * dt
        return np.minimum(np.maximum(comfortable, self.last - down), self.last + up)

    def _to_target(self, speed: Floats, target: Floats, dt: Floats) -> Floats:
        """Return accelerations [m/s²] to target speeds [m/s], with the error's integral.

        The proportional gain is one over the time step, so that the ego accelerates exactly as the rules
        demand: any less would brake less than the rules derived to be safe.
        """
        error = target - speed
        wanted = error / dt + SPEED_INTEGRAL_GAIN * self.integral
        limited = np.minimum(np.maximum(wanted, -BRAKING_LIMIT), ACCELERATION_LIMIT)
        self.integral += np.where(wanted == limited, error * dt, -self.integral)
        return limited


class LaneController(_Controller):
    """PI control of the place across the road; state of shape (N,).

    The offset from the target lane's centre demands a sideways speed, limited; the sideways acceleration,
    limited too, aims at that speed within one step.
    """

    def acceleration(self, y: Floats, vy: Floats, target_y: Floats, dt: Floats) -> Floats:
        """Return sideways accelerations [m/s²] for places [m], speeds [m/s] and time steps [s], all (N,)."""
        error = target_y - y
        near = np.abs(error) < LANE_INTEGRAL_BAND
        self.integral = np.where(near, self.integral + error * dt, 0.0)
        wanted = LANE_GAIN * error + LANE_INTEGRAL_GAIN * self.integral
        speed = np.minimum(np.maximum(wanted, -LATERAL_SPEED_LIMIT), LATERAL_SPEED_LIMIT)
        needed = (speed - vy) / dt
        return np.minimum(np.maximum(needed, -LATERAL_ACCELERATION_LIMIT), LATERAL_ACCELERATION_LIMIT)


def move(place: Floats, speed: Floats, acceleration: Floats, dt: Floats) -> tuple[Floats, Floats]:
    """Return place and speed one step later under constant acceleration; all of shape (N,)."""
    later = speed + acceleration * dt
    return place + (speed + later) / 2 * dt, later


def move_forward(speed: Floats, acceleration: Floats, dt: Floats) -> tuple[Floats, Floats]:
    """Return the distance of one step and the speed after it; braking ends at standstill and never reverses.

    All of shape (N,), `speed` >= 0.
    """
    later = np.maximum(speed + acceleration * dt, 0.0)
    return (speed + later) / 2 * dt, later
