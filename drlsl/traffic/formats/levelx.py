"""Load recordings in the layout of exiD, which inD, rounD and uniD share.

Those of crossings and roundabouts are refused: there is no stretch of road to straighten.

Source: T. Moers et al., The exiD Dataset, IV 2022, and the format description at
https://levelxdata.com/exid-dataset/.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd

from drlsl.errors import UserError
from drlsl.traffic.columns import Kind, line_of_row, read_columns, read_header
from drlsl.traffic.formats.highd import speed_limit
from drlsl.traffic.lane_pieces import Piece, pieces_of_ids
from drlsl.traffic.map_tracks import OnMap, assemble_from_map
from drlsl.traffic.plausible import Place
from drlsl.traffic.recording import Dropped, Recording, VehicleClass
from drlsl.traffic.source import Source
from drlsl.traffic.tracks import Tracks

TRACKS: Final = {
    "trackId": Kind.COUNT,
    "frame": Kind.COUNT,
    "xCenter": Kind.NUMBER,
    "yCenter": Kind.NUMBER,
    "width": Kind.NUMBER,
    "length": Kind.NUMBER,
    "xVelocity": Kind.NUMBER,
    "yVelocity": Kind.NUMBER,
}
LANES: Final = {"laneletId": Kind.TEXT, "laneWidth": Kind.TEXT, "latLaneCenterOffset": Kind.TEXT}
"""Columns of exiD alone. Each may hold several values joined by `;`, where lanelets lie on each other."""

NO_LANELET: Final = "-1"

CLASSES: Final = {
    "car": VehicleClass.CAR,
    "van": VehicleClass.CAR,
    "truck": VehicleClass.TRUCK,
    "trailer": VehicleClass.TRUCK,
    "bus": VehicleClass.TRUCK,
    "truck_bus": VehicleClass.TRUCK,
    "motorcycle": VehicleClass.MOTORCYCLE,
}
ON_FOOT: Final = ("pedestrian", "bicycle", "animal")
"""Classes of road users that are left out, and counted."""


def load_levelx(source: Source) -> Recording:
    """Load one recording of exiD; lanes are the lanelets that span the stretch.

    Raises:
        UserError: a file is unreadable or inconsistent, or has no lanelets and no stretch of a freeway.
    """
    tracks_file, vehicles_file, meta_file = source.files
    header = {name.lower() for name in read_header(tracks_file)}
    if missing := [name for name in LANES if name.lower() not in header]:
        raise UserError(
            f"{tracks_file}: no column {', '.join(missing)}: this is inD, rounD or uniD, whose crossings "
            "have no stretch of a "
            "freeway; only exiD can be loaded"
        )
    meta = read_columns(meta_file, {"frameRate": Kind.POSITIVE, "speedLimit": Kind.NUMBER})
    if len(meta) != 1:
        raise UserError(f"{meta_file}: {len(meta)} rows, expected the one row of a recording")
    table = read_columns(tracks_file, TRACKS | LANES)
    if table.empty:
        raise UserError(f"{tracks_file}: no vehicle: the file has a header and no rows")
    classes, on_foot = _classes(vehicles_file)
    out = table["trackId"].isin(on_foot).to_numpy()
    dropped = (Dropped("a pedestrian, bicycle or animal", int(out.sum())),) if out.any() else ()
    table = table[~out].reset_index(drop=False)
    if unknown := sorted(set(table["trackId"].astype(int)) - set(classes)):
        raise UserError(f"{vehicles_file}: no row for vehicle {unknown[0]}, which the tracks have")
    tracks, place = _tracks(tracks_file, table)
    lanelet, width, offset = (_first(table[name]) for name in LANES)
    known = lanelet != NO_LANELET
    width_m, offset_m = (
        _numbers(tracks_file, name, one, known)
        for name, one in (("laneWidth", width), ("latLaneCenterOffset", offset))
    )

    def pieces(road: Tracks, rows: np.ndarray, _: object) -> list[Piece]:
        on = known[rows]
        sign = np.sign(road.vx[on])
        # Whether the offset counts to the left or to the right is not written down; lanes do not wander.
        sides = [road.y[on] + side * sign * offset_m[rows][on] for side in (1.0, -1.0)]
        centre = min(sides, key=lambda one: _wander(lanelet[rows][on], one))
        return pieces_of_ids(lanelet[rows][on], road.x[on], road.vx[on], centre, width_m[rows][on])

    limit = speed_limit(meta_file, float(meta["speedLimit"].iloc[0]))
    read = OnMap(tracks, float(meta["frameRate"].iloc[0]), classes, limit, dropped=dropped)
    return assemble_from_map(source.name, place, read, pieces)


def _tracks(path: Path, table: pd.DataFrame) -> tuple[Tracks, Place]:
    column = {name: table[name].to_numpy(dtype=np.float64) for name in TRACKS}
    frame = column["frame"].astype(np.int64)
    tracks = Tracks(
        frame=frame - frame.min(),
        vehicle=column["trackId"].astype(np.int64),
        x=column["xCenter"],
        y=column["yCenter"],
        vx=column["xVelocity"],
        vy=column["yVelocity"],
        length=column["length"],
        width=column["width"],
    )
    lines = table["index"].to_numpy()
    return tracks, Place(path, int(frame.min()), lambda row: line_of_row(path, int(lines[row]))[0])


def _classes(path: Path) -> tuple[dict[int, VehicleClass], set[int]]:
    """Return the classes of vehicles, and the ids of road users that are none."""
    table = read_columns(path, {"trackId": Kind.COUNT, "class": Kind.TEXT})
    classes: dict[int, VehicleClass] = {}
    on_foot = set()
    for track, text in zip(table["trackId"].astype(int).tolist(), table["class"], strict=True):
        kind = str(text).strip().lower()
        if kind in ON_FOOT:
            on_foot.add(track)
        elif kind not in CLASSES:
            raise UserError(
                f"{path}: vehicle {track}: class {text!r} is none of {', '.join((*CLASSES, *ON_FOOT))}"
            )
        elif classes.setdefault(track, CLASSES[kind]) is not CLASSES[kind]:
            raise UserError(f"{path}: vehicle {track} has two classes")
    return classes, on_foot


def _first(column: pd.Series) -> np.ndarray:
    """Return the first value of each cell, the lanelet that the vehicle follows, as text."""
    cells = column.fillna(NO_LANELET).str.split(";").str[0].str.strip()
    return cells.replace("", NO_LANELET).str.replace(r"\.0+$", "", regex=True).to_numpy(dtype=np.str_)


def _numbers(path: Path, name: str, cells: np.ndarray, known: np.ndarray) -> np.ndarray:
    values = pd.to_numeric(pd.Series(cells), errors="coerce").to_numpy(dtype=np.float64)
    bad = known & ~np.isfinite(values)
    if bad.any():
        row = int(np.argmax(bad))
        raise UserError(
            f"{path}: column {name}: {cells[row]!r} is not a finite number, though the row has a lanelet"
        )
    return values


def _wander(ids: np.ndarray, centre: np.ndarray) -> float:
    return float(pd.Series(centre).groupby(ids).std(ddof=0).mean())
