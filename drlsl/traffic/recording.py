"""The format of recordings: lanes, and every vehicle's box and velocity in every frame, in SI units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum
from itertools import pairwise

import numpy as np

from drlsl.errors import UserError
from drlsl.traffic.array_kinds import Ids
from drlsl.traffic.packed_frames import (
    CELL,
    FIRST,
    LANE,
    LENGTH,
    NO_VEHICLE,
    NOBODY,
    OFF_LANE,
    UNIT,
    VEHICLE,
    Film,
    Frames,
)
from drlsl.traffic.road import Direction, Lane, MergingLane, Traffic

ROUNDED = 0.02
"""Slack [m] between a merging lane and its neighbour: both are written with two decimals."""

HIGHEST_RATE = 1000.0
"""Most frames a second; no camera over a road takes so many, and each is a step of an episode."""


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
class Recording:
    """Traffic on one straight stretch of road at a fixed frame rate.

    Coordinates: x along the road to the right, y across it and downward; boxes are axis-aligned and given by
    their centre. Frame i is at i / frame_rate seconds. `film` holds the frames, as they are stored and driven
    in; `frames` has them as numbers in SI units, made when it is first asked for. `[x_min, x_max]` [m] is the
    recorded stretch, `lanes` are sorted by id. `vehicle_class` maps every vehicle id to its class; `dropped`
    lists the rows of the source that are missing, and `notes` all estimates and corrections, in sentences for
    people. `traffic` is what the vehicles should do about an ego, if its driver has no other wish.
    """

    name: str
    frame_rate: float
    lanes: tuple[Lane, ...]
    x_min: float
    x_max: float
    film: Film
    vehicle_class: Mapping[int, VehicleClass]
    dropped: tuple[Dropped, ...] = ()
    notes: tuple[str, ...] = field(default=())
    merging_lanes: tuple[MergingLane, ...] = ()
    traffic: Traffic = Traffic.RECORDED

    @property
    def frames(self) -> Frames:
        """Every vehicle's box and velocity in every frame, arrays of shape (F, K)."""
        return self.film.frames

    @property
    def frame_count(self) -> int:
        """Number of frames, F."""
        return len(self.film)

    @property
    def capacity(self) -> int:
        """Number of slots, K: the most vehicles in one frame."""
        return self.film.slots - 1

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
        return self.film.frame(index)

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
    elif recording.frame_rate > HIGHEST_RATE:
        yield f"{recording.frame_rate:g} frames a second, more than {HIGHEST_RATE:g}; in another unit?"
    if not (np.isfinite([recording.x_min, recording.x_max]).all() and recording.x_min < recording.x_max):
        yield f"the stretch of road [{recording.x_min}, {recording.x_max}] m is empty or not finite"
    yield from _lane_problems(recording.lanes)
    yield from _merging_lane_problems(recording)
    yield from _shape_problems(recording.film)
    if not recording.film.piece.any():
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


def _shape_problems(film: Film) -> Iterator[str]:
    if film.cells.ndim != 3 or film.cells.shape[1] != CELL:
        yield f"`cells` has shape {film.cells.shape}, expected (F, {CELL}, S)"
    for name in ("cells", "pieces"):
        if getattr(film, name).dtype != np.int32:
            yield f"`{name}` is of {getattr(film, name).dtype}, expected int32"
    if film.pieces.shape[1:] != (len(NOBODY),) or film.pieces[0].tolist() != list(NOBODY):
        yield f"`pieces` must be rows of {len(NOBODY)} numbers, the first {NOBODY}"
    if film.piece.min() < 0 or film.piece.max() >= len(film.pieces):
        yield f"`piece` must be a row of the {len(film.pieces)} `pieces`"


def _slot_problems(recording: Recording) -> Iterator[str]:
    film = recording.film
    there = film.piece > 0
    if there[:, 0].any() or film.motion.swapaxes(1, 2)[~there].any():
        yield "slot 0 must be empty, and the numbers in empty slots 0"
    used = film.pieces[np.unique(film.piece[there])]
    if (used[:, VEHICLE] < 0).any():
        yield "a vehicle's id must be at least 0"
    if (used[:, LENGTH:] <= 0).any():
        yield "a vehicle's length and width must be above 0"
    if (used[:, LANE] < OFF_LANE).any() or (used[:, LANE] > len(recording.lanes)).any():
        yield f"`lane` must be {OFF_LANE} or one of the lanes 1 to {len(recording.lanes)}"
    x = film.motion[:, 0][there] * UNIT
    if x.min() < recording.x_min - UNIT or x.max() > recording.x_max + UNIT:
        yield f"a vehicle's centre lies outside [{recording.x_min}, {recording.x_max}] m"
    unknown = set(np.unique(used[:, VEHICLE]).tolist()) ^ set(recording.vehicle_class)
    if unknown:
        yield f"`vehicle_class` and the vehicles in the frames differ in ids {sorted(unknown)[:5]}"
    vehicle = film.pieces[:, VEHICLE][film.piece]
    ordered = np.sort(vehicle, axis=1)
    if ((ordered[:, 1:] == ordered[:, :-1]) & (ordered[:, 1:] != NO_VEHICLE)).any():
        yield "a vehicle appears twice in one frame"
    if not np.array_equal(film.pieces[:, FIRST][film.piece], _expected_first(vehicle)):
        yield "`first` does not match the frames in which the vehicles appear"


def _expected_first(vehicle: Ids) -> Ids:
    """Return the start of each unbroken stretch, derived from the slots alone. Shape (F, S)."""
    count, slots = vehicle.shape
    same = np.zeros((count, slots), dtype=np.bool_)
    same[1:] = vehicle[1:] == vehicle[:-1]
    index = np.broadcast_to(np.arange(count, dtype=np.int32)[:, None], (count, slots))
    started = np.maximum.accumulate(np.where(same, 0, index), axis=0)
    return np.where(vehicle == NO_VEHICLE, NO_VEHICLE, started).astype(np.int32)
