"""Load recordings in the layout of the highD data set.

Source: R. Krajewski et al., The highD Dataset, ITSC 2018, and the format description at
https://levelxdata.com/highd-dataset/.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd

from drlsl.errors import UserError
from drlsl.traffic.columns import Kind, read_columns
from drlsl.traffic.recording import Recording, VehicleClass
from drlsl.traffic.road import Direction, Lane
from drlsl.traffic.sources import Source
from drlsl.traffic.tracks import Tracks, lanes_of_rows, pack, without_duplicates

UNLIMITED_SPEED = 130 / 3.6
"""Speed limit [m/s] where highD's is -1 (none): the advisory speed of the German Autobahn.

Source: Autobahn-Richtgeschwindigkeits-V, section 1.
"""

TRACK_COLUMNS = {
    "frame": Kind.COUNT,
    "id": Kind.COUNT,
    "x": Kind.NUMBER,
    "y": Kind.NUMBER,
    "width": Kind.POSITIVE,
    "height": Kind.POSITIVE,
    "xVelocity": Kind.NUMBER,
    "yVelocity": Kind.NUMBER,
}
VEHICLE_COLUMNS = {"id": Kind.COUNT, "class": Kind.TEXT}
META_COLUMNS = {
    "frameRate": Kind.POSITIVE,
    "speedLimit": Kind.NUMBER,
    "upperLaneMarkings": Kind.TEXT,
    "lowerLaneMarkings": Kind.TEXT,
}


def load_highd(source: Source) -> Recording:
    """Load one recording in highD layout.

    The box's top-left corner and sizes become centres; `width` in the files is the length along the road.
    Lanes are derived from the markings, the lane of each row from its centre. The recorded stretch runs from
    the rearmost to the foremost box.

    Raises:
        UserError: a file is unreadable or inconsistent.
    """
    tracks_file, vehicles_file, meta_file = source.files
    frame_rate, lanes = _read_meta(meta_file)
    classes = _read_classes(vehicles_file)
    tracks = _read_tracks(tracks_file)
    unknown = sorted(set(np.unique(tracks.vehicle).tolist()) - set(classes))
    if unknown:
        listed = ", ".join(map(str, unknown[:5])) + (", …" if len(unknown) > 5 else "")
        raise UserError(f"{vehicles_file}: no row for vehicle {listed}, which {tracks_file.name} has")
    tracks, _, dropped = without_duplicates(tracks)
    seen = set(np.unique(tracks.vehicle).tolist())
    lane = lanes_of_rows(tracks.y, lanes)
    recording = Recording(
        name=source.name,
        frame_rate=frame_rate,
        lanes=lanes,
        x_min=float((tracks.x - tracks.length / 2).min()),
        x_max=float((tracks.x + tracks.length / 2).max()),
        frames=pack(tracks, lane, name=source.name),
        vehicle_class={vehicle: kind for vehicle, kind in classes.items() if vehicle in seen},
        dropped=dropped,
        notes=_notes(tracks, lane, lanes),
    )
    recording.validate()
    return recording


def _read_tracks(path: Path) -> Tracks:
    table = read_columns(path, TRACK_COLUMNS)
    if table.empty:
        raise UserError(f"{path}: no vehicle: the file has a header and no rows")
    column = {name: table[name].to_numpy(dtype=np.float64) for name in TRACK_COLUMNS}
    frame = column["frame"].astype(np.int64)
    return Tracks(
        frame=frame - frame.min(),
        vehicle=column["id"].astype(np.int64),
        x=column["x"] + column["width"] / 2,
        y=column["y"] + column["height"] / 2,
        vx=column["xVelocity"],
        vy=column["yVelocity"],
        length=column["width"],
        width=column["height"],
    )


def _read_classes(path: Path) -> dict[int, VehicleClass]:
    table = read_columns(path, VEHICLE_COLUMNS)
    classes: dict[int, VehicleClass] = {}
    for vehicle, text in zip(table["id"].astype(int).tolist(), table["class"], strict=True):
        try:
            classes[vehicle] = VehicleClass(str(text).strip().lower())
        except ValueError:
            expected = ", ".join(kind.value.capitalize() for kind in VehicleClass)
            raise UserError(f"{path}: vehicle {vehicle}: class {text!r} is none of {expected}") from None
    return classes


def _read_meta(path: Path) -> tuple[float, tuple[Lane, ...]]:
    table = read_columns(path, META_COLUMNS)
    if len(table) != 1:
        raise UserError(f"{path}: {len(table)} rows, expected the one row of a recording")
    row = table.iloc[0]
    upper = _markings(path, "upperLaneMarkings", row["upperLaneMarkings"])
    lower = _markings(path, "lowerLaneMarkings", row["lowerLaneMarkings"])
    if upper and lower and upper[-1] > lower[0]:
        raise UserError(f"{path}:2: the upper lane markings must lie above (y smaller than) the lower ones")
    if not (upper or lower):
        raise UserError(f"{path}:2: no lane markings, neither upper nor lower")
    limit = float(row["speedLimit"])
    return float(row["frameRate"]), _lanes(upper, lower, limit if limit > 0 else UNLIMITED_SPEED)


def _markings(path: Path, column: str, text: object) -> list[float]:
    """Return the y of the lane markings, top first; empty if the road has no such side."""
    if pd.isna(text):  # type: ignore[call-overload]  # a cell is any scalar
        return []
    try:
        values = [float(item) for item in str(text).split(";") if item.strip()]
    except ValueError:
        values = [float("nan")]
    if not np.isfinite(values).all() or len(values) == 1 or any(b <= a for a, b in pairwise(values)):
        raise UserError(
            f"{path}:2: column {column}: {text!r} is not two or more increasing numbers joined by ';'"
        )
    return values


def _lanes(upper: Sequence[float], lower: Sequence[float], limit: float) -> tuple[Lane, ...]:
    """Return lanes between neighbouring markings, counted from the top; the upper side runs right to left."""
    strips = [(pair, Direction.RIGHT_TO_LEFT) for pair in pairwise(upper)]
    strips += [(pair, Direction.LEFT_TO_RIGHT) for pair in pairwise(lower)]
    return tuple(
        Lane(number, direction, (top + bottom) / 2, bottom - top, limit)
        for number, ((top, bottom), direction) in enumerate(strips, start=1)
    )


def _notes(tracks: Tracks, lane: np.ndarray, lanes: Sequence[Lane]) -> tuple[str, ...]:
    """Return notes on rows that do not fit the road."""
    notes = []
    off = int((lane == 0).sum())
    if off:
        notes.append(f"{off} rows have their centre in no lane (lane 0)")
    sign = np.array([0] + [item.direction.sign for item in lanes])[lane]
    backward = int((tracks.vx * sign < -1.0).sum())
    if backward:
        notes.append(f"{backward} rows move against their lane's direction faster than 1 m/s")
    return tuple(notes)
