"""Check that rows are traffic on a road, in the units that they should have, whatever file they come from.

A table can be well formed and wrong: in feet or km/h, thinned, mixed of two recordings, with a cell that a
spreadsheet changed. What cannot be traffic is refused here, and what is merely odd becomes a note.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from drlsl.errors import UserError
from drlsl.traffic.array_kinds import Mask
from drlsl.traffic.packed_frames import OFF_LANE
from drlsl.traffic.recording import Dropped
from drlsl.traffic.road import Lane
from drlsl.traffic.tracks import Tracks, segment_starts
from drlsl.traffic.words import counted

LONGEST_ROAD: Final = 50_000.0
"""Longest road [m] that one recording may cover; no camera and no row of cameras sees more."""

LONGEST_VEHICLE: Final = 60.0
"""Longest vehicle [m]: a road train has 53.5 m."""

WIDEST_VEHICLE: Final = 6.0
"""Widest vehicle [m], an escorted load."""

USUAL_LENGTH: Final = (2.0, 13.0)
"""Range [m] of the median length of all vehicles: 15 in feet, and 1.4 where metres are read as feet."""

FASTEST: Final = 100.0
"""Highest speed [m/s], 360 km/h."""

WIDEST_LANE: Final = 8.0
"""Widest lane [m]; 12 feet read as metres would be 12."""

HIGHEST_LIMIT: Final = 50.0
"""Highest speed limit [m/s], 180 km/h: above all in force, and below those that are km/h read as m/s."""

LEAST_STEPS: Final = 50
"""Steps of vehicles below which positions and velocities are not compared."""

LEAST_FRAMES: Final = 10
"""Frames below which those that are there tell nothing about the rest."""

MOVING: Final = 2.0
"""Speed [m/s] above which a step is compared."""

AGREED, TOLERATED = 0.03, 0.2
"""Share by which positions and velocities may differ without a note, and without refusal."""

MOST_CONTRADICTIONS: Final = 0.01
"""Share of rows that may contradict another of the same vehicle and frame."""

FAR: Final = 1000.0
"""A row this far [m] from all of the middle 99 % of rows is noted."""


@dataclass(frozen=True, slots=True)
class Place:
    """The source of rows, for messages: the file, and the number of the first frame there."""

    path: Path
    first_frame: int = 0
    line: Callable[[int], int] | None = None
    """Return the line of a row, counted from 0 in the order of the file; None if the file has no lines."""

    def of(self, tracks: Tracks, row: int) -> str:
        """Return the file, the line if it is known, and the vehicle and frame of a row."""
        line = "" if self.line is None else f":{self.line(row)}"
        frame = int(tracks.frame[row]) + self.first_frame
        return f"{self.path}{line}: vehicle {int(tracks.vehicle[row])} in frame {frame}"


def check_rows(place: Place, tracks: Tracks) -> None:
    """Check sizes, speeds and positions; `tracks` in the order of the file, before anything is dropped.

    Raises:
        UserError: a row cannot be a vehicle on a road, or all of them are in another unit.
    """
    for values, unit, most, what in (
        (tracks.length, "m", LONGEST_VEHICLE, "long"),
        (tracks.width, "m", WIDEST_VEHICLE, "wide"),
    ):
        row = int(np.argmax(values))
        if values[row] > most:
            raise UserError(f"{place.of(tracks, row)} is {values[row]:.1f} {unit} {what}, more than {most:g}")
    speed = np.hypot(tracks.vx, tracks.vy)
    row = int(np.argmax(speed))
    if speed[row] > FASTEST:
        raise UserError(f"{place.of(tracks, row)} drives {speed[row]:.1f} m/s, more than {FASTEST:g}")
    for values, axis in ((tracks.x, "along"), (tracks.y, "across")):
        away = np.abs(values - np.median(values))
        row = int(np.argmax(away))
        if away[row] > LONGEST_ROAD:
            raise UserError(
                f"{place.of(tracks, row)} is {away[row] / 1000:,.0f} km away from the others, {axis} the road"
            )
    length, width = (float(np.median(values)) for values in (tracks.length, tracks.width))
    if not USUAL_LENGTH[0] <= length <= USUAL_LENGTH[1] and len(tracks) >= LEAST_STEPS:
        raise UserError(
            f"{place.path}: half of the vehicles are {'longer' if length > 5 else 'shorter'} than "
            f"{length:.1f} m; are the lengths in another unit?"
        )
    if width > length and len(tracks) >= LEAST_STEPS:
        raise UserError(
            f"{place.path}: vehicles are wider ({width:.1f} m) than long ({length:.1f} m); are these swapped?"
        )


def check_lanes(path: Path, tracks: Tracks, lane: npt.NDArray[np.int16], lanes: tuple[Lane, ...]) -> None:
    """Check that lanes have the widths of lanes, limits of roads, and the direction of their traffic.

    Raises:
        UserError: they have not.
    """
    for one in lanes:
        if one.width > WIDEST_LANE:
            raise UserError(f"{path}: lane {one.id} is {one.width:.1f} m wide, more than {WIDEST_LANE:g} m")
        if one.speed_limit > HIGHEST_LIMIT:
            raise UserError(
                f"{path}: lane {one.id} has a speed limit of {one.speed_limit:g} m/s; is it in km/h?"
            )
    sign = np.array([0] + [one.direction.sign for one in lanes])[lane]
    moving = (lane != OFF_LANE) & (np.abs(tracks.vx) > MOVING)
    backward = int((moving & (tracks.vx * sign < 0)).sum())
    if moving.sum() >= LEAST_STEPS and backward > moving.sum() / 2:
        raise UserError(
            f"{path}: {counted(backward, 'row')} of {moving.sum():,} move against their lane; are directions "
            "or velocities turned around?"
        )


def check_contradictions(path: Path, rows: int, dropped: tuple[Dropped, ...]) -> None:
    """Check that few rows contradict one of the same vehicle and frame.

    Raises:
        UserError: many do, as where two recordings are in one table.
    """
    count = sum(item.rows for item in dropped if "contradicts" in item.reason)
    if rows >= LEAST_STEPS and count > MOST_CONTRADICTIONS * rows:
        raise UserError(
            f"{path}: {count:,} of {rows:,} rows contradict another one of the same vehicle and frame; "
            "are two recordings mixed, with ids or times that are rounded?"
        )


def step_ratio(tracks: Tracks, rate: float) -> float | None:
    """Return how much faster the positions move along x than the velocities say, 1 if they agree.

    `tracks` are sorted by vehicle and frame, `rate` [1/s] is that of the frames. None if too few vehicles
    move or their steps agree on no ratio.
    """
    same = np.ones(len(tracks), dtype=np.bool_)
    same[segment_starts(tracks)] = False
    moved = np.diff(tracks.x) * rate
    told = (tracks.vx[1:] + tracks.vx[:-1]) / 2
    use = same[1:] & (np.abs(told) > MOVING)
    if use.sum() < LEAST_STEPS:
        return None
    low, middle, high = np.percentile(moved[use] / told[use], [25, 50, 75]).tolist()
    return middle if high - low <= 0.3 * max(abs(middle), 1.0) else None


def true_frames(place: Place, tracks: Tracks, rate: float) -> tuple[Tracks, float, tuple[str, ...]]:
    """Return rows with consecutive frames, their rate [1/s] and notes, where only every n-th frame is there.

    `rate` may be that of the frames' numbers or that of the frames that are there: the velocities decide.
    """
    numbers = np.unique(tracks.frame)
    every = int(np.gcd.reduce(numbers)) if len(numbers) >= LEAST_FRAMES else 1
    if every <= 1:
        return tracks, rate, ()
    thinned = replace(tracks, frame=tracks.frame // every)
    ordered = thinned.take(np.lexsort((thinned.frame, thinned.vehicle)))
    ratio = step_ratio(ordered, rate)
    if ratio is None or abs(ratio - 1) > TOLERATED:
        rate /= every
    note = f"only every {_ordinal(every)} frame is there: {rate:g} frames a second"
    return thinned, rate, (note,)


def odd_notes(place: Place, tracks: Tracks, rate: float) -> tuple[str, ...]:
    """Return notes on what is odd in rows that are sorted by vehicle and frame, without repeats.

    Raises:
        UserError: positions and velocities contradict each other everywhere.
    """
    return tuple(_odd(place, tracks, rate))


def _odd(place: Place, tracks: Tracks, rate: float) -> Iterator[str]:
    ratio = step_ratio(tracks, rate)
    if ratio is not None and abs(ratio - 1) > AGREED:
        text = f"positions move {ratio:.2f} times as fast as the velocities say"
        if abs(ratio - 1) > TOLERATED:
            raise UserError(
                f"{place.path}: {text}; is the frame rate wrong, or are units or signs of one of them others?"
            )
        yield text
    starts = segment_starts(tracks)
    gaps = len(starts) - len(np.unique(tracks.vehicle))
    if gaps:
        yield f"{counted(gaps, 'gap')} in tracks; a vehicle that reappears counts as a new appearance"
    numbers = np.unique(tracks.frame)
    empty = int(numbers[-1] - numbers[0]) + 1 - len(numbers)
    if empty:
        first = int(numbers[:-1][np.diff(numbers) > 1][0]) + 1 + place.first_frame
        yield f"{counted(empty, 'frame')} without a vehicle, the first of them {first}"
    yield from _jumps(place, tracks, rate, starts)
    for values, axis in ((tracks.x, "along"), (tracks.y, "across")):
        low, high = np.percentile(values, [0.5, 99.5]).tolist()
        away = np.maximum(low - values, values - high)
        if (away > FAR).any():
            row = int(np.argmax(away))
            yield (
                f"{counted(int((away > FAR).sum()), 'row')} more than {FAR / 1000:g} km away from the others "
                f"{axis} the road, as {_short(place, tracks, row)}, {away[row]:,.0f} m"
            )


def _jumps(place: Place, tracks: Tracks, rate: float, starts: npt.NDArray[np.int64]) -> Iterator[str]:
    """Yield a note if vehicles move from frame to frame as none can."""
    same = np.ones(len(tracks), dtype=np.bool_)
    same[starts] = False
    step = np.hypot(np.diff(tracks.x), np.diff(tracks.y))
    jumps: Mask = same[1:] & (step > FASTEST / rate + 1.0)
    if jumps.any():
        row = int(np.argmax(np.where(jumps, step, 0.0)))
        yield (
            f"{counted(int(jumps.sum()), 'jump')} of a vehicle from one frame to the next, the longest "
            f"{step[row]:,.1f} m by {_short(place, tracks, row)}"
        )


def _short(place: Place, tracks: Tracks, row: int) -> str:
    return f"vehicle {int(tracks.vehicle[row])} in frame {int(tracks.frame[row]) + place.first_frame}"


def _ordinal(number: int) -> str:
    ending = {1: "st", 2: "nd", 3: "rd"}.get(number % 10 if number % 100 not in (11, 12, 13) else 0, "th")
    return f"{number}{ending}"
