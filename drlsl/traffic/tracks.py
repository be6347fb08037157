"""Turn rows, one per vehicle and frame, into the padded arrays of a recording."""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from drlsl.errors import UserError
from drlsl.traffic.array_kinds import NUMBERS, Boxes, Floats, Ids, LaneIds
from drlsl.traffic.recording import EMPTY_SLOT, NO_VEHICLE, OFF_LANE, Dropped, Frames
from drlsl.traffic.road import Lane

ROUNDING = 1e-6
"""Slack [m] at the borders of a lane, so that none falls between two lanes that touch."""

MOST_CELLS = 100_000_000
"""Largest rectangle of frames x vehicles, about 6 GB: a guard against wrong frame numbers."""


@dataclass(frozen=True, slots=True, eq=False)
class Tracks(Boxes):
    """One row per vehicle and frame; every array has shape (rows,), SI units as in Frames."""

    frame: npt.NDArray[np.int64]
    vehicle: npt.NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.frame)

    def take(self, rows: npt.NDArray[np.generic]) -> Tracks:
        """Return the rows selected by an index or mask, in that order."""
        return Tracks(*(getattr(self, item.name)[rows] for item in fields(self)))


def without_duplicates(tracks: Tracks) -> tuple[Tracks, npt.NDArray[np.int64], tuple[Dropped, ...]]:
    """Return rows sorted by vehicle and frame, one row for each pair of them.

    Of several rows for one vehicle and frame the first in the source is kept. Returns the rows, their indices
    in the input, and the dropped rows: repeated ones, and those that contradict the one kept.
    """
    order = np.lexsort((tracks.frame, tracks.vehicle))
    ordered = tracks.take(order)
    repeat = np.zeros(len(ordered), dtype=np.bool_)
    repeat[1:] = (np.diff(ordered.vehicle) == 0) & (np.diff(ordered.frame) == 0)
    kept = np.maximum.accumulate(np.where(repeat, 0, np.arange(len(ordered))))
    same = np.ones(len(ordered), dtype=np.bool_)
    for name in NUMBERS:
        values = getattr(ordered, name)
        same &= values == values[kept]
    dropped = (
        Dropped("row repeated: same vehicle, frame and values", int((repeat & same).sum())),
        Dropped("row contradicts an earlier one of the same vehicle and frame", int((repeat & ~same).sum())),
    )
    return ordered.take(~repeat), order[~repeat], tuple(item for item in dropped if item.rows)


def segment_starts(tracks: Tracks) -> npt.NDArray[np.int64]:
    """Return the rows at which an unbroken stretch of a track begins; rows sorted by vehicle, frame."""
    new = np.ones(len(tracks), dtype=np.bool_)
    new[1:] = (np.diff(tracks.vehicle) != 0) | (np.diff(tracks.frame) != 1)
    return np.flatnonzero(new)


def lanes_of_rows(y: Floats, lanes: Sequence[Lane]) -> LaneIds:
    """Return the id of the lane whose strip holds y, else OFF_LANE; a border belongs to the lane below it."""
    ids = np.full(y.shape, OFF_LANE, dtype=np.int16)
    for lane in lanes:
        ids[np.abs(y - lane.centre) <= lane.width / 2 + ROUNDING] = lane.id
    return ids


def pack(tracks: Tracks, lane: LaneIds, *, name: str, frame_count: int = 0) -> Frames:
    """Return the padded arrays of rows that are sorted, free of duplicates and numbered from frame 0.

    There are `frame_count` frames, or as many as the rows need.

    Raises:
        UserError: the frame numbers would need an absurd amount of memory.
    """
    starts = segment_starts(tracks)
    lengths = np.diff(np.append(starts, len(tracks)))
    first_frame = tracks.frame[starts]
    slots, capacity = _slots(first_frame, first_frame + lengths)
    count = max(int(tracks.frame.max()) + 1, frame_count)
    if count * capacity > MOST_CELLS:
        raise UserError(
            f"{name}: {len(tracks):,} rows span {count:,} frames with up to {capacity} vehicles in one, "
            f"more than the {MOST_CELLS:,} cells supported; check the frame numbers or split the recording"
        )
    rows, columns = tracks.frame, np.repeat(slots, lengths)

    def spread(name: str, values: npt.NDArray[Any], dtype: npt.DTypeLike) -> npt.NDArray[Any]:
        array = np.full((count, capacity), EMPTY_SLOT[name], dtype=dtype)
        array[rows, columns] = values
        return array

    vehicle = spread("vehicle", tracks.vehicle, np.int32)
    return Frames(
        vehicle=vehicle,
        lane=spread("lane", lane, np.int16),
        first=spread("first", np.repeat(first_frame, lengths), np.int32),
        valid=vehicle != NO_VEHICLE,
        **{column: spread(column, getattr(tracks, column), np.float64) for column in NUMBERS},
    )


def _slots(begin: npt.NDArray[np.int64], end: npt.NDArray[np.int64]) -> tuple[Ids, int]:
    """Return a slot for each segment [begin, end): none shared at one time, as few as possible."""
    slots = np.empty(len(begin), dtype=np.int32)
    free: list[int] = []
    busy: list[tuple[int, int]] = []
    capacity = 0
    for segment in np.argsort(begin, kind="stable"):
        while busy and busy[0][0] <= begin[segment]:
            heapq.heappush(free, heapq.heappop(busy)[1])
        if free:
            slot = heapq.heappop(free)
        else:
            slot, capacity = capacity, capacity + 1
        slots[segment] = slot
        heapq.heappush(busy, (int(end[segment]), slot))
    return slots, capacity
