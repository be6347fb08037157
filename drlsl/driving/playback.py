"""A recording laid out for driving in it: per-frame arrays that many egos read at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from drlsl.driving.fault import Track
from drlsl.driving.limits import ACCELERATION_LIMIT, BRAKING_LIMIT, CENTRE_TOLERANCE
from drlsl.driving.scene import Road
from drlsl.traffic.recording import Recording
from drlsl.traffic.road import Direction, Lane

Floats: TypeAlias = npt.NDArray[np.float64]
Integers: TypeAlias = npt.NDArray[np.int64]
Mask: TypeAlias = npt.NDArray[np.bool_]

NUMBERS = ("x", "y", "vx", "vy", "length", "width")
"""The columns of `Playback.numbers`, in order."""


@dataclass(frozen=True, slots=True, eq=False)
class Playback:
    """One direction of a recording's road.

    `numbers` (6, F, K): the columns of `NUMBERS`, 0 in empty slots; `vehicle`, `lane`, `first` (F, K) as in
    the recording; `valid` (F, K). `lanes`: those of the direction, `sign` its sign along x.
    """

    road: Road
    direction: Direction
    lanes: tuple[Lane, ...]
    x_min: float
    x_max: float
    numbers: Floats
    vehicle: Integers
    lane: Integers
    first: Integers
    valid: Mask

    @classmethod
    def of(cls, recording: Recording, direction: Direction, *, radar_range: float) -> Playback:
        """Lay `recording` out for an ego that drives in `direction` and sees `radar_range` [m] far."""
        frames = recording.frames
        road = Road(
            recording.lanes, recording.dt, radar_range, ACCELERATION_LIMIT, BRAKING_LIMIT, CENTRE_TOLERANCE
        )
        columns = (np.where(frames.valid, getattr(frames, name), 0.0) for name in NUMBERS)
        return cls(
            road=road,
            direction=direction,
            lanes=recording.lanes_of(direction),
            x_min=recording.x_min,
            x_max=recording.x_max,
            numbers=np.stack(list(columns)),
            vehicle=frames.vehicle.astype(np.int64),
            lane=frames.lane.astype(np.int64),
            first=frames.first.astype(np.int64),
            valid=frames.valid,
        )

    @property
    def sign(self) -> int:
        """The sign of motion along x."""
        return self.direction.sign

    @property
    def frames(self) -> int:
        """Number of frames, F."""
        return int(self.valid.shape[0])

    @property
    def length(self) -> float:
        """Length of the recorded stretch of road [m]."""
        return self.x_max - self.x_min

    def along(self, x: float) -> float:
        """How far `x` is from the beginning of the stretch, in the direction of travel [m]."""
        return x - self.x_min if self.sign > 0 else self.x_max - x

    def at(self, along: float) -> float:
        """The x that is `along` [m] from the beginning of the stretch."""
        return self.x_min + along if self.sign > 0 else self.x_max - along

    def track(self, frame: int, slot: int, since: int) -> Track:
        """The track of the vehicle in `slot` up to `frame`, from `since` or where its track began."""
        begin = max(int(self.first[frame, slot]), since)
        x, y, vx, _, length, width = self.numbers[:, begin : frame + 1, slot]
        return Track(self.sign * x, y, self.sign * vx, float(length[-1]), float(width[-1]))
