"""Turn rows, one per vehicle and frame, into the film of a recording."""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from drlsl.errors import UserError
from drlsl.traffic.array_kinds import NUMBERS, Boxes, Floats, Ids, LaneIds
from drlsl.traffic.packed_frames import CELL, LARGEST, NOBODY, OFF_LANE, PIECE, UNIT, Film, Words
from drlsl.traffic.recording import Dropped
from drlsl.traffic.road import Lane

ROUNDING = 1e-6
"""Slack [m] at the borders of a lane, so that none falls between two lanes that touch."""

MOST_CELLS = 100_000_000
"""Largest rectangle of frames x vehicles, 2 GB: a guard against wrong frame numbers."""


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


def rounded(tracks: Tracks) -> Tracks:
    """Return the rows with numbers as a film keeps them: lanes are told from these."""
    return replace(tracks, **{name: np.rint(getattr(tracks, name) / UNIT) * UNIT for name in NUMBERS})


def pack(tracks: Tracks, lane: LaneIds, *, name: str, frame_count: int = 0) -> Film:
    """Return the film of rows that are sorted, free of duplicates and numbered from frame 0.

    There are `frame_count` frames, or as many as the rows need. Numbers are rounded to `UNIT`.

    Raises:
        UserError: a number is not finite or too large, or the frame numbers would need an absurd amount of
            memory.
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
    numbers = {column: _whole(getattr(tracks, column), f"{name}: `{column}`") for column in NUMBERS}
    rows, columns = tracks.frame, np.repeat(slots, lengths) + 1
    first = np.repeat(first_frame, lengths)
    piece, pieces = _pieces(tracks, [tracks.vehicle, lane, first, numbers["length"], numbers["width"]])
    cells = np.zeros((count, CELL, capacity + 1), dtype=np.int32)
    for place, column in enumerate(NUMBERS[:4]):
        cells[rows, place, columns] = numbers[column]
    cells[rows, PIECE, columns] = piece
    return Film(cells, pieces)


def _whole(values: Floats, what: str) -> Words:
    """Return numbers in `UNIT`.

    Raises:
        UserError: one is not finite, or too large.
    """
    if not np.isfinite(values).all():
        raise UserError(f"{what} is not finite for some vehicle")
    if np.abs(values).max() > LARGEST:
        raise UserError(f"{what} is up to {np.abs(values).max():g}; expected at most {LARGEST:.0f} m or m/s")
    return np.rint(values / UNIT).astype(np.int32)


def _pieces(tracks: Tracks, values: Sequence[npt.NDArray[Any]]) -> tuple[Words, Words]:
    """Return the piece of each row, and the pieces in the order in which they begin, after that of nobody.

    `values`: the columns of the pieces. A piece ends where one of them changes.
    """
    table = np.stack([column.astype(np.int32) for column in values], axis=1)
    new = np.ones(len(table), dtype=np.bool_)
    new[1:] = (table[1:] != table[:-1]).any(axis=1)
    starts = np.flatnonzero(new)
    order = np.argsort(tracks.frame[starts], kind="stable")
    rank = np.empty(len(starts), dtype=np.int32)
    rank[order] = np.arange(1, len(starts) + 1)
    nobody = np.array([NOBODY], dtype=np.int32)
    return rank[np.cumsum(new) - 1], np.concatenate([nobody, table[starts[order]]])


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
