"""The format of recordings: lanes, and every vehicle's box and velocity in every frame, in SI units."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from enum import Enum
from itertools import pairwise
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from drlsl.errors import UserError
from drlsl.traffic.array_kinds import NUMBERS, Boxes, Ids, LaneIds, Mask
from drlsl.traffic.road import Direction, Lane, MergingLane, Traffic

NO_VEHICLE = -1
"""`Frames.vehicle` and `Frames.first` of an empty slot."""

OFF_LANE = 0
"""`Frames.lane` of a vehicle whose centre is in none of the recording's lanes: ramp, shoulder, median."""

ROUNDED = 0.02
"""Slack [m] between a merging lane and its neighbour: both are written with two decimals."""

EMPTY_SLOT: Mapping[str, float] = MappingProxyType(
    {
        "vehicle": NO_VEHICLE,
        "lane": OFF_LANE,
        **dict.fromkeys(NUMBERS, math.nan),
        "first": NO_VEHICLE,
        "valid": False,
    }
)
"""Value of each array of Frames in an empty slot."""


class VehicleClass(Enum):
    """The class of a road user."""

    CAR = "car"
    TRUCK = "truck"
    MOTORCYCLE = "motorcycle"


@dataclass(frozen=True, slots=True)
class Dropped:
    """Rows of the source that are not in the recording, and the reason."""

    reason: str
    rows: int


@dataclass(frozen=True, slots=True, eq=False)
class Frames(Boxes):
    """Vehicles per frame, padded to one rectangle; read-only arrays of shape (F, K), or (n,) for one frame.

    A vehicle keeps its slot (column) for as long as it is seen without a gap, so `x[t, k] - x[t - 1, k]` is a
    step of one vehicle wherever `first[t, k] < t`. Empty slots hold EMPTY_SLOT, NaN in the floats, so that a
    forgotten mask is noticed.
    """

    vehicle: Ids
    """Vehicle id, >= 0; NO_VEHICLE in an empty slot."""
    lane: LaneIds
    """Id of the lane whose strip holds the vehicle's centre; OFF_LANE where none does."""
    first: Ids
    """Index of the frame in which this unbroken stretch of the vehicle's track began."""
    valid: Mask
    """True if the slot holds a vehicle."""

    def __post_init__(self) -> None:
        for name, array in self.arrays():
            view = array.view()
            view.setflags(write=False)
            object.__setattr__(self, name, view)

    def arrays(self) -> Iterator[tuple[str, npt.NDArray[np.generic]]]:
        """Yield every array with its field name."""
        for item in fields(self):
            yield item.name, getattr(self, item.name)


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """Traffic on one straight stretch of road at a fixed frame rate.

    Coordinates: x along the road to the right, y across it and downward; boxes are axis-aligned and given by
    their centre. Frame i is at i / frame_rate seconds. `[x_min, x_max]` [m] is the recorded stretch, `lanes`
    are sorted by id. `vehicle_class` maps every vehicle id to its class; `dropped` lists the rows of the
    source that are missing, and `notes` all estimates and corrections, in sentences for people. `traffic` is
    what the vehicles should do about an ego, if its driver has no other wish.
    """

    name: str
    frame_rate: float
    lanes: tuple[Lane, ...]
    x_min: float
    x_max: float
    frames: Frames
    vehicle_class: Mapping[int, VehicleClass]
    dropped: tuple[Dropped, ...] = ()
    notes: tuple[str, ...] = field(default=())
    merging_lanes: tuple[MergingLane, ...] = ()
    traffic: Traffic = Traffic.RECORDED

    @property
    def frame_count(self) -> int:
        """Number of frames, F."""
        return int(self.frames.vehicle.shape[0])

    @property
    def capacity(self) -> int:
        """Number of slots, K: the most vehicles in one frame."""
        return int(self.frames.vehicle.shape[1])

    @property
    def dt(self) -> float:
        """Time between frames [s]."""
        return 1.0 / self.frame_rate

    @property
    def duration(self) -> float:
        """Time covered [s], counting each frame as one dt."""
        return self.frame_count / self.frame_rate

    @property
    def directions(self) -> tuple[Direction, ...]:
        """The directions that have a lane, in the order of Direction."""
        present = {lane.direction for lane in self.lanes}
        return tuple(direction for direction in Direction if direction in present)

    def lanes_of(self, direction: Direction) -> tuple[Lane, ...]:
        """Return the lanes of one direction, sorted by id; empty if the road has none."""
        return tuple(lane for lane in self.lanes if lane.direction is direction)

    def lane(self, lane_id: int) -> Lane:
        """Return the lane with this id.

        Raises:
            UserError: the recording has no such lane.
        """
        if not 1 <= lane_id <= len(self.lanes):
            raise UserError(f"{self.name}: no lane {lane_id}; the lanes are 1 to {len(self.lanes)}")
        return self.lanes[lane_id - 1]

    def frame(self, index: int) -> Frames:
        """Return the vehicles present in one frame, arrays of shape (n,).

        Raises:
            IndexError: index is not in 0 … frame_count - 1.
        """
        if not 0 <= index < self.frame_count:
            raise IndexError(f"frame {index} of {self.name}, which has frames 0 to {self.frame_count - 1}")
        present = self.frames.valid[index]
        return Frames(*(array[index][present] for _, array in self.frames.arrays()))

    def validate(self) -> None:
        """Check every invariant documented above.

        Raises:
            UserError: an invariant is violated; the message names the recording and the first one.
        """
        for problem in _problems(self):
            raise UserError(f"{self.name}: {problem}")


def _problems(recording: Recording) -> Iterator[str]:
    """Yield the problems of a recording, cheapest checks first; later checks rely on earlier ones."""
    if not (np.isfinite(recording.frame_rate) and recording.frame_rate > 0):
        yield f"frame rate {recording.frame_rate} is not a positive number"
    if not (np.isfinite([recording.x_min, recording.x_max]).all() and recording.x_min < recording.x_max):
        yield f"the stretch of road [{recording.x_min}, {recording.x_max}] m is empty or not finite"
    yield from _lane_problems(recording.lanes)
    yield from _merging_lane_problems(recording)
    frames = recording.frames
    shape = frames.vehicle.shape
    for name, array in frames.arrays():
        if array.ndim != 2 or array.shape != shape:
            yield f"{name} has shape {array.shape}, expected the shape {shape} of `vehicle`, two axes"
    if not frames.valid.any():
        yield "no vehicle in any frame"
    yield from _slot_problems(recording)


def _lane_problems(lanes: tuple[Lane, ...]) -> Iterator[str]:
    if not lanes:
        yield "no lane"
    for index, lane in enumerate(lanes, start=1):
        if lane.id != index:
            yield f"lane ids must count 1, 2, 3 … from the top; found {lane.id} in place {index}"
        if not np.isfinite([lane.centre, lane.width, lane.speed_limit]).all():
            yield f"lane {lane.id} has a number that is not finite"
        if lane.width <= 0 or lane.speed_limit <= 0:
            yield f"lane {lane.id} needs a width and a speed limit above 0"
    for upper, lower in pairwise(lanes):
        if lower.centre - lower.width / 2 < upper.centre + upper.width / 2 - 1e-6:
            yield f"lanes {upper.id} and {lower.id} overlap or are out of order"


def _merging_lane_problems(recording: Recording) -> Iterator[str]:
    for lane in recording.merging_lanes:
        if not np.isfinite([lane.centre, lane.width, lane.begin, lane.end]).all() or lane.width <= 0:
            yield "a merging lane needs finite numbers and a width above 0"
        if (lane.end - lane.begin) * lane.direction.sign <= 0:
            yield "a merging lane must end after its beginning, along its direction"
        road = recording.lanes_of(lane.direction)
        right = road[-1 if lane.direction.sign > 0 else 0] if road else None
        if right is None or abs(abs(lane.centre - right.centre) - (lane.width + right.width) / 2) > ROUNDED:
            yield "a merging lane must lie beside the right lane of its direction"


def _slot_problems(recording: Recording) -> Iterator[str]:
    frames, valid = recording.frames, recording.frames.valid
    if ((frames.vehicle >= 0) != valid).any() or (frames.vehicle[~valid] != NO_VEHICLE).any():
        yield "`vehicle` must be an id >= 0 exactly where `valid` is true"
    for name in NUMBERS:
        values = getattr(frames, name)
        if not np.isfinite(values[valid]).all():
            yield f"`{name}` is not finite for some vehicle"
        if not np.isnan(values[~valid]).all():
            yield f"`{name}` must be NaN in empty slots"
    if (frames.length[valid] <= 0).any() or (frames.width[valid] <= 0).any():
        yield "a vehicle's length and width must be above 0"
    if (frames.lane[valid] < OFF_LANE).any() or (frames.lane[valid] > len(recording.lanes)).any():
        yield f"`lane` must be {OFF_LANE} or one of the lanes 1 to {len(recording.lanes)}"
    if (frames.x[valid] < recording.x_min).any() or (frames.x[valid] > recording.x_max).any():
        yield f"a vehicle's centre lies outside [{recording.x_min}, {recording.x_max}] m"
    unknown = set(np.unique(frames.vehicle[valid]).tolist()) ^ set(recording.vehicle_class)
    if unknown:
        yield f"`vehicle_class` and the vehicles in the frames differ in ids {sorted(unknown)[:5]}"
    ordered = np.sort(frames.vehicle, axis=1)
    if ((ordered[:, 1:] == ordered[:, :-1]) & (ordered[:, 1:] != NO_VEHICLE)).any():
        yield "a vehicle appears twice in one frame"
    if not np.array_equal(frames.first, _expected_first(frames.vehicle)):
        yield "`first` does not match the frames in which the vehicles appear"


def _expected_first(vehicle: Ids) -> Ids:
    """Return the start of each unbroken stretch, derived from the slots alone. Shape (F, K)."""
    count, capacity = vehicle.shape
    same = np.zeros((count, capacity), dtype=np.bool_)
    same[1:] = vehicle[1:] == vehicle[:-1]
    index = np.broadcast_to(np.arange(count, dtype=np.int32)[:, None], (count, capacity))
    started = np.maximum.accumulate(np.where(same, 0, index), axis=0)
    return np.where(vehicle == NO_VEHICLE, NO_VEHICLE, started).astype(np.int32)
