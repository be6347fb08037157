"""Episodes as small integers for the page: differences in time, in columns, deflated.

A column is a list of integers in the fewest bytes that hold all of them. Lengths and speeds are multiples of
`STEP`; what lasts for several frames, a vehicle or a reason, is a track: where it begins, its first values,
and then their differences from frame to frame. Of a vehicle's place, what its speed does not tell is kept.
"""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from drlsl.driving.episodes import Episode, arguments_of
from drlsl.driving.scene import Action
from drlsl.traffic import Floats, Integers

STEP: Final = 0.02
"""Lengths [m] and speeds [m/s] on the page are multiples of this."""

FINE: Final = 0.001
"""Observations and the numbers of reasons are multiples of this."""

REACH: Final = 2.0
"""How far along the road a vehicle may be from the ego to be on the page, in radar ranges."""

JUMP: Final = 200.0
"""How far no vehicle drives from one frame to the next [m]."""

LEVELS: Final = 30_000
"""Preferences are multiples of their largest magnitude divided by this."""

NONE: Final = -(2**31)
"""Stands for a number that is NaN or infinite."""

_KINDS: Final = (("i1", 127), ("i2", 32_767), ("i4", 2**31 - 1))

Key: TypeAlias = tuple[Any, ...]


class Columns:
    """Columns by name, and the bytes that hold them."""

    def __init__(self) -> None:
        self._columns: dict[str, npt.NDArray[Any]] = {}

    def add(self, name: str, values: npt.ArrayLike) -> None:
        """Add a column of integers."""
        whole = np.asarray(values, dtype=np.int64).ravel()
        largest = int(np.abs(whole).max(initial=0))
        kind = next((kind for kind, most in _KINDS if largest <= most), "i4")
        self._columns[name] = whole.astype(f"<{kind}")

    def packed(self) -> str:
        """Return all columns deflated, as base64."""
        layout, content, place = {}, b"", 0
        for name, column in sorted(self._columns.items(), key=lambda item: -item[1].itemsize):
            layout[name] = [column.dtype.str[1:], place, column.size]
            content += column.tobytes()
            place += column.nbytes
        head = json.dumps(layout, separators=(",", ":")).encode()
        head += b" " * (-(len(head) + 4) % 4)  # so that every column begins at a multiple of its size
        whole = len(head).to_bytes(4, "little") + head + content
        return base64.b64encode(zlib.compress(whole, 9)).decode("ascii")


def steps_of(values: Floats | Sequence[float], step: float) -> Integers:
    """Return numbers as multiples of a step, `NONE` for NaN and infinity."""
    numbers = np.asarray(values, dtype=np.float64)
    known = np.isfinite(numbers)
    multiples = np.rint(np.where(known, numbers, 0.0) / step)
    return np.where(known, np.clip(multiples, -(2**30), 2**30), NONE).astype(np.int64)


def differences(values: Integers) -> Integers:
    """Return the first row and the differences from row to row."""
    return np.diff(values, axis=0, prepend=np.zeros_like(values[:1]))


def pack(episode: Episode, frames: Integers) -> tuple[str, dict[str, Any]]:
    """Return the columns of some frames of an episode, and what else their reader must know."""
    columns = Columns()
    answers = episode.answers
    known = np.abs(episode.preferences[np.isfinite(episode.preferences)])
    unit = float(known.max(initial=0.0)) / LEVELS or 1.0
    columns.add("target_speed", differences(steps_of(answers.target_speed[frames], STEP)))
    columns.add("distance", differences(steps_of(episode.distance[frames], 0.1)))
    columns.add("observation", differences(steps_of(answers.observation[frames], FINE)).T)
    columns.add("target_lane", differences(episode.target_lane[frames]))
    columns.add("lane_to_keep", differences(answers.lane_to_keep[frames]))
    columns.add("front_is_free", answers.front_is_free[frames])
    columns.add("comfort", steps_of(answers.comfortable_acceleration[frames], STEP))
    columns.add("offered", answers.offered[frames] @ (1 << np.arange(len(Action))))
    columns.add("action", _at_or_since(episode.action, frames))
    columns.add("preferences", steps_of(_preferences(episode, frames), unit).T)
    columns.add("changed", _any_since(episode.changed, frames))
    columns.add("entered", _any_since(episode.entered, frames))
    columns.add("frame", differences(frames))
    _add_vehicles(columns, episode, frames)
    reasons = _add_reasons(columns, episode, frames)
    return columns.packed(), {"unit": unit, **reasons}


def _groups(frames: Integers, count: int) -> Iterable[tuple[int, int]]:
    """Return for each frame that is kept those that it stands for: itself and those left out after it."""
    return zip(frames.tolist(), [*frames[1:].tolist(), count], strict=True)


def _any_since(marks: npt.NDArray[np.bool_], frames: Integers) -> list[bool]:
    return [bool(marks[first:end].any()) for first, end in _groups(frames, len(marks))]


def _decided(episode_action: Integers, first: int, end: int) -> int:
    """Return the first frame of a group in which the driver decided, else the first."""
    decided = np.flatnonzero(episode_action[first:end] >= 0)
    return first + int(decided[0]) if decided.size else first


def _at_or_since(action: Integers, frames: Integers) -> list[int]:
    return [int(action[_decided(action, first, end)]) for first, end in _groups(frames, len(action))]


def _preferences(episode: Episode, frames: Integers) -> Floats:
    places = [_decided(episode.action, first, end) for first, end in _groups(frames, len(episode))]
    return episode.preferences[places]


def _add_vehicles(columns: Columns, episode: Episode, frames: Integers) -> None:
    """Add the tracks of the vehicles: the ego first in every frame."""
    rows, number = episode.traffic, {int(frame): place for place, frame in enumerate(frames.tolist())}
    tracks: dict[Key, list[tuple[int, int]]] = {}
    reach = REACH * episode.road.radar_range
    for frame, place in number.items():
        first, end = int(rows.begin[frame]), int(rows.begin[frame + 1])
        near = np.abs(rows.numbers[first:end, 0] - rows.numbers[first, 0]) <= reach
        for row in range(first, end):
            if near[row - first] and np.isfinite(rows.numbers[row]).all():
                tracks.setdefault((int(rows.name[row]), *rows.numbers[row, 4:].tolist()), []).append(
                    (place, row)
                )
    whole = [
        (key, part)
        for key, found in tracks.items()
        for piece in _without_gaps(found)
        for part in _without_jumps(piece, rows.numbers[:, 0])
    ]
    columns.add("v_name", [key[0] for key, _ in whole])
    columns.add("v_length", steps_of([key[1] for key, _ in whole], STEP))
    columns.add("v_width", steps_of([key[2] for key, _ in whole], STEP))
    columns.add("v_begin", differences(np.array([part[0][0] for _, part in whole], dtype=np.int64)))
    columns.add("v_frames", [len(part) for _, part in whole])
    taken = [np.array([row for _, row in part]) for _, part in whole]
    x, y, vx, vy = ([steps_of(rows.numbers[part, column], STEP) for part in taken] for column in range(4))
    times = frames * episode.road.time_step
    spans = [np.diff(times[[place for place, _ in part]]) for _, part in whole]
    for name, places, speeds in (("x", x, vx), ("y", y, vy)):
        columns.add(f"v_{name}_first", [int(track[0]) for track in places])
        beyond = [
            np.diff(place) - _driven(speed, span)
            for place, speed, span in zip(places, speeds, spans, strict=True)
        ]
        columns.add(f"v_{name}_steps", np.concatenate([np.zeros(0, dtype=np.int64), *beyond]))
    _add_track(columns, "v_vx", vx)
    _add_track(columns, "v_vy", vy)
    _add_track(columns, "v_lane", [rows.lane[part] for part in taken])


def _driven(speed: Integers, span: Floats) -> Integers:
    """Return how far a vehicle gets in each span [s] at the mean of its speeds before and after, in steps."""
    return np.floor((speed[:-1] + speed[1:]) * span * 0.5 + 0.5).astype(np.int64)


def _without_jumps(found: Sequence[tuple[int, int]], x: Floats) -> Iterator[list[tuple[int, int]]]:
    """Yield the pieces of a track between jumps, such as the ego's at the end of the stretch."""
    begin = 0
    for place in range(1, len(found)):
        if abs(x[found[place][1]] - x[found[place - 1][1]]) > JUMP:
            yield list(found[begin:place])
            begin = place
    yield list(found[begin:])


def _add_track(columns: Columns, name: str, tracks: Sequence[Integers]) -> None:
    """Add the first value of each track, and the differences of them all, one after the other."""
    none = np.zeros(0, dtype=np.int64)
    columns.add(f"{name}_first", [int(track[0]) for track in tracks])
    columns.add(f"{name}_steps", np.concatenate([none, *map(np.diff, tracks)]))


def _without_gaps(found: Sequence[tuple[int, int]]) -> list[list[tuple[int, int]]]:
    """Return places with something each, split wherever a place is left out."""
    parts: list[list[tuple[int, int]]] = []
    for one in found:
        if parts and parts[-1][-1][0] == one[0] - 1:
            parts[-1].append(one)
        else:
            parts.append([one])
    return parts


def _add_reasons(columns: Columns, episode: Episode, frames: Integers) -> dict[str, Any]:
    """Add the tracks of the reasons; return the table of their kinds."""
    numbers: list[list[float]] = []
    tracks: dict[Key, list[tuple[int, int]]] = {}
    for place, frame in enumerate(frames.tolist()):
        times: dict[Key, int] = {}
        for reason in episode.reasons[frame]:
            details = arguments_of(reason.objection)
            named = tuple(one if isinstance(one, str) else None for one in details)
            clause = -1 if reason.clause is None else reason.clause
            key = (int(reason.action), clause, reason.objection.reason, named)
            times[key] = times.get(key, 0) + 1
            tracks.setdefault((*key, times[key]), []).append((place, len(numbers)))
            numbers.append([one for one in details if not isinstance(one, str)])
    whole = [(key, part) for key, found in tracks.items() for part in _without_gaps(found)]
    kinds = {key[:4]: number for number, key in enumerate(dict.fromkeys(key[:4] for key, _ in whole))}
    columns.add("r_kind", [kinds[key[:4]] for key, _ in whole])
    columns.add("r_begin", differences(np.array([part[0][0] for _, part in whole], dtype=np.int64)))
    columns.add("r_frames", [len(part) for _, part in whole])
    most = max([0, *map(len, numbers)])
    for place in range(most):
        with_number = [part for key, part in whole if key[3].count(None) > place]
        values = [steps_of([numbers[row][place] for _, row in part], FINE) for part in with_number]
        _add_track(columns, f"r_number{place}", values)
    table = [
        {"action": action, "clause": clause, "reason": reason, "arguments": list(named)}
        for action, clause, reason, named in kinds
    ]
    return {"reasons": table, "numbers": most}
