"""Load AUTOMATUM data sets: a folder with dynamicWorld.json and staticWorld.xodr.

Metres in a local frame, centres, velocities of the world's frame (`vx_vec_world`) or, where these are
missing, of the vehicle's. Lanes lie where the vehicles of a lane id drive; their widths are those of the
xodr file.

Source: openautomatumdronedata 0.5.0, documentation of its fields; https://automatum-data.com.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from drlsl.errors import UserError
from drlsl.traffic.files import read_json, readable_xml
from drlsl.traffic.lane_pieces import pieces_of_ids
from drlsl.traffic.map_tracks import OnMap, assemble_from_map
from drlsl.traffic.named_rows import check_numbers, frames_of, numbered
from drlsl.traffic.plausible import Place
from drlsl.traffic.recording import Dropped, Recording, VehicleClass
from drlsl.traffic.source import Source
from drlsl.traffic.tracks import Tracks

CLASSES: Final = {
    "car": VehicleClass.CAR,
    "van": VehicleClass.CAR,
    "carWithTrailer": VehicleClass.CAR,
    "truck": VehicleClass.TRUCK,
    "bus": VehicleClass.TRUCK,
    "motorcycle": VehicleClass.MOTORCYCLE,
}
"""Types of objects that are vehicles; other ones are left out, and counted."""

NO_LANE: Final = 0
"""Lane id of a place that is not on a road."""

VECTORS: Final = ("time", "x_vec", "y_vec", "psi_vec", "lane_id_vec", "road_id_vec")


def load_automatum(source: Source) -> Recording:
    """Load one recording.

    Raises:
        UserError: the file is unreadable, or an object lacks a vector.
    """
    path = source.files[0]
    objects = _objects(path)
    others = [one for one in objects if one.get("objType") not in CLASSES]
    vehicles = [one for one in objects if one.get("objType") in CLASSES]
    if not vehicles:
        raise UserError(f"{path}: no vehicle among {len(objects)} objects")
    columns = [_columns(path, one) for one in vehicles]
    joined = {name: np.concatenate([one[name] for one in columns]) for name in columns[0]}
    count = [len(one["time"]) for one in columns]
    check_numbers(path, np.stack([joined[name] for name in ("x", "y", "vx", "vy")]))
    frame, rate = frames_of(path, joined["time"])
    ids = numbered(np.array([str(one["UUID"]) for one in vehicles]))
    tracks = Tracks(
        frame=frame,
        vehicle=np.repeat(ids, count),
        **{name: joined[name] for name in ("x", "y", "vx", "vy", "length", "width")},
    )
    widths = _widths(source.files[1]) if len(source.files) > 1 else {}
    lane = np.array([f"{road:g}:{one:g}" for road, one in zip(joined["road"], joined["lane"], strict=True)])
    width = np.array([widths.get(one, np.nan) for one in lane.tolist()])
    on_lane: npt.NDArray[np.bool_] = joined["lane"] != NO_LANE
    lost = sum(len(one.get("x_vec", ())) for one in others)
    dropped = (Dropped("an object that is no vehicle", lost),) if lost else ()
    classes = {int(number): CLASSES[one["objType"]] for number, one in zip(ids, vehicles, strict=True)}
    return assemble_from_map(
        source.name,
        Place(path),
        OnMap(tracks, rate, classes, None, dropped=dropped),
        lambda road, rows, _: pieces_of_ids(
            *(one[on_lane[rows]] for one in (lane[rows], road.x, road.vx, road.y, width[rows]))
        ),
    )


def _objects(path: Path) -> list[dict[str, Any]]:
    found = read_json(path)
    objects = found.get("objects") if isinstance(found, dict) else None
    if not isinstance(objects, list) or not all(isinstance(one, dict) for one in objects):
        raise UserError(f"{path}: expected a list of objects under the key objects")
    return objects


def _columns(path: Path, one: dict[str, Any]) -> dict[str, npt.NDArray[np.float64]]:
    """Return the columns of one vehicle, velocities in the world's frame."""
    name = f"object {one.get('UUID')}"
    world = one.get("vx_vec_world") is not None
    speeds = ("vx_vec_world", "vy_vec_world") if world else ("vx_vec", "vy_vec")
    keys = (*VECTORS, *speeds, "length", "width", "UUID")
    if missing := [key for key in keys if one.get(key) is None]:
        raise UserError(f"{path}: {name} has no {', '.join(missing)}")
    try:
        vectors = {key: np.array(one[key], dtype=np.float64) for key in (*VECTORS, *speeds)}
        length, width = float(one["length"]), float(one["width"])
    except (TypeError, ValueError):
        raise UserError(f"{path}: {name} holds something that is no number") from None
    count = len(vectors["time"])
    if any(len(values) != count for values in vectors.values()):
        raise UserError(f"{path}: the vectors of {name} differ in length")
    if not all(np.isfinite(values).all() for values in vectors.values()) or not length > 0 or not width > 0:
        raise UserError(f"{path}: {name} holds a number that is not finite, or a size that is not above 0")
    vx, vy = (vectors[key] for key in speeds)
    if not world:
        cos, sin = np.cos(vectors["psi_vec"]), np.sin(vectors["psi_vec"])
        vx, vy = vx * cos - vy * sin, vx * sin + vy * cos
    return {
        "time": vectors["time"],
        "x": vectors["x_vec"],
        "y": vectors["y_vec"],
        "vx": vx,
        "vy": vy,
        "length": np.full(count, length),
        "width": np.full(count, width),
        "lane": vectors["lane_id_vec"],
        "road": vectors["road_id_vec"],
    }


def _widths(path: Path) -> dict[str, float]:
    """Return the width [m] at which each lane of an OpenDRIVE file begins, by `road:lane`."""
    with readable_xml(path):
        root = ElementTree.parse(path).getroot()
    found: dict[str, float] = {}
    for road in root.iter("road"):
        for lane in road.iter("lane"):
            width = lane.find("width")
            if width is not None:
                name = f"{road.get('id')}:{lane.get('id')}"
                try:
                    found.setdefault(name, float(width.get("a", "nan")))
                except ValueError:
                    raise UserError(f"{path}: lane {name}: width {width.get('a')!r} is no number") from None
    return found
