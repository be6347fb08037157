"""Write recordings in the layout of the highD data set.

The columns that highD derives from the others (sight distances, headways, ids of the neighbours) are left
out; every column written has highD's meaning.
"""

from __future__ import annotations

import lzma
import re
import struct
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from drlsl.errors import UserError
from drlsl.files import not_replaceable, scratch_beside
from drlsl.traffic.array_kinds import Floats
from drlsl.traffic.recording import VehicleClass
from drlsl.traffic.road import MergingLane, Traffic
from drlsl.traffic.tracks import Tracks

RECORDING_FILE = re.compile(r"\d+_((tracks|tracksMeta|recordingMeta)\.csv(\.gz|\.xz)?|highway\.png)")
"""The files of a recording, the only ones that `force` replaces."""


@dataclass(frozen=True, slots=True, eq=False)
class HighdContent:
    """All contents of the three files of one recording.

    `tracks` are sorted by vehicle and frame, frames count from 0, each vehicle has one unbroken track; `ax`
    and `ay` [m/s²] have one value a row, or are None: not written. Markings are y values [m], top first,
    empty for a direction without lanes; `speed_limit` [m/s] is None for no limit. `lane_limits` [m/s], one
    for each lane from the top, take its place where there are any. `merging_lanes` and `traffic` are as in
    Recording. These three are columns of recordingMeta that highD does not have, written only where they say
    something. `location` is highD's locationId; with it a picture of one pixel is written, as
    other readers need both. None: neither.
    """

    tracks: Tracks
    ax: Floats | None
    ay: Floats | None
    vehicle_class: Mapping[int, VehicleClass]
    frame_rate: float
    upper_markings: Sequence[float]
    lower_markings: Sequence[float]
    speed_limit: float | None
    lane_limits: Sequence[float] = ()
    merging_lanes: Sequence[MergingLane] = ()
    traffic: Traffic = Traffic.RECORDED
    location: int | None = None


def check_folder(folder: Path, *, force: bool) -> None:
    """Check that a recording may be written there, before the work of making it.

    Raises:
        UserError: the folder exists and `force` is not given, or it holds anything but a recording, which
            `force` would delete.
    """
    if not folder.exists():
        return
    if not folder.is_dir():
        raise UserError(f"{folder}: is {not_replaceable(folder) or 'a file'}, expected a folder to write")
    if not force:
        raise UserError(f"{folder}: exists already; choose another folder or add --force to replace it")
    others = sorted(path.name for path in folder.iterdir() if not RECORDING_FILE.fullmatch(path.name))
    if others:
        raise UserError(f"{folder}: --force replaces only recordings, and {others[0]} is not part of one")


def write_highd(
    content: HighdContent, folder: Path, part: str = "01", *, force: bool = False, compress: bool = False
) -> Path:
    """Write a folder with one recording, whole or not at all; files end in .csv, or .csv.xz with `compress`.

    Raises:
        UserError: the folder exists and `force` is not given, or cannot be written.
    """
    check_folder(folder, force=force)
    tables = {
        "tracks": _tracks_table(content),
        "tracksMeta": _vehicles_table(content),
        "recordingMeta": _meta_table(content, part),
    }
    try:
        with scratch_beside(folder) as scratch:
            fresh = scratch / "new"
            fresh.mkdir()
            for kind, table in tables.items():
                text = table.to_csv(index=False, float_format="%.2f", lineterminator="\n").encode()
                if compress:
                    packed = lzma.compress(text, preset=9 | lzma.PRESET_EXTREME)
                    (fresh / f"{part}_{kind}.csv.xz").write_bytes(packed)
                else:
                    (fresh / f"{part}_{kind}.csv").write_bytes(text)
            if content.location is not None:
                (fresh / f"{part}_highway.png").write_bytes(_picture())
            _swap(fresh, folder, aside=scratch / "old")
    except OSError as error:
        raise UserError(f"{folder}: cannot be written: {error.strerror or error}") from error
    return folder


def _picture() -> bytes:
    """Return a PNG of one grey pixel: other readers leave out a recording without a picture of its road."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", 1, 1, 8, 0, 0, 0, 0)
    pixel = zlib.compress(b"\0\x80")
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", pixel) + chunk(b"IEND", b"")


def _swap(fresh: Path, folder: Path, *, aside: Path) -> None:
    """Put the fresh folder in place of the old one, if any; if that fails, restore the old one."""
    existed = folder.exists()
    if existed:
        folder.rename(aside)
    try:
        fresh.rename(folder)
    except OSError:
        if existed:
            aside.rename(folder)
        raise


def _tracks_table(content: HighdContent) -> pd.DataFrame:
    tracks = content.tracks
    columns = {
        "frame": tracks.frame + 1,
        "id": tracks.vehicle,
        "x": _rounded(tracks.x - tracks.length / 2),
        "y": _rounded(tracks.y - tracks.width / 2),
        "width": tracks.length,
        "height": tracks.width,
        "xVelocity": _rounded(tracks.vx),
        "yVelocity": _rounded(tracks.vy),
    }
    for name, values in (("xAcceleration", content.ax), ("yAcceleration", content.ay)):
        if values is not None:
            columns[name] = _rounded(values)
    return pd.DataFrame({**columns, "laneId": _lane_ids(content)})


def _lane_ids(content: HighdContent) -> np.ndarray:
    """highD's lane ids: the strips between all markings, counted from 1, the one above the first marking."""
    return (
        np.searchsorted([*content.upper_markings, *content.lower_markings], content.tracks.y, side="right")
        + 1
    )


def _vehicles_table(content: HighdContent) -> pd.DataFrame:
    tracks = content.tracks
    speed = np.abs(tracks.vx)
    rows = pd.DataFrame(
        {
            "id": tracks.vehicle,
            "width": tracks.length,
            "height": tracks.width,
            "frame": tracks.frame + 1,
            "x": tracks.x,
            "vx": tracks.vx,
            "speed": speed,
            "lane": _lane_ids(content),
        }
    )
    groups = rows.groupby("id", sort=True)
    table = groups[["width", "height"]].first()
    table["initialFrame"] = groups["frame"].min()
    table["finalFrame"] = groups["frame"].max()
    table["numFrames"] = groups.size()
    table["class"] = [content.vehicle_class[int(vehicle)].value.capitalize() for vehicle in table.index]
    table["drivingDirection"] = np.where(groups["vx"].mean() < 0, 1, 2)
    table["traveledDistance"] = groups["x"].max() - groups["x"].min()
    table["minXVelocity"] = groups["speed"].min()
    table["maxXVelocity"] = groups["speed"].max()
    table["meanXVelocity"] = groups["speed"].mean()
    changed = (rows["lane"].diff() != 0) & (rows["id"].diff() == 0)
    table["numLaneChanges"] = changed.groupby(rows["id"]).sum()
    return table.reset_index()


def _meta_table(content: HighdContent, part: str) -> pd.DataFrame:
    tracks = content.tracks
    distances = np.abs(tracks.vx) / content.frame_rate
    kinds = list(content.vehicle_class.values())
    location = {} if content.location is None else {"locationId": [content.location]}
    return pd.DataFrame(
        {
            "id": [int(part)],
            **location,
            "frameRate": [_exact(content.frame_rate)],
            "speedLimit": [-1.0 if content.speed_limit is None else content.speed_limit],
            "duration": [(int(tracks.frame.max()) + 1) / content.frame_rate],
            "totalDrivenDistance": [float(distances.sum())],
            "totalDrivenTime": [len(tracks) / content.frame_rate],
            "numVehicles": [len(kinds)],
            "numCars": [kinds.count(VehicleClass.CAR)],
            "numTrucks": [kinds.count(VehicleClass.TRUCK)],
            "upperLaneMarkings": [";".join(f"{y:.2f}" for y in content.upper_markings)],
            "lowerLaneMarkings": [";".join(f"{y:.2f}" for y in content.lower_markings)],
            **_own_columns(content),
        }
    )


def _exact(number: float) -> str:
    """Return two decimals, as in highD, or as many as the number has: a rounded rate shifts times."""
    short = f"{number:.2f}"
    return short if float(short) == number else repr(float(number))


def _own_columns(content: HighdContent) -> dict[str, list[str]]:
    """Return the columns that highD does not have; docs/data.md describes them."""
    columns = {}
    if content.lane_limits:
        columns["laneSpeedLimits"] = [";".join(f"{limit:.2f}" for limit in content.lane_limits)]
    if content.merging_lanes:
        corners = (
            (lane.begin, lane.end, lane.centre - lane.width / 2, lane.centre + lane.width / 2)
            for lane in content.merging_lanes
        )
        columns["mergingLanes"] = [";".join(":".join(f"{value:.2f}" for value in four) for four in corners)]
    if content.traffic is not Traffic.RECORDED:
        columns["traffic"] = [content.traffic.value]
    return columns


def _rounded(values: Floats) -> Floats:
    """Return two decimals, as in highD, and no minus before a zero."""
    return np.round(values, 2) + 0.0
