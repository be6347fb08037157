"""Load recordings in the layout of the highD data set.

Source: R. Krajewski et al., The highD Dataset, ITSC 2018, and the format description at
https://levelxdata.com/highd-dataset/.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from drlsl.errors import UserError
from drlsl.traffic.assemble import Road, assemble
from drlsl.traffic.columns import Kind, line_of_row, read_columns, read_header
from drlsl.traffic.map_tracks import UNLIMITED_SPEED
from drlsl.traffic.plausible import HIGHEST_LIMIT, Place, check_rows, true_frames
from drlsl.traffic.recording import Recording, VehicleClass
from drlsl.traffic.road import Direction, Lane, MergingLane, Traffic
from drlsl.traffic.source import Source
from drlsl.traffic.tracks import Tracks, without_duplicates
from drlsl.traffic.words import counted, listed

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
OWN_COLUMNS = {"laneSpeedLimits": Kind.TEXT, "mergingLanes": Kind.TEXT, "traffic": Kind.TEXT}
"""Columns that highD does not have, and a recording may have."""

MERGING_LANE = ("begin", "end", "top", "bottom")
"""Numbers of a merging lane, in the order of the column."""


@dataclass(frozen=True, slots=True)
class _Vehicles:
    """The contents of tracksMeta: classes, and the rows of each vehicle's track where they are told."""

    classes: dict[int, VehicleClass]
    rows: dict[float, float]


@dataclass(frozen=True, slots=True)
class _Meta:
    """The contents of recordingMeta."""

    frame_rate: float
    lanes: tuple[Lane, ...]
    merging_lanes: tuple[MergingLane, ...]
    traffic: Traffic


def load_highd(source: Source) -> Recording:
    """Load one recording in highD layout.

    The box's top-left corner and sizes become centres; `width` in the files is the length along the road.
    Lanes are derived from the markings, the lane of each row from its centre.

    Raises:
        UserError: a file is unreadable or inconsistent.
    """
    tracks_file, vehicles_file, meta_file = source.files
    meta = _read_meta(meta_file)
    vehicles = _read_vehicles(vehicles_file)
    tracks, place = _read_tracks(tracks_file)
    unknown = sorted(set(np.unique(tracks.vehicle).tolist()) - set(vehicles.classes))
    if unknown:
        raise UserError(
            f"{vehicles_file}: no row for vehicle {listed([*map(str, unknown)])}, which the tracks have"
        )
    check_rows(place, tracks)
    tracks, frame_rate, thinned = true_frames(place, tracks, meta.frame_rate)
    tracks, _, dropped = without_duplicates(tracks)
    return assemble(
        source.name,
        place,
        tracks,
        frame_rate,
        Road(meta.lanes, meta.merging_lanes, meta.traffic),
        vehicles.classes,
        dropped=dropped,
        notes=(*thinned, *_missing(tracks, vehicles)),
    )


def _read_tracks(path: Path) -> tuple[Tracks, Place]:
    table = read_columns(path, TRACK_COLUMNS)
    if table.empty:
        raise UserError(f"{path}: no vehicle: the file has a header and no rows")
    column = {name: table[name].to_numpy(dtype=np.float64) for name in TRACK_COLUMNS}
    frame = column["frame"].astype(np.int64)
    tracks = Tracks(
        frame=frame - frame.min(),
        vehicle=column["id"].astype(np.int64),
        x=column["x"] + column["width"] / 2,
        y=column["y"] + column["height"] / 2,
        vx=column["xVelocity"],
        vy=column["yVelocity"],
        length=column["width"],
        width=column["height"],
    )
    return tracks, Place(path, int(frame.min()), lambda row: line_of_row(path, row)[0])


def _read_vehicles(path: Path) -> _Vehicles:
    counts = "numframes" in {column.lower() for column in read_header(path)}
    table = read_columns(path, VEHICLE_COLUMNS | ({"numFrames": Kind.COUNT} if counts else {}))
    classes: dict[int, VehicleClass] = {}
    for vehicle, text in zip(table["id"].astype(int).tolist(), table["class"], strict=True):
        try:
            kind = VehicleClass(str(text).strip().lower())
        except ValueError:
            expected = ", ".join(kind.value.capitalize() for kind in VehicleClass)
            raise UserError(f"{path}: vehicle {vehicle}: class {text!r} is none of {expected}") from None
        if classes.setdefault(vehicle, kind) is not kind:
            raise UserError(
                f"{path}: vehicle {vehicle} has two classes, {classes[vehicle].value} and {kind.value}"
            )
    rows = dict(zip(table["id"].tolist(), table["numFrames"].tolist(), strict=True)) if counts else {}
    return _Vehicles(classes, rows)


def _missing(tracks: Tracks, vehicles: _Vehicles) -> tuple[str, ...]:
    """Return a note if tracksMeta tells of frames that the tracks do not have, as where they were cut off."""
    seen = dict(zip(*map(np.ndarray.tolist, np.unique(tracks.vehicle, return_counts=True)), strict=True))
    fewer = {vehicle: rows - seen.get(vehicle, 0) for vehicle, rows in vehicles.rows.items()}
    fewer = {vehicle: rows for vehicle, rows in fewer.items() if rows > 0}
    if not fewer:
        return ()
    return (
        f"tracksMeta tells of {counted(int(sum(fewer.values())), 'row')} of {counted(len(fewer), 'vehicle')} "
        "that the tracks do not have",
    )


def _read_meta(path: Path) -> _Meta:
    header = {column.lower() for column in read_header(path)}
    own = {name: kind for name, kind in OWN_COLUMNS.items() if name.lower() in header}
    table = read_columns(path, META_COLUMNS | own)
    if len(table) != 1:
        raise UserError(f"{path}: {len(table)} rows, expected the one row of a recording")
    row = table.iloc[0]
    upper = _markings(path, "upperLaneMarkings", row["upperLaneMarkings"])
    lower = _markings(path, "lowerLaneMarkings", row["lowerLaneMarkings"])
    if upper and lower and upper[-1] > lower[0]:
        raise UserError(f"{path}:2: the upper lane markings must lie above (y smaller than) the lower ones")
    if not (upper or lower):
        raise UserError(f"{path}:2: no lane markings, neither upper nor lower")
    limits = _limits(path, row, max(len(upper) - 1, 0) + max(len(lower) - 1, 0))
    return _Meta(
        frame_rate=float(row["frameRate"]),
        lanes=_lanes(upper, lower, limits),
        merging_lanes=_merging_lanes(path, row.get("mergingLanes")),
        traffic=_traffic(path, row.get("traffic")),
    )


def _limits(path: Path, row: pd.Series[Any], count: int) -> list[float]:
    """Return the speed limit of each lane from the top [m/s]."""
    text = row.get("laneSpeedLimits")
    values = [float(row["speedLimit"])] * count
    if _given(text):
        values = _numbers(text, ";")
        if len(values) != count or not all(np.isfinite(values)):
            raise UserError(
                f"{path}:2: column laneSpeedLimits: {text!r} is not {count} numbers joined by ';', one for "
                "each lane"
            )
    return [speed_limit(path, value) or UNLIMITED_SPEED for value in values]


def speed_limit(path: Path, value: float) -> float | None:
    """Return a speed limit [m/s], None for none.

    Raises:
        UserError: it is no limit of a road.
    """
    if value != -1 and not 0 < value <= HIGHEST_LIMIT:
        raise UserError(
            f"{path}:2: speed limit {value:g}: expected m/s, at most {HIGHEST_LIMIT:g}, or -1 for none (120 "
            "km/h are "
            "33.33)"
        )
    return None if value == -1 else value


def _merging_lanes(path: Path, text: object) -> tuple[MergingLane, ...]:
    """Return the merging lanes of a cell: begin, end, upper and lower border of each [m]."""
    if not _given(text):
        return ()
    lanes = []
    for item in str(text).split(";"):
        values = _numbers(item, ":")
        if len(values) != len(MERGING_LANE) or not all(np.isfinite(values)):
            raise UserError(
                f"{path}:2: column mergingLanes: {item!r} is not {':'.join(MERGING_LANE)}, in metres"
            )
        begin, end, top, bottom = values
        direction = Direction.LEFT_TO_RIGHT if begin < end else Direction.RIGHT_TO_LEFT
        lanes.append(MergingLane(direction, (top + bottom) / 2, bottom - top, begin, end))
    return tuple(lanes)


def _traffic(path: Path, text: object) -> Traffic:
    if not _given(text):
        return Traffic.RECORDED
    try:
        return Traffic(str(text).strip().lower())
    except ValueError:
        expected = " or ".join(traffic.value for traffic in Traffic)
        raise UserError(f"{path}:2: column traffic: {text!r} is not {expected}") from None


def _given(text: object) -> bool:
    """Return whether an optional cell is there and not empty."""
    return text is not None and not pd.isna(text) and bool(str(text).strip())  # type: ignore[call-overload]


def _numbers(text: object, mark: str) -> list[float]:
    """Return the numbers of a cell that `mark` joins; NaN alone if there is anything else."""
    try:
        return [float(item) for item in str(text).split(mark) if item.strip()]
    except ValueError:
        return [float("nan")]


def _markings(path: Path, column: str, text: object) -> list[float]:
    """Return the y of the lane markings, top first; empty if the road has no such side."""
    values = _numbers(text, ";") if _given(text) else []
    if not np.isfinite(values).all() or len(values) == 1 or any(b <= a for a, b in pairwise(values)):
        raise UserError(
            f"{path}:2: column {column}: {text!r} is not two or more increasing numbers joined by ';'"
        )
    return values


def _lanes(upper: Sequence[float], lower: Sequence[float], limits: Sequence[float]) -> tuple[Lane, ...]:
    """Return lanes between neighbouring markings, counted from the top; the upper side runs right to left."""
    strips = [(pair, Direction.RIGHT_TO_LEFT) for pair in pairwise(upper)]
    strips += [(pair, Direction.LEFT_TO_RIGHT) for pair in pairwise(lower)]
    return tuple(
        Lane(number, direction, (top + bottom) / 2, bottom - top, limit)
        for number, (((top, bottom), direction), limit) in enumerate(
            zip(strips, limits, strict=True), start=1
        )
    )
