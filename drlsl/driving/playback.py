"""A recording laid out for driving in it: per-frame arrays that many egos read at once."""

from __future__ import annotations

from collections.abc import Sequence
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
    def of(cls, recording: Recording, direction: Direction, road: Road) -> Playback:
        """Lay `recording` out for an ego that drives in `direction`; `road` is `road_of(recording)`."""
        frames = recording.frames
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


def road_of(recording: Recording, radar_range: float) -> Road:
    """The road of `recording` for an ego that sees `radar_range` [m] far."""
    return Road(
        recording.lanes, recording.dt, radar_range, ACCELERATION_LIMIT, BRAKING_LIMIT, CENTRE_TOLERANCE
    )


@dataclass(frozen=True, slots=True)
class Traffic:
    """The recorded vehicles of the frames that N egos are in: `numbers` (6, N, K), the rest (N, K)."""

    numbers: Floats
    vehicle: Integers
    lane: Integers
    valid: Mask


class Playbacks:
    """Several playbacks, read by N egos that may each be in another; `chosen` (N,) says in which.

    `dt` [s], `sign`, `frames`, `length` [m] and `road` (an index of `roads`) are arrays of shape (number of
    playbacks,).
    """

    def __init__(self, playbacks: Sequence[Playback]) -> None:
        self.all = tuple(playbacks)
        self.roads = tuple(dict.fromkeys(playback.road for playback in self.all))
        self.road = np.array([self.roads.index(playback.road) for playback in self.all])
        self.dt = np.array([playback.road.time_step for playback in self.all])
        self.sign = np.array([playback.sign for playback in self.all])
        self.frames = np.array([playback.frames for playback in self.all])
        self.length = np.array([playback.length for playback in self.all])
        self._begin = np.array([playback.at(0.0) for playback in self.all])
        lanes = max(len(playback.lanes) for playback in self.all)
        self._lane_id = np.zeros((len(self.all), lanes), dtype=np.int64)
        self._centre = np.full((len(self.all), lanes), np.inf)
        for index, playback in enumerate(self.all):
            self._lane_id[index, : len(playback.lanes)] = [lane.id for lane in playback.lanes]
            self._centre[index, : len(playback.lanes)] = [lane.centre for lane in playback.lanes]
        self._low = np.array([min(lane.centre - lane.width / 2 for lane in one.lanes) for one in self.all])
        self._high = np.array([max(lane.centre + lane.width / 2 for lane in one.lanes) for one in self.all])

    def lane_at(self, chosen: Integers, y: Floats) -> Integers:
        """The lane of the playback's direction whose centre is nearest to `y` [m], shape (N,)."""
        nearest = np.argmin(np.abs(self._centre[chosen] - y[:, None]), axis=1)
        return np.asarray(self._lane_id[chosen, nearest])

    def along(self, chosen: Integers, x: Floats) -> Floats:
        """How far `x` is from the beginning of the stretch in the direction of travel [m], shape (N,)."""
        return np.asarray(self.sign[chosen] * (x - self._begin[chosen]))

    def off_road(self, chosen: Integers, y: Floats, width: float) -> Mask:
        """Whether any part of a body `width` [m] wide at `y` is beyond the lanes of the direction."""
        return np.asarray((y - width / 2 < self._low[chosen]) | (y + width / 2 > self._high[chosen]))

    def traffic(self, chosen: Integers, frame: Integers) -> Traffic:
        """The vehicles of frame `frame` (N,) of each chosen playback; a frame beyond the last is the last."""
        frame = np.minimum(frame, self.frames[chosen] - 1)
        if (chosen == chosen[0]).all():
            only = self.all[int(chosen[0])]
            return Traffic(only.numbers[:, frame], only.vehicle[frame], only.lane[frame], only.valid[frame])
        slots = max(playback.valid.shape[1] for playback in self.all)
        numbers = np.zeros((len(NUMBERS), len(chosen), slots))
        vehicle, lane = np.zeros((2, len(chosen), slots), dtype=np.int64)
        valid = np.zeros((len(chosen), slots), dtype=np.bool_)
        for index, playback in enumerate(self.all):
            here = np.flatnonzero(chosen == index)
            width = playback.valid.shape[1]
            numbers[:, here, :width] = playback.numbers[:, frame[here]]
            vehicle[here, :width] = playback.vehicle[frame[here]]
            lane[here, :width] = playback.lane[frame[here]]
            valid[here, :width] = playback.valid[frame[here]]
        return Traffic(numbers, vehicle, lane, valid)
