"""Change recordings: cut them, thin their frames, fill short gaps in tracks, take speeds from positions.

Nothing of this happens unasked, and every change is counted in the notes of the new recording.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
import numpy.typing as npt

from drlsl.errors import UserError
from drlsl.traffic.array_kinds import NUMBERS, Floats
from drlsl.traffic.recording import Recording
from drlsl.traffic.slopes import slopes
from drlsl.traffic.tracks import Tracks, lanes_of_rows, pack, rounded, segment_starts
from drlsl.traffic.words import counted

ANOTHER: Final = 5.0
"""Speed [m/s] by which the mean through a gap may be outside those at its ends."""


def rows_of(recording: Recording) -> Tracks:
    """Return the rows of a recording, sorted by vehicle and frame."""
    frames = recording.frames
    frame, slot = np.nonzero(frames.valid)
    vehicle = frames.vehicle[frame, slot].astype(np.int64)
    order = np.lexsort((frame, vehicle))
    numbers = {name: getattr(frames, name)[frame, slot][order] for name in NUMBERS}
    return Tracks(frame=frame[order].astype(np.int64), vehicle=vehicle[order], **numbers)


def with_rows(recording: Recording, tracks: Tracks, note: str, frame_rate: float | None = None) -> Recording:
    """Return a recording with other rows, sorted by vehicle and frame, and a note on the change.

    Raises:
        UserError: no row is left.
    """
    if not len(tracks):
        raise UserError(f"{recording.name}: nothing is left: {note}")
    tracks = rounded(replace(tracks, frame=tracks.frame - tracks.frame.min()))
    changed = replace(
        recording,
        frame_rate=frame_rate or recording.frame_rate,
        x_min=min(float((tracks.x - tracks.length / 2).min()), float(tracks.x.min())),
        x_max=max(float((tracks.x + tracks.length / 2).max()), float(tracks.x.max())),
        film=pack(tracks, lanes_of_rows(tracks.y, recording.lanes), name=recording.name),
        vehicle_class={one: recording.vehicle_class[one] for one in np.unique(tracks.vehicle).tolist()},
        notes=(*recording.notes, note),
    )
    changed.validate()
    return changed


def cut(
    recording: Recording,
    *,
    seconds: tuple[float, float] = (-np.inf, np.inf),
    metres: tuple[float, float] = (-np.inf, np.inf),
) -> Recording:
    """Return the rows in a span of time [s] and of road [m]; a box must lie in it wholly.

    Raises:
        UserError: no row is left, or an end is not a number.
    """
    for ends, unit in ((seconds, "s"), (metres, "m")):
        if not ends[0] < ends[1]:
            raise UserError(
                f"{recording.name}: cut to {_span(ends, unit)}: expected two numbers, the lower one first"
            )
    tracks = rows_of(recording)
    time, half = tracks.frame / recording.frame_rate, tracks.length / 2
    inside = (time >= seconds[0]) & (time < seconds[1])
    inside &= (tracks.x - half >= metres[0]) & (tracks.x + half <= metres[1])
    out = counted(int((~inside).sum()), "row")
    note = f"cut to {_span(seconds, 's')} and {_span(metres, 'm')}: {out} left out"
    if not inside.any():
        whole = f"0 to {recording.duration:g} s and {recording.x_min:.1f} to {recording.x_max:.1f} m"
        raise UserError(f"{recording.name}: nothing is left: {note}; it has {whole}")
    return with_rows(recording, tracks.take(inside), note)


def thin(recording: Recording, every: int) -> Recording:
    """Return every n-th frame.

    Raises:
        UserError: `every` is below 1 or above the number of frames.
    """
    if every < 1:
        raise UserError(f"every {every}th frame: expected a number from 1")
    if every > recording.frame_count:
        frames = counted(recording.frame_count, "frame")
        raise UserError(f"{recording.name}: every {every}th frame is asked for, but it has {frames}")
    tracks = rows_of(recording)
    kept = tracks.take(tracks.frame % every == 0)
    rate = recording.frame_rate / every
    note = f"thinned to {rate:g} frames a second: {counted(len(tracks) - len(kept), 'row')} left out"
    return with_rows(recording, replace(kept, frame=kept.frame // every), note, rate)


def smooth(recording: Recording, seconds: float) -> Recording:
    """Return the recording with velocities from positions: slopes of straight lines through so many seconds.

    Raises:
        UserError: `seconds` are not above 0, or cover less than three frames.
    """
    if not seconds > 0:
        raise UserError(f"smoothing over {seconds:g} s: expected seconds above 0")
    # More than all frames on both sides of a row change nothing.
    reach = round(min(seconds * recording.frame_rate / 2, recording.frame_count))
    window = 2 * reach + 1
    if window < 3:
        raise UserError(
            f"{recording.name}: smoothing over {seconds:g} s: three frames are needed, here "
            f"{2 / recording.frame_rate:g} s or more"
        )
    tracks = rows_of(recording)
    starts = segment_starts(tracks)
    vx, vy = (slopes(values, starts, window) * recording.frame_rate for values in (tracks.x, tracks.y))
    lone = np.diff(np.append(starts, len(tracks))) == 1
    vx[starts[lone]], vy[starts[lone]] = tracks.vx[starts[lone]], tracks.vy[starts[lone]]
    change = float(np.sqrt(np.mean((vx - tracks.vx) ** 2)))
    note = f"velocities from positions over {window} frames, which changes vx by {change:.2f} m/s (RMS)"
    return with_rows(recording, replace(tracks, vx=vx, vy=vy), note)


def fill_gaps(recording: Recording, seconds: float) -> Recording:
    """Return the recording with the gaps of at most so many seconds filled in tracks.

    A vehicle moves through a gap on the cubic polynomial that has the positions and velocities at its ends. A
    gap is left that no vehicle can have driven through: its mean speed is outside those at the ends by more
    than 5 m/s.

    Raises:
        UserError: `seconds` are not above 0.
    """
    if not seconds > 0:
        raise UserError(f"gaps of {seconds:g} s: expected seconds above 0")
    tracks = rows_of(recording)
    before = np.flatnonzero((np.diff(tracks.vehicle) == 0) & (np.diff(tracks.frame) > 1))
    missing = tracks.frame[before + 1] - tracks.frame[before] - 1
    short = missing <= np.round(seconds * recording.frame_rate)
    believed = _one_way(tracks, before, recording.frame_rate)
    chosen = before[short & believed]
    filled = _through(tracks, chosen, recording.frame_rate)
    both = Tracks(
        **{
            name: np.concatenate([getattr(tracks, name), getattr(filled, name)])
            for name in ("frame", "vehicle", *NUMBERS)
        }
    )
    both = both.take(np.lexsort((both.frame, both.vehicle)))
    rows = counted(len(filled), "row")
    note = f"{counted(len(chosen), 'gap')} of at most {seconds:g} s filled in tracks with {rows}"
    left = int((~short).sum()), int((short & ~believed).sum())
    if any(left):
        note += f"; left: {left[0]} longer, {left[1]} that no vehicle can have driven"
    return with_rows(recording, both, note)


def _one_way(tracks: Tracks, before: npt.NDArray[np.int64], rate: float) -> npt.NDArray[np.bool_]:
    """Return whether one vehicle can have driven through each gap."""
    after = before + 1
    time = (tracks.frame[after] - tracks.frame[before]) / rate
    possible = np.ones(len(before), dtype=np.bool_)
    for place, speed in ((tracks.x, tracks.vx), (tracks.y, tracks.vy)):
        mean = (place[after] - place[before]) / time
        low, high = np.minimum(speed[before], speed[after]), np.maximum(speed[before], speed[after])
        possible &= (mean >= low - ANOTHER) & (mean <= high + ANOTHER)
    return possible


def _through(tracks: Tracks, before: npt.NDArray[np.int64], rate: float) -> Tracks:
    """Return the rows in the gaps that follow the rows `before`."""
    count = tracks.frame[before + 1] - tracks.frame[before] - 1
    left, right = np.repeat(before, count), np.repeat(before + 1, count)
    step = np.arange(len(left)) - np.repeat(np.cumsum(count) - count, count) + 1
    span = (tracks.frame[right] - tracks.frame[left]) / rate
    part = step / rate / span
    x, vx = _cubic(part, span, tracks.x, tracks.vx, left, right)
    y, vy = _cubic(part, span, tracks.y, tracks.vy, left, right)
    size = {name: getattr(tracks, name)[left] for name in ("length", "width")}
    return Tracks(
        frame=tracks.frame[left] + step, vehicle=tracks.vehicle[left], x=x, y=y, vx=vx, vy=vy, **size
    )


def _cubic(
    part: Floats,
    span: Floats,
    place: Floats,
    speed: Floats,
    left: npt.NDArray[np.int64],
    right: npt.NDArray[np.int64],
) -> tuple[Floats, Floats]:
    """Return places and speeds on the cubic Hermite polynomials between rows, at parts of their spans."""
    way = place[right] - place[left]
    start, end = speed[left] * span, speed[right] * span
    square, cube = 3 * way - 2 * start - end, start + end - 2 * way
    position = place[left] + part * (start + part * (square + part * cube))
    return position, (start + part * (2 * square + part * 3 * cube)) / span


def _span(ends: tuple[float, float], unit: str) -> str:
    low, high = (("" if np.isinf(end) else f"{end:g}") for end in ends)
    return f"{low or 'the first'} to {high or 'the last'} {unit}"
