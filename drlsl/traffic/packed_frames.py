"""The frames of a recording as stored and driven in: whole numbers, and every vehicle's constants once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Final, Self, TypeAlias

import numpy as np
import numpy.typing as npt

from drlsl.traffic.array_kinds import NUMBERS, Boxes, Floats, Ids, Integers, LaneIds, Mask

UNIT: Final = 1e-4
"""Metres, and metres a second, of a whole number: places, sizes and velocities are rounded to 0.1 mm (/s)."""

LARGEST: Final = (2**31 - 1) * UNIT
"""Largest number that a film holds [m], [m/s]: 214 km."""

NO_VEHICLE: Final = -1
"""The vehicle, and the first frame, of an empty slot."""

OFF_LANE: Final = 0
"""The lane of a vehicle whose centre is in none of the recording's lanes: ramp, shoulder, median."""

PIECE: Final = 4
"""The column of a film's `cells` behind those of the motion: the row of `pieces`."""

CELL: Final = PIECE + 1
"""How many numbers a cell, a slot in a frame, has."""

VEHICLE, LANE, FIRST, LENGTH, WIDTH = range(5)
"""The columns of `Film.pieces`."""

NOBODY: Final = (NO_VEHICLE, OFF_LANE, NO_VEHICLE, 0, 0)
"""Row 0 of `Film.pieces`, which empty slots have."""


@dataclass(frozen=True, slots=True, eq=False)
class Frames(Boxes):
    """Vehicles per frame, padded to one rectangle; read-only arrays of shape (F, K), or (n,) for one frame.

    A vehicle keeps its slot (column) for as long as it is seen without a gap, so `x[t, k] - x[t - 1, k]` is a
    step of one vehicle wherever `first[t, k] < t`. Empty slots hold no vehicle, no lane and NaN, so that a
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


Words: TypeAlias = npt.NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Film:
    """The frames of a recording, 20 bytes a frame and slot; slot 0 is empty: the ego's place in scenes.

    `cells` (F, 5, S): x, y [`UNIT` m], vx and vy [`UNIT` m/s] of the vehicle in a slot, and its row of
    `pieces`; 0 in an empty slot. All of a frame lies together, so that to read it is to go to one place in
    memory. A piece is a part of an unbroken track in one lane and of one size; `pieces` (P, 5) has its
    vehicle, lane, first frame of the track, and length and width [`UNIT` m].

    The arrays are read-only, and may be a file in memory that all processes share.
    """

    cells: Words
    pieces: Words

    def __post_init__(self) -> None:
        for name in ("cells", "pieces"):
            view = np.asarray(getattr(self, name)).view()
            view.setflags(write=False)
            object.__setattr__(self, name, view)

    def __len__(self) -> int:
        return int(self.cells.shape[0])

    def __deepcopy__(self, memo: object) -> Self:
        """Return the film itself: it is never written to."""
        return self

    @property
    def slots(self) -> int:
        """Number of slots, S: one more than the most vehicles in one frame."""
        return int(self.cells.shape[2])

    @property
    def motion(self) -> Words:
        """The first four columns of `cells`; shape (F, 4, S)."""
        return self.cells[:, :PIECE]

    @property
    def piece(self) -> Words:
        """The row of `pieces` of the vehicle in a slot, 0 in an empty one; shape (F, S)."""
        return self.cells[:, PIECE]

    @cached_property
    def frames(self) -> Frames:
        """All frames as numbers in SI units, without slot 0: 59 bytes for each frame and slot."""
        x, y, vx, vy, length, width = self.numbers(slice(None))[:, :, 1:]
        valid = self.valid(slice(None))[:, 1:]
        for column in (x, y, vx, vy, length, width):
            column[~valid] = np.nan
        vehicle, lane, first = (
            self.pieces[:, column][self.piece[:, 1:]] for column in (VEHICLE, LANE, FIRST)
        )
        return Frames(x, y, vx, vy, length, width, vehicle, lane.astype(np.int16), first, valid)

    def frame(self, index: int) -> Frames:
        """Return the vehicles in one frame, arrays of shape (n,)."""
        piece = self.piece[index]
        there = piece > 0
        vehicle, lane, first, length, width = self.pieces[piece[there]].T
        x, y, vx, vy = self.motion[index][:, there] * UNIT
        lanes, valid = lane.astype(np.int16), np.ones(len(vehicle), dtype=np.bool_)
        return Frames(x, y, vx, vy, length * UNIT, width * UNIT, vehicle, lanes, first, valid)

    def numbers(self, frames: Integers | slice) -> Floats:
        """Return the columns of `NUMBERS` in some frames, 0 in empty slots; shape (6, F, S)."""
        piece = self.piece[frames]
        result = np.empty((len(NUMBERS), *piece.shape))
        np.multiply(self.motion[frames].swapaxes(0, 1), UNIT, out=result[:4])
        result[4:] = (self.pieces[:, LENGTH:] * UNIT).T[:, piece]
        return result

    def vehicle(self, frames: Integers | slice) -> Integers:
        """Return the ids of the vehicles in some frames, NO_VEHICLE in empty slots; shape (F, S)."""
        return self.pieces[:, VEHICLE].astype(np.int64)[self.piece[frames]]

    def lane(self, frames: Integers | slice) -> Integers:
        """Return the lanes of the vehicles in some frames, OFF_LANE in empty slots; shape (F, S)."""
        return self.pieces[:, LANE].astype(np.int64)[self.piece[frames]]

    def valid(self, frames: Integers | slice) -> Mask:
        """Return which slots hold a vehicle in some frames; shape (F, S)."""
        return self.piece[frames] > 0

    def first_of(self, frame: int, slot: int) -> int:
        """Return the frame in which the track of the vehicle in a slot began; NO_VEHICLE without one."""
        return int(self.pieces[self.piece[frame, slot], FIRST])

    def vehicle_in(self, frame: int, slot: int) -> int:
        """Return the id of the vehicle in a slot; NO_VEHICLE without one."""
        return int(self.pieces[self.piece[frame, slot], VEHICLE])

    def with_lane(self, inside: Mask, lane: int) -> Film:
        """Return a copy in which the vehicles in the slots `inside`, shape (F, S), are in another lane."""
        other = self.pieces.copy()
        other[:, LANE] = lane
        cells = self.cells.copy()
        cells[:, PIECE] += inside * np.int32(len(self.pieces))
        return Film(cells, np.concatenate([self.pieces, other]))
