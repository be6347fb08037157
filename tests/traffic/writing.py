"""Write small recordings by hand, row by row, in the layouts that can be loaded."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

FOOT = 0.3048

HIGHD_TRACKS = "frame,id,x,y,width,height,xVelocity,yVelocity,laneId"
HIGHD_META = "id,frameRate,speedLimit,upperLaneMarkings,lowerLaneMarkings"
NGSIM = (
    "Vehicle_ID,Frame_ID,Total_Frames,Global_Time,Local_X,Local_Y,Global_X,Global_Y,v_length,v_Width,v_Class,"
    "v_Vel,v_Acc,Lane_ID,Preceding,Following,Space_Headway,Time_Headway"
)


@dataclass(frozen=True)
class Row:
    """One vehicle in one frame: centre, velocity and size in SI units, lane id as NGSIM writes it."""

    frame: int
    vehicle: int
    x: float
    y: float
    vx: float = 30.0
    vy: float = 0.0
    length: float = 4.5
    width: float = 1.8
    lane: int = 1


def write_highd(
    folder: Path,
    rows: Iterable[Row],
    *,
    upper: Sequence[float] = (),
    lower: Sequence[float] = (20.0, 24.0, 28.0),
    part: str = "01",
    frame_rate: float = 25.0,
    speed_limit: float = -1.0,
    trucks: Sequence[int] = (),
) -> Path:
    """A folder in highD layout; rows in the order given, nothing added."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = list(rows)
    lines = [
        f"{row.frame},{row.vehicle},{row.x - row.length / 2!r},{row.y - row.width / 2!r},{row.length!r},"
        f"{row.width!r},{row.vx!r},{row.vy!r},0"
        for row in rows
    ]
    (folder / f"{part}_tracks.csv").write_text("\n".join([HIGHD_TRACKS, *lines, ""]))
    kinds = [
        f"{number},{'Truck' if number in trucks else 'Car'}" for number in sorted({r.vehicle for r in rows})
    ]
    (folder / f"{part}_tracksMeta.csv").write_text("\n".join(["id,class", *kinds, ""]))
    marks = [";".join(map(repr, side)) for side in (upper, lower)]
    meta = f"{int(part)},{frame_rate!r},{speed_limit!r},{marks[0]},{marks[1]}"
    (folder / f"{part}_recordingMeta.csv").write_text("\n".join([HIGHD_META, meta, ""]))
    return folder


def ngsim_cells(row: Row, *, start: int = 1_118_846_980_000) -> list[str]:
    """The 18 cells of a row; `start` is the time of frame 0 [ms]."""
    front = (row.x + row.length / 2) / FOOT
    kind = 3 if row.length > 10 else 2
    cells: list[float | int] = [
        row.vehicle,
        row.frame,
        1,
        start + 100 * row.frame,
        row.y / FOOT,
        front,
        0.0,
        0.0,
    ]
    cells += [row.length / FOOT, row.width / FOOT, kind, row.vx / FOOT, 0.0, row.lane, 0, 0, 0.0, 0.0]
    return [repr(cell) for cell in cells]


def write_ngsim_text(path: Path, rows: Iterable[Row]) -> Path:
    """The 18 columns of the text layout."""
    path.write_text("".join("  ".join(ngsim_cells(row)) + "\n" for row in rows))
    return path


def write_ngsim_csv(path: Path, rows: Iterable[Row], *, header: str = NGSIM, site: str | None = None) -> Path:
    """The portal's CSV, with a column Location where a site is given."""
    tail = [] if site is None else [site]
    lines = [header + (",Location" if tail else ""), *(",".join(ngsim_cells(row) + tail) for row in rows)]
    path.write_text("\n".join([*lines, ""]))
    return path
