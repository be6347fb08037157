"""Load TGSIM, the Third Generation Simulation data of FHWA: I-294, I-395, I-90/94.

Metres, m/s, positions of the vehicle's centre on an image, y downward. The sites spell the columns
differently (`lane_kf`, `lane-kf`, `ID`).

Source: Third Generation Simulation Data (TGSIM), US Department of Transportation, data.transportation.gov;
R. Ammourah et al., Introduction to the Third Generation Simulation Dataset, TRR 2025.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd

from drlsl.errors import UserError
from drlsl.traffic.columns import Kind, line_of_row, read_columns, read_header
from drlsl.traffic.lane_pieces import pieces_of_ids
from drlsl.traffic.map_tracks import OnMap, assemble_from_map
from drlsl.traffic.named_rows import check_numbers, frames_of
from drlsl.traffic.plausible import Place
from drlsl.traffic.recording import Dropped, Recording, VehicleClass
from drlsl.traffic.slopes import slopes
from drlsl.traffic.source import Source, matching
from drlsl.traffic.tracks import Tracks

WANTED: Final = {
    "id": Kind.COUNT,
    "time": Kind.NUMBER,
    "xlockf": Kind.NUMBER,
    "ylockf": Kind.NUMBER,
    "lanekf": Kind.NUMBER,
    "speedkf": Kind.NUMBER,
    "lengthsmoothed": Kind.NUMBER,
    "widthsmoothed": Kind.NUMBER,
    "typemostcommon": Kind.TEXT,
}
"""Columns, as they are called without case, `-` and `_`."""

RUN: Final = "runindex"

LIMIT: Final = 55 * 1609.344 / 3600
"""Speed limit [m/s] of these urban expressways, 55 mph, which the tables do not give.

Source: Illinois Vehicle Code, 625 ILCS 5/11-601.
"""

WORDS: Final = {
    "small": VehicleClass.CAR,
    "car": VehicleClass.CAR,
    "automated": VehicleClass.CAR,
    "large": VehicleClass.TRUCK,
    "truck": VehicleClass.TRUCK,
    "bus": VehicleClass.TRUCK,
    "motorcycle": VehicleClass.MOTORCYCLE,
}
"""Words in the names of vehicle types, and their classes."""

WINDOW: Final = 5
"""Frames of the straight lines whose slopes are the directions of the vehicles."""


def is_tgsim(columns: set[str]) -> bool:
    """Return whether a table with these columns, spelt without punctuation, is one of TGSIM."""
    return "xlockf" in columns and "lanekf" in columns


def part_names(source: Source) -> tuple[str, ...]:
    """Return the runs of a table, none if it has no column of runs.

    Raises:
        UserError: the file is unreadable.
    """
    path = source.files[0]
    names = _spellings(path)
    if RUN not in names:
        return ()
    table = read_columns(path, {names[RUN]: Kind.TEXT})
    return tuple(sorted(table[names[RUN]].astype(str).unique()))


def load_tgsim(source: Source) -> Recording:
    """Load one run; lanes lie where the vehicles of a lane id drive along the whole stretch.

    Raises:
        UserError: the file is unreadable, or holds several runs and the source chooses none.
    """
    path = source.files[0]
    names = _spellings(path)
    missing = [
        name for name in WANTED if name not in names and not (name == "speedkf" and "speedkfx" in names)
    ]
    if missing:
        raise UserError(f"{path}: missing column {', '.join(missing)}; found {', '.join(names.values())}")
    wanted = {names[name]: kind for name, kind in WANTED.items() if name in names}
    table = read_columns(path, wanted | ({names[RUN]: Kind.TEXT} if RUN in names else {}))
    table = table.rename(columns={spelt: name for name, spelt in names.items()})
    if RUN in table and table[RUN].isna().any():
        raise UserError(f"{path}: column {names[RUN]} is empty in {int(table[RUN].isna().sum()):,} rows")
    table = _run(path, table, source.part)
    sized = (table["lengthsmoothed"] > 0) & (table["widthsmoothed"] > 0)
    if not sized.any():
        raise UserError(f"{path}: no vehicle: every row has a length or width of 0")
    dropped = Dropped("vehicle's length or width is not above 0", int((~sized).sum()))
    table = table[sized]
    tracks, place, rate = _tracks(path, table)
    lane = table["lanekf"].to_numpy()
    read = OnMap(tracks, rate, _classes(path, table), LIMIT, dropped=(dropped,) if dropped.rows else ())
    on_lane = lane >= 1  # other numbers are no lane
    return assemble_from_map(
        source.name,
        place,
        read,
        lambda road, rows, _: pieces_of_ids(
            lane[rows][on_lane[rows]], *(one[on_lane[rows]] for one in (road.x, road.vx, road.y))
        ),
    )


def _spellings(path: Path) -> dict[str, str]:
    return {re.sub(r"[-_ ]", "", name.lower()): name for name in read_header(path)}


def _run(path: Path, table: pd.DataFrame, part: str | None) -> pd.DataFrame:
    if RUN not in table:
        return table
    runs = sorted(table[RUN].astype(str).unique())
    if part is None and len(runs) > 1:
        raise UserError(f"{path}: holds runs {', '.join(runs)}; choose one, for example {path}#{runs[0]}")
    chosen = runs if part is None else matching(part, runs)
    if not chosen:
        raise UserError(f"{path}: has no run {part!r}; it holds {', '.join(runs)}")
    return table[table[RUN].astype(str) == chosen[0]]


def _tracks(path: Path, table: pd.DataFrame) -> tuple[Tracks, Place, float]:
    """Return tracks on a map, y upward. Speeds are the table's, their directions those of the positions."""
    column = {
        name: table[name].to_numpy(dtype=np.float64)
        for name in WANTED
        if name in table and name != "typemostcommon"
    }
    check_numbers(path, np.stack([column["xlockf"], column["ylockf"]]))
    frame, rate = frames_of(path, column["time"])
    vehicle = column["id"].astype(np.int64)
    x, y = column["xlockf"], -column["ylockf"]
    order = np.lexsort((frame, vehicle))
    new = np.ones(len(order), dtype=np.bool_)
    new[1:] = (np.diff(vehicle[order]) != 0) | (np.diff(frame[order]) != 1)
    starts = np.flatnonzero(new)
    vx, vy = np.empty(len(order)), np.empty(len(order))
    vx[order], vy[order] = (slopes(values[order], starts, WINDOW) * rate for values in (x, y))
    if "speedkf" in column:
        moved = np.hypot(vx, vy)
        factor = np.divide(column["speedkf"], moved, out=np.ones(len(moved)), where=moved > 0.5)
        vx, vy = vx * factor, vy * factor
    tracks = Tracks(
        frame=frame, vehicle=vehicle, x=x, y=y, vx=vx, vy=vy,
        length=column["lengthsmoothed"], width=column["widthsmoothed"],
    )  # fmt: skip
    lines = table.index.to_numpy()
    return tracks, Place(path, 0, lambda row: line_of_row(path, int(lines[row]))[0]), rate


def _classes(path: Path, table: pd.DataFrame) -> dict[int, VehicleClass]:
    classes = {}
    for vehicle, text in zip(
        table["id"].astype(int).tolist(), table["typemostcommon"].astype(str), strict=True
    ):
        if vehicle not in classes:
            kind = next((WORDS[word] for word in WORDS if word in text.lower()), None)
            if kind is None:
                raise UserError(
                    f"{path}: vehicle {vehicle}: type {text!r}: expected a name with one of "
                    f"{', '.join(WORDS)}"
                )
            classes[vehicle] = kind
    return classes
