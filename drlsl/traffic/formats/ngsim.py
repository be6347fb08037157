"""Load NGSIM trajectories: the 18-column text and the CSV of the data portal.

Source: Next Generation Simulation (NGSIM) Vehicle Trajectories and Supporting Data, US Department of
Transportation, https://doi.org/10.21949/1504477.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd

from drlsl.errors import UserError
from drlsl.traffic.array_kinds import Floats
from drlsl.traffic.assemble import Road, assemble
from drlsl.traffic.columns import COMMAS, Kind, Layout, line_of_row, read_columns, read_header
from drlsl.traffic.formats.ngsim_road import fit_lanes, straighten
from drlsl.traffic.plausible import (
    TOLERATED,
    Place,
    check_contradictions,
    check_rows,
    step_ratio,
    true_frames,
)
from drlsl.traffic.recording import Dropped, Recording, VehicleClass
from drlsl.traffic.slopes import slopes
from drlsl.traffic.source import Source, matching
from drlsl.traffic.tracks import Tracks, segment_starts, without_duplicates
from drlsl.traffic.words import counted

FOOT = 0.3048
"""Metres in a foot."""

FRAME_RATE = 10.0
"""Frames per second."""

SPEED_LIMIT = 65 * 1609.344 / 3600
"""Speed limit [m/s] of US-101 and I-80, 65 mph, which the tables do not give.

Source: California Vehicle Code, section 22349(a).
"""

WINDOW = 11
"""Frames (1.1 s) of the straight lines whose slopes are the velocities derived from positions.

Positions jitter by decimetres between frames, which read as 1 m/s sideways; a lane change takes several
seconds.
"""

SPEED_TOLERANCE = 2.0
"""Root mean square difference [m/s] between v_Vel and the positions above which the positions are used."""

NEW_PERIOD = 60_000
"""Jump in the time of frame 0 [ms] that separates two recording periods in one table."""

FREEWAYS = ("us-101", "i-80")
"""The sites that are freeways; the others are city streets with crossings."""

CLASSES: Mapping[int, VehicleClass] = {
    1: VehicleClass.MOTORCYCLE,
    2: VehicleClass.CAR,
    3: VehicleClass.TRUCK,
}

TEXT_LAYOUT = Layout(
    (
        "Vehicle_ID",
        "Frame_ID",
        "Total_Frames",
        "Global_Time",
        "Local_X",
        "Local_Y",
        "Global_X",
        "Global_Y",
        "v_length",
        "v_Width",
        "v_Class",
        "v_Vel",
        "v_Acc",
        "Lane_ID",
        "Preceding",
        "Following",
        "Space_Headway",
        "Time_Headway",
    )
)

COLUMNS = {
    "Vehicle_ID": Kind.COUNT,
    "Frame_ID": Kind.COUNT,
    "Global_Time": Kind.NUMBER,
    "Local_X": Kind.NUMBER,
    "Local_Y": Kind.NUMBER,
    "v_length": Kind.NUMBER,
    "v_Width": Kind.NUMBER,
    "v_Class": Kind.COUNT,
    "v_Vel": Kind.NUMBER,
    "Lane_ID": Kind.COUNT,
}


@dataclass(frozen=True, slots=True)
class Estimated:
    """Velocities [m/s] and the number of vehicles whose recorded speeds were discarded."""

    vx: Floats
    vy: Floats
    disbelieved: int


def load_ngsim(source: Source) -> Recording:
    """Load one site and period of an NGSIM table.

    Feet become metres and the front's centre the vehicle's centre. The road is straightened: y is measured
    from the road's own axis, and lanes are fitted to where the vehicles drive (see ngsim_road).

    Raises:
        UserError: the file is unreadable, or holds several sites or periods and the source chooses none.
    """
    (path,) = source.files
    layout = _layout(source)
    table, dropped = _choose_part(path, _read(path, layout), source.part)
    read, place = _tracks(path, table, layout)
    check_rows(place, read)
    read, rate, thinned = true_frames(place, read, FRAME_RATE)
    tracks, rows, repeated = without_duplicates(read)
    check_contradictions(path, len(read), repeated)
    codes, lane_ids = (table[column].to_numpy(dtype=np.int64)[rows] for column in ("v_Class", "Lane_ID"))
    y, bend = straighten(tracks, lane_ids)
    tracks = replace(tracks, y=y)
    lanes = fit_lanes(path, tracks, lane_ids, SPEED_LIMIT)
    speeds = _velocities(path, tracks, rate)
    tracks = replace(tracks, vx=speeds.vx, vy=speeds.vy)
    return assemble(
        source.name,
        place,
        tracks,
        rate,
        Road(lanes),
        _classes(path, tracks, codes),
        dropped=(*dropped, *repeated),
        notes=(*thinned, *_notes(bend, speeds)),
    )


def part_names(source: Source) -> tuple[str, ...]:
    """Return the sites and periods of a table.

    Raises:
        UserError: the file is unreadable.
    """
    (path,) = source.files
    return tuple(np.unique(ngsim_parts(path, _read(path, _layout(source)))).tolist())


def _layout(source: Source) -> Layout:
    return COMMAS if source.format == "NGSIM, CSV" else TEXT_LAYOUT


def _read(path: Path, layout: Layout) -> pd.DataFrame:
    wanted = dict(COLUMNS)
    if layout is COMMAS and "location" in {name.lower() for name in read_header(path)}:
        wanted["Location"] = Kind.TEXT
    table = read_columns(path, wanted, layout)
    if table.empty:
        raise UserError(f"{path}: no vehicle: the table has no rows")
    return table


def ngsim_parts(path: Path, table: pd.DataFrame) -> npt.NDArray[np.str_]:
    """Return the part of each row: its site, and `/2` for a second recording period there, and so on.

    The portal's table holds several sites, and periods of 15 minutes that count frames and vehicles anew; the
    time of frame 0 distinguishes them.
    """
    sites = (
        table["Location"].str.strip().str.lower() if "Location" in table else pd.Series("", index=table.index)
    )
    if sites.isna().any():
        raise UserError(f"{path}: column Location is empty in {counted(int(sites.isna().sum()), 'row')}")
    start = table["Global_Time"] - table["Frame_ID"] * (1000 / FRAME_RATE)
    parts = sites.to_numpy(dtype=np.str_).astype(object)
    for site in sites.unique():
        rows = np.flatnonzero(sites == site)
        starts = np.unique(start.to_numpy()[rows])
        period = np.concatenate([[0], np.cumsum(np.diff(starts) > NEW_PERIOD)])
        first = starts[np.searchsorted(period, np.arange(period[-1] + 1))]
        last = starts[np.searchsorted(period, np.arange(period[-1] + 1), side="right") - 1]
        if (last - first).max() > NEW_PERIOD:
            raise UserError(
                f"{path}: column Global_Time does not run with Frame_ID, 100 ms a frame: frame 0 would be "
                f"anywhere in {(last - first).max() / 1000:,.0f} s; did a spreadsheet round it?"
            )
        if period[-1]:
            parts[rows] = [
                f"{site}/{number + 1}" for number in period[np.searchsorted(starts, start.to_numpy()[rows])]
            ]
    return parts.astype(np.str_)


def _choose_part(
    path: Path, table: pd.DataFrame, part: str | None
) -> tuple[pd.DataFrame, tuple[Dropped, ...]]:
    """Return the rows of one part without impossible vehicles, and the dropped ones."""
    parts = ngsim_parts(path, table)
    present = np.unique(parts)
    if part is None and len(present) > 1:
        raise UserError(f"{path}: holds {', '.join(present)}; choose one, for example {path}#{present[0]}")
    chosen = present[0] if part is None else next(iter(matching(part, present.tolist())), None)
    if chosen is None:
        raise UserError(f"{path}: has no part {part!r}; it holds {', '.join(present) or 'one recording'}")
    site = chosen.split("/")[0]
    if site and site not in FREEWAYS:
        raise UserError(f"{path}: {site} is not a freeway; the supported sites are {', '.join(FREEWAYS)}")
    table = table[parts == chosen]
    sized = (table["v_length"] > 0) & (table["v_Width"] > 0)
    if not sized.any():
        raise UserError(f"{path}: no vehicle: every row has a length or width of 0")
    reasons = (Dropped("vehicle's length or width is not above 0", int((~sized).sum())),)
    return table[sized], tuple(item for item in reasons if item.rows)


def _tracks(path: Path, table: pd.DataFrame, layout: Layout) -> tuple[Tracks, Place]:
    """Return tracks in SI units by vehicle centres, and their place; vy is not in the table and 0 for now."""
    column = {name: table[name].to_numpy(dtype=np.float64) for name in COLUMNS}
    frame = column["Frame_ID"].astype(np.int64)
    length = column["v_length"] * FOOT
    tracks = Tracks(
        frame=frame - frame.min(),
        vehicle=column["Vehicle_ID"].astype(np.int64),
        x=column["Local_Y"] * FOOT - length / 2,
        y=column["Local_X"] * FOOT,
        vx=column["v_Vel"] * FOOT,
        vy=np.zeros(len(table)),
        length=length,
        width=column["v_Width"] * FOOT,
    )
    rows = table.index.to_numpy()
    return tracks, Place(path, int(frame.min()), lambda row: line_of_row(path, int(rows[row]), layout)[0])


def _velocities(path: Path, tracks: Tracks, rate: float) -> Estimated:
    """Return vx from v_Vel if the positions confirm it, else from positions, and vy from positions.

    v_Vel is smoother than differences of positions. In a track where the two differ by more than
    SPEED_TOLERANCE, the positions take precedence, so that each vehicle moves with its velocity.

    Raises:
        UserError: all differ by one factor, as where v_Vel is in another unit.
    """
    ratio = step_ratio(tracks, rate)
    if ratio is not None and abs(ratio - 1) > TOLERATED:
        raise UserError(
            f"{path}: positions move {ratio:.2f} times as fast as v_Vel says; expected feet, ft/s, and "
            "ten frames a second"
        )
    starts = segment_starts(tracks)
    moved_x, moved_y = (slopes(values, starts, WINDOW) * rate for values in (tracks.x, tracks.y))
    lengths = np.diff(np.append(starts, len(tracks)))
    known = np.repeat(lengths > 1, lengths)
    squares = np.add.reduceat(np.where(known, moved_x - tracks.vx, 0.0) ** 2, starts)
    disbelieved = np.sqrt(squares / lengths) > SPEED_TOLERANCE
    vx = np.where(np.repeat(disbelieved, lengths), moved_x, tracks.vx)
    vehicles = np.unique(tracks.vehicle[starts][disbelieved])
    return Estimated(vx, moved_y, len(vehicles))


def _classes(path: Path, tracks: Tracks, codes: npt.NDArray[np.int64]) -> dict[int, VehicleClass]:
    """Return each vehicle's most frequent class."""
    unknown = np.setdiff1d(codes, list(CLASSES))
    if len(unknown):
        raise UserError(f"{path}: v_Class {unknown[0]}: expected 1 (motorcycle), 2 (car) or 3 (truck)")
    vehicles, index = np.unique(tracks.vehicle, return_inverse=True)
    rows = np.zeros((len(vehicles), max(CLASSES) + 1), dtype=np.int64)
    np.add.at(rows, (index, codes), 1)
    return {
        vehicle: CLASSES[int(code)]
        for vehicle, code in zip(vehicles.tolist(), rows.argmax(axis=1), strict=True)
    }


def _notes(bend: float, speeds: Estimated) -> tuple[str, ...]:
    notes = [f"road straightened: its axis wanders by {bend:.1f} m from side to side"]
    if speeds.disbelieved == 1:
        notes.append("1 vehicle's vx from positions, which contradict v_Vel")
    elif speeds.disbelieved:
        notes.append(f"{speeds.disbelieved} vehicles' vx from positions, which contradict v_Vel")
    return tuple(notes)
