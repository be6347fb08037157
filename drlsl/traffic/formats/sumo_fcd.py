"""Load SUMO's floating car data (`--fcd-output`): XML, CSV and Parquet.

Positions are those of the front bumper, angles are clockwise from north in degrees. The sizes of vehicles are
not in it: they come from the vehicle types in route and additional files beside it, else from SUMO's
defaults.

Source: https://sumo.dlr.de/docs/Simulation/Output/FCDOutput.html and
https://sumo.dlr.de/docs/Definition_of_Vehicles,_Vehicle_Types,_and_Routes.html
"""

from __future__ import annotations

import csv
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

import numpy as np

from drlsl.errors import UserError
from drlsl.files import read_table
from drlsl.traffic.alignment import Axis
from drlsl.traffic.files import open_bytes, open_text, readable, readable_xml
from drlsl.traffic.formats.sumo_net import highest_limit, lanes_under, read_road
from drlsl.traffic.lane_pieces import Piece, pieces_of_ids
from drlsl.traffic.map_tracks import OnMap, assemble_from_map
from drlsl.traffic.named_rows import check_numbers, frames_of, numbered
from drlsl.traffic.plausible import Place
from drlsl.traffic.recording import Dropped, Recording, VehicleClass
from drlsl.traffic.road_beside import OPENDRIVE, is_road
from drlsl.traffic.source import Source
from drlsl.traffic.tracks import Tracks

COLUMNS: Final = ("time", "id", "x", "y", "angle", "speed", "type", "lane")

NOWHERE: Final = -1073741824.0
"""SUMO's number for a position that does not exist, as of a vehicle beside the road."""

USUAL_SIZE: Final = {
    VehicleClass.CAR: (5.0, 1.8),
    VehicleClass.TRUCK: (7.1, 2.4),
    VehicleClass.MOTORCYCLE: (2.2, 0.9),
}
"""SUMO's length and width [m] of vehicle classes passenger, truck and motorcycle."""

USUAL_WIDTH: Final = 3.2
"""SUMO's width of a lane [m]."""

CLASSES: Final = {
    "passenger": VehicleClass.CAR,
    "private": VehicleClass.CAR,
    "taxi": VehicleClass.CAR,
    "evehicle": VehicleClass.CAR,
    "delivery": VehicleClass.CAR,
    "truck": VehicleClass.TRUCK,
    "trailer": VehicleClass.TRUCK,
    "bus": VehicleClass.TRUCK,
    "coach": VehicleClass.TRUCK,
    "motorcycle": VehicleClass.MOTORCYCLE,
    "moped": VehicleClass.MOTORCYCLE,
}
"""Vehicle classes of SUMO; other ones are left out, and counted."""


def load_fcd(source: Source) -> Recording:
    """Load floating car data; lanes are those of its road, if there is a file of it, along the whole stretch.

    Without one they lie where vehicles with a lane id drive.

    Raises:
        UserError: the file is unreadable or lacks a column.
    """
    path = source.files[0]
    rows = {"SUMO FCD, XML": _xml, "SUMO FCD, CSV": _csv, "SUMO FCD, Parquet": _parquet}[source.format](path)
    if not len(rows["id"]):
        raise UserError(f"{path}: no vehicle in any time step")
    number = {name: _floats(path, name, rows[name]) for name in ("time", "x", "y", "angle", "speed")}
    types = np.asarray(rows["type"], dtype=np.str_)
    place = next(filter(is_road, source.files[1:]), None)
    known, notes = _types(source, set(types.tolist()))
    off = (number["x"] == NOWHERE) | (number["y"] == NOWHERE)
    other = np.array([known[one] is None for one in types.tolist()])
    dropped = tuple(
        Dropped(reason, int(mask.sum()))
        for reason, mask in (
            ("beside the road: SUMO's position -1073741824", off & ~other),
            ("a pedestrian, bicycle or train", other),
        )
        if mask.any()
    )
    kept = ~(off | other)
    if not kept.any():
        raise UserError(f"{path}: no vehicle on the road in any time step")
    number = {name: values[kept] for name, values in number.items()}
    check_numbers(path, np.stack([number[name] for name in ("x", "y", "speed")]))
    frame, rate = frames_of(path, number["time"])
    kinds = [known[one] for one in types[kept].tolist()]
    length, width = (np.array([kind[place] for kind in kinds if kind]) for place in (1, 2))
    heading = np.radians(90.0 - number["angle"])
    vehicle = numbered(np.asarray(rows["id"], dtype=np.str_)[kept])
    tracks = Tracks(
        frame=frame,
        vehicle=vehicle,
        x=number["x"] - length / 2 * np.cos(heading),
        y=number["y"] - length / 2 * np.sin(heading),
        vx=number["speed"] * np.cos(heading),
        vy=number["speed"] * np.sin(heading),
        length=length,
        width=width,
    )
    lane = np.asarray(rows["lane"], dtype=np.str_)[kept]
    classes = {one: kind[0] for one, kind in zip(vehicle.tolist(), kinds, strict=True) if kind}
    drawn = [] if place is None else read_road(place)
    limit = None if place is None or place.suffix == OPENDRIVE else highest_limit(drawn, set(lane.tolist()))
    read = OnMap(tracks, rate, classes, limit, USUAL_WIDTH, dropped, tuple(notes))

    def pieces(road: Tracks, order: np.ndarray, axis: Axis) -> list[Piece]:
        if place is not None:
            return lanes_under(place, drawn, road, axis)
        return pieces_of_ids(lane[order], road.x, road.vx, road.y)

    return assemble_from_map(source.name, Place(path), read, pieces)


def _xml(path: Path) -> dict[str, list[Any]]:
    rows: dict[str, list[Any]] = {name: [] for name in COLUMNS}
    time = ""
    with readable_xml(path), open_bytes(path) as file:
        for event, element in ElementTree.iterparse(file, ("start", "end")):
            if event == "start" and element.tag == "timestep":
                time = element.get("time", "")
            elif event == "end" and element.tag == "vehicle":
                rows["time"].append(time)
                for name in COLUMNS[1:]:
                    rows[name].append(element.get(name, ""))
            elif event == "end" and element.tag == "timestep":
                element.clear()
    return rows


def _csv(path: Path) -> dict[str, list[Any]]:
    rows: dict[str, list[Any]] = {name: [] for name in COLUMNS}
    names = {name: "timestep_time" if name == "time" else f"vehicle_{name}" for name in COLUMNS}
    with readable(path, csv.Error), open_text(path) as file:
        mark = ";" if ";" in file.readline() else ","
        file.seek(0)
        reader = csv.reader(file, delimiter=mark)
        header = next(reader)
        if missing := [names[name] for name in COLUMNS if names[name] not in header]:
            raise UserError(f"{path}: missing column {', '.join(missing)}; found {', '.join(header)}")
        places = {name: header.index(names[name]) for name in COLUMNS}
        for cells in reader:
            if not cells:
                continue
            if len(cells) != len(header):
                raise UserError(f"{path}:{reader.line_num}: {len(cells)} cells, expected {len(header)}")
            if cells[places["id"]]:  # a step without vehicles has a line of its own
                for name, place in places.items():
                    rows[name].append(cells[place])
    return rows


def _parquet(path: Path) -> dict[str, list[Any]]:
    table = read_table(path)
    names = {name: "timestep_time" if name == "time" else f"vehicle_{name}" for name in COLUMNS}
    if missing := [one for one in names.values() if one not in table.column_names]:
        raise UserError(f"{path}: missing column {', '.join(missing)}; found {', '.join(table.column_names)}")
    columns = {name: table.column(one).to_pylist() for name, one in names.items()}
    present = [place for place, one in enumerate(columns["id"]) if one is not None]
    return {name: [values[place] for place in present] for name, values in columns.items()}


def _floats(path: Path, name: str, cells: list[Any]) -> np.ndarray:
    try:
        values = np.array([np.nan if cell is None else cell for cell in cells], dtype=np.float64)
    except ValueError:
        bad = next(cell for cell in cells if not _is_number(cell))
        raise UserError(f"{path}: {name}: {bad!r} is not a finite number") from None
    if not np.isfinite(values).all():
        raise UserError(
            f"{path}: {name} is not a finite number in {int((~np.isfinite(values)).sum()):,} rows"
        )
    return values


def _is_number(cell: Any) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


Kind = tuple[VehicleClass, float, float]


def _types(source: Source, names: set[str]) -> tuple[dict[str, Kind | None], list[str]]:
    """Return class, length and width of the vehicle types, None for those that are no vehicles."""
    path, *beside = source.files
    defined = _defined(one for one in beside if not is_road(one))
    found: dict[str, Kind | None] = {}
    unknown = []
    for name in sorted(names):
        given = defined.get(name, {})
        if not given:
            unknown.append(name)
        sumo = given.get("vClass", next((one for one in CLASSES if one in name.lower()), "passenger"))
        kind = CLASSES.get(sumo)
        if kind is None:
            found[name] = None
            continue
        length, width = USUAL_SIZE[kind]
        found[name] = kind, _size(path, given, "length", length), _size(path, given, "width", width)
    notes = []
    if unknown:
        notes.append(
            f"sizes are SUMO's defaults for vehicle type {', '.join(unknown[:5])}, which no *.rou.xml or "
            "*.add.xml beside "
            "the file defines"
        )
    return found, notes


def _size(path: Path, given: dict[str, str], side: str, usual: float) -> float:
    """Return the length or width of a vehicle type [m]."""
    text = given.get(side)
    if text is None:
        return usual
    if not _is_number(text) or not 0 < float(text) < np.inf:
        raise UserError(f"{path}: vType {given.get('id')}: {side} {text!r}: expected metres above 0")
    return float(text)


def _defined(files: Iterable[Path]) -> dict[str, dict[str, str]]:
    """Return the attributes of the vehicle types that files define."""
    found = {}
    for one in files:
        with readable_xml(one):
            for _, element in ElementTree.iterparse(one, ("end",)):
                if element.tag == "vType":
                    found[element.get("id", "")] = dict(element.attrib)
                elif element.tag in ("vehicle", "flow", "trip"):
                    element.clear()
    return found
