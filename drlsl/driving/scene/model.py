"""One moment of traffic around the ego; no NumPy."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, NamedTuple

from drlsl.driving.scene.ego_limits import ACCELERATION_LIMIT, BRAKING_LIMIT, CENTRE_TOLERANCE
from drlsl.traffic import Direction, Lane

EGO: Final = "ego"
"""The atom that names the ego in the rules."""


class Vehicle(NamedTuple):
    """A vehicle's box and velocity, in the order of the arguments of `vehicle/8`.

    `lane` is the id of the lane that holds the centre, 0 for none; `x`, `y` [m] the centre, `vx`, `vy`
    [m/s] the velocity in road coordinates, `length` along the road and `width` across it [m].
    """

    id: str
    lane: int
    x: float
    y: float
    vx: float
    vy: float
    length: float
    width: float


@dataclass(frozen=True, slots=True)
class Road:
    """The constants of a drive: the lanes, the time step and the ego's limits.

    `time_step` [s], `radar_range` [m], `acceleration_limit`, `braking_limit` [m/s²]; `centre_tolerance`
    [m]: largest offset from its lane's centre at which the ego starts a lane change.
    """

    lanes: tuple[Lane, ...]
    time_step: float
    radar_range: float
    acceleration_limit: float = ACCELERATION_LIMIT
    braking_limit: float = BRAKING_LIMIT
    centre_tolerance: float = CENTRE_TOLERANCE

    def lanes_of(self, direction: Direction) -> tuple[Lane, ...]:
        """Return the lanes of one direction, in the order of the road."""
        return tuple(lane for lane in self.lanes if lane.direction is direction)

    def lane(self, lane_id: int) -> Lane | None:
        """Return the lane of that id, if the road has it."""
        return next((lane for lane in self.lanes if lane.id == lane_id), None)

    def lane_at(self, y: float, lanes: Iterable[Lane] | None = None) -> int:
        """Return the id of the lane whose strip holds `y` [m], among `lanes` or all; 0 for none."""
        for lane in self.lanes if lanes is None else lanes:
            if abs(y - lane.centre) <= lane.width / 2:
                return lane.id
        return 0


@dataclass(frozen=True, slots=True)
class Scene:
    """The ego, the vehicles around it and the road; `target_lane` is the lane that the ego steers for."""

    road: Road
    ego: Vehicle
    vehicles: tuple[Vehicle, ...]
    target_lane: int

    def in_range(self) -> tuple[Vehicle, ...]:
        """Return the vehicles in radar range; one whose place is NaN is kept: the rules shall fail on it.

        The distance is computed as the rules compute it, and as every language does.
        """
        reach = self.road.radar_range
        return tuple(car for car in self.vehicles if not _distance(car, self.ego) > reach)

    @property
    def forward(self) -> int:
        """The sign of x that is forward for the ego: by its lane, or by its motion if it is in no lane."""
        lane = self.road.lane(self.ego.lane)
        if lane is not None:
            return lane.direction.sign
        return 1 if self.ego.vx >= 0 else -1


def _distance(one: Vehicle, other: Vehicle) -> float:
    """Return the distance between two centres [m]."""
    dx, dy = one.x - other.x, one.y - other.y
    return math.sqrt(dx * dx + dy * dy)


def bumper_gap(one: Vehicle, other: Vehicle) -> float:
    """Return the distance from bumper to bumper along the road [m]; below 0 if two vehicles are alongside."""
    return abs(one.x - other.x) - (one.length + other.length) / 2
