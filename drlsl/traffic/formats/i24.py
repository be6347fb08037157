"""Load I-24 MOTION trajectories: JSON documents, one a vehicle.

x in feet is the mile marker along the road, y that across it, larger to the north; `direction` 1 is east,
-1 west. The position is that of the rear's centre, times are Unix seconds. There are no lanes and no speeds
in it.

Source: D. Gloudemans et al., I-24 MOTION: An instrument for freeway traffic science, TR-C 2023; the
tutorial at https://github.com/I24-MOTION/data_tutorial.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from drlsl.errors import UserError
from drlsl.traffic.array_kinds import Floats
from drlsl.traffic.assemble import Road, assemble
from drlsl.traffic.files import read_json
from drlsl.traffic.lane_pieces import Piece, lanes_of_pieces
from drlsl.traffic.named_rows import LONGEST
from drlsl.traffic.plausible import Place, check_rows
from drlsl.traffic.recording import Dropped, Recording, VehicleClass
from drlsl.traffic.slopes import slopes
from drlsl.traffic.source import Source
from drlsl.traffic.tracks import Tracks, without_duplicates

FOOT: Final = 0.3048
RATE: Final = 25.0
"""Frames a second: the trajectories have a point every 0.04 s."""

LANE: Final = 12 * FOOT
"""Width of a lane [m], 12 ft."""

FARTHEST: Final = 1e11
"""A number above all times [s], places [ft] and sizes."""

BUSY: Final = 0.02
"""Share of a direction's rows that a lane has at least."""

LIMIT: Final = 70 * 1609.344 / 3600
"""Speed limit [m/s] of this stretch of I-24, 70 mph, which the documents do not give."""

WINDOW: Final = 13
"""Frames (0.5 s) of the straight lines whose slopes are the velocities."""

CLASSES: Final = {
    0: VehicleClass.CAR,
    1: VehicleClass.CAR,
    2: VehicleClass.CAR,
    3: VehicleClass.CAR,
    4: VehicleClass.TRUCK,
    5: VehicleClass.TRUCK,
    6: VehicleClass.MOTORCYCLE,
}
"""coarse_vehicle_class: sedan, midsize, van or pickup, pickup or van, semi, truck, motorcycle."""

KEYS: Final = (
    "timestamp",
    "x_position",
    "y_position",
    "length",
    "width",
    "direction",
    "coarse_vehicle_class",
)


def load_i24(source: Source) -> Recording:
    """Load all trajectories of a file, both directions; lanes are strips of 12 ft where vehicles drive.

    Raises:
        UserError: the file is unreadable or a document lacks a key.
    """
    path = source.files[0]
    documents = _documents(path)
    parts, classes, lone = [], {}, 0
    begin = float(np.median([one["timestamp"][0] for one in documents]))
    begin = min(one["timestamp"][0] for one in documents if abs(one["timestamp"][0] - begin) <= LONGEST)
    for number, one in enumerate(documents, start=1):
        part = _track(path, number, one, begin)
        if part is None:
            lone += len(one["timestamp"])
            continue
        parts.append(part)
        classes[number] = CLASSES[int(one["coarse_vehicle_class"])]
    if not parts:
        raise UserError(f"{path}: no trajectory of two points")
    names = list(Tracks.__dataclass_fields__)
    tracks = Tracks(**{name: np.concatenate([getattr(one, name) for one in parts]) for name in names})
    place = Place(path)
    check_rows(place, tracks)
    tracks, _, repeated = without_duplicates(tracks)
    pieces = [piece for sign in (1, -1) for piece in _lane_strips(tracks, sign)]
    lanes, left_out = lanes_of_pieces(path, pieces, LIMIT, LANE)
    dropped = (Dropped("a trajectory of one point", lone),) if lone else ()
    return assemble(
        source.name,
        place,
        tracks,
        RATE,
        Road(lanes),
        classes,
        dropped=(*dropped, *repeated),
        notes=("velocities are slopes of the positions over 0.5 s", *left_out),
    )


def _documents(path: Path) -> list[dict[str, Any]]:
    found = read_json(path)
    if not isinstance(found, list) or not found or not all(isinstance(one, dict) for one in found):
        raise UserError(f"{path}: expected a list of documents, one for each vehicle")
    for number, one in enumerate(found, start=1):
        if missing := [key for key in KEYS if key not in one or one[key] is None]:
            raise UserError(f"{path}: document {number} has no {', '.join(missing)}")
        vectors = [one[key] for key in KEYS[:3]]
        if not all(isinstance(vector, list) and len(vector) == len(vectors[0]) > 0 for vector in vectors):
            raise UserError(
                f"{path}: document {number}: timestamp, x_position and y_position differ in length"
            )
        if not all(isinstance(value, (int, float)) for key in KEYS[:3] for value in one[key]):
            raise UserError(f"{path}: document {number} holds something that is no number")
        if one["direction"] not in (1, -1):
            raise UserError(f"{path}: document {number}: direction {one['direction']!r}: expected 1 or -1")
        if str(one["coarse_vehicle_class"]) not in map(str, CLASSES):
            raise UserError(
                f"{path}: document {number}: coarse_vehicle_class {one['coarse_vehicle_class']!r}: expected "
                "0 to 6"
            )
    return found


def _track(path: Path, number: int, one: dict[str, Any], begin: float) -> Tracks | None:
    """Return the track of a document at the times of frames, None if it has one point."""
    try:
        time, x, y = (np.array(one[key], dtype=np.float64) for key in KEYS[:3])
        length, width = (float(np.mean(one[key])) * FOOT for key in ("length", "width"))
    except (TypeError, ValueError):
        raise UserError(f"{path}: document {number} holds something that is no number") from None
    if abs(time[0] - begin) > LONGEST or abs(time[-1] - time[0]) > LONGEST:
        raise UserError(f"{path}: document {number}: its times are days away from the others")
    if not all((np.abs(values) < FARTHEST).all() for values in (time, x, y, np.array([length, width]))):
        raise UserError(f"{path}: document {number} holds a number that is not finite, or no time or place")
    if (np.diff(time) <= 0).any():
        raise UserError(f"{path}: document {number}: timestamp does not increase")
    if length <= 0 or width <= 0:
        raise UserError(
            f"{path}: document {number}: length {one['length']}, width {one['width']}: expected more than 0"
        )
    first, last = np.ceil((time[0] - begin) * RATE - 1e-3), np.floor((time[-1] - begin) * RATE + 1e-3)
    frame = np.arange(first, last + 1).astype(np.int64)
    if len(frame) < 2:
        return None
    at = frame / RATE + begin
    near = np.abs(time[np.clip(np.searchsorted(time, at), 0, len(time) - 1)] - at)
    near = np.minimum(near, np.abs(time[np.clip(np.searchsorted(time, at) - 1, 0, len(time) - 1)] - at))
    frame, at = frame[near < 1 / RATE], at[near < 1 / RATE]  # where points are missing, so are frames
    sign = float(one["direction"])
    along = np.interp(at, time, x) * FOOT + sign * length / 2
    down = -np.interp(at, time, y) * FOOT
    starts = np.flatnonzero(np.concatenate([[True], np.diff(frame) != 1]))
    return Tracks(
        frame=frame,
        vehicle=np.full(len(frame), number, dtype=np.int64),
        x=along,
        y=down,
        vx=slopes(along, starts, WINDOW) * RATE,
        vy=slopes(down, starts, WINDOW) * RATE,
        length=np.full(len(frame), length),
        width=np.full(len(frame), width),
    )


def _lane_strips(tracks: Tracks, sign: int) -> list[Piece]:
    """Return the lanes of one direction: strips of 12 ft, laid where the vehicles drive in their middles."""
    mine = np.sign(tracks.vx) == sign
    y: Floats = tracks.y[mine]
    if not len(y):
        return []
    middle = float(np.angle(np.exp(2j * np.pi * y / LANE).sum())) / (2 * np.pi) * LANE
    strip: npt.NDArray[np.int64] = np.rint((y - middle) / LANE).astype(np.int64)
    numbers, rows = np.unique(strip, return_counts=True)
    busy = numbers[rows >= BUSY * len(y)]
    x = tracks.x[mine]
    return [Piece(sign, float(x.min()), float(x.max()), middle + one * LANE, LANE) for one in busy.tolist()]
