"""Lanes of a road from its own file: SUMO's networks (.net.xml), and OpenDRIVE (.xodr) through netconvert.

Netconvert is part of SUMO (extra `sumo`). Lane widths and centre lines are read; the lanes of the edges under
the vehicles are the road, whatever else a network has. Speed limits are taken from networks alone: netconvert
gives lanes of an OpenDRIVE road that state none one of its own making.

Source: https://sumo.dlr.de/docs/Networks/SUMO_Road_Networks.html and
https://sumo.dlr.de/docs/Networks/Import/OpenDRIVE.html
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from xml.etree import ElementTree

import numpy as np

from drlsl.errors import UserError
from drlsl.traffic.alignment import Axis
from drlsl.traffic.array_kinds import Floats
from drlsl.traffic.files import open_bytes, readable, readable_xml
from drlsl.traffic.lane_pieces import WANDER, Piece
from drlsl.traffic.road_beside import OPENDRIVE
from drlsl.traffic.tracks import Tracks

STEP: Final = 2.0
"""Distance between points of a lane's centre line [m]."""

USUAL_WIDTH: Final = 3.2
"""SUMO's width of a lane that states none [m]."""

LONGEST: Final = 300
"""Seconds in which a road must be converted."""


@dataclass(frozen=True, slots=True, eq=False)
class NetLane:
    """A lane for cars: its edge, its id, its width [m], speed limit [m/s] and centre line (n, 2)."""

    edge: str
    id: str
    width: float
    speed: float
    line: Floats


def read_road(path: Path) -> list[NetLane]:
    """Return the lanes for cars of a network or of an OpenDRIVE road.

    Raises:
        UserError: the file cannot be read, netconvert is missing or refuses it, or it has no such lane.
    """
    if path.suffix == OPENDRIVE:
        with tempfile.TemporaryDirectory(prefix="drlsl-road-") as folder:
            lanes = list(_lanes(_converted(path, Path(folder)), path))
    else:
        lanes = list(_lanes(path, path))
    if not lanes:
        raise UserError(f"{path}: no lane for cars in this road")
    return lanes


def _converted(path: Path, folder: Path) -> Path:
    """Return an OpenDRIVE road as a network in a folder, with its own coordinates."""
    netconvert = _netconvert(path)
    with readable(path), open_bytes(path) as source, open(folder / "road.xodr", "wb") as copy:
        shutil.copyfileobj(source, copy)
    command = [str(netconvert), "--opendrive-files", "road.xodr", "-o", "road.net.xml", "--precision", "6"]
    command += [
        "--offset.disable-normalization",
        "true",
        "--no-internal-links",
        "true",
        "--no-warnings",
        "true",
    ]
    try:
        done = subprocess.run(
            [*command, "--xml-validation", "never"],
            cwd=folder,
            capture_output=True,
            text=True,
            errors="replace",
            check=False,
            timeout=LONGEST,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise UserError(f"{path}: netconvert cannot convert this road: {error}") from error
    network = folder / "road.net.xml"
    if done.returncode or not network.is_file():
        lines = [line for line in done.stderr.splitlines() if line.strip()] or ["no message"]
        raise UserError(f"{path}: netconvert cannot convert this road: {lines[0].removeprefix('Error: ')}")
    return network


def _netconvert(path: Path) -> Path:
    found = shutil.which("netconvert")
    if found is not None:
        return Path(found)
    try:
        import sumo
    except ImportError as error:
        raise UserError(
            f"{path}: OpenDRIVE roads are read through SUMO's netconvert, which is neither on the PATH nor "
            "installed; install it with: pip install 'drlsl[sumo]', or move the road's file away"
        ) from error
    return Path(sumo.SUMO_HOME) / "bin" / "netconvert"


def _lanes(network: Path, path: Path) -> Iterator[NetLane]:
    """Yield the lanes for cars of a network; errors name `path`."""
    with readable_xml(path), open_bytes(network) as file:
        for _, edge in ElementTree.iterparse(file, ("end",)):
            if edge.tag == "edge":
                if edge.get("function", "normal") == "normal":
                    yield from (_lane(path, edge, lane) for lane in edge.iter("lane") if _for_cars(lane))
                edge.clear()


def _for_cars(lane: ElementTree.Element) -> bool:
    allowed, refused = lane.get("allow"), lane.get("disallow", "").split()
    return not {"passenger", "all"} & set(refused) and (allowed is None or "passenger" in allowed.split())


def _lane(path: Path, edge: ElementTree.Element, lane: ElementTree.Element) -> NetLane:
    try:
        line = np.array([point.split(",")[:2] for point in lane.get("shape", "").split()], dtype=np.float64)
        width, speed = float(lane.get("width", USUAL_WIDTH)), float(lane.get("speed", "nan"))
    except ValueError:
        raise UserError(f"{path}: lane {lane.get('id')}: its width, speed or shape is no number") from None
    if line.ndim != 2 or len(line) < 2 or not np.isfinite([*line.ravel(), width, speed]).all() or width <= 0:
        raise UserError(
            f"{path}: lane {lane.get('id')}: expected a width, a speed, and a shape of two points"
        )
    return NetLane(edge.get("id", ""), lane.get("id", ""), width, speed, line)


def highest_limit(lanes: Sequence[NetLane], ids: Collection[str]) -> float | None:
    """Return the highest speed limit of lanes by their ids [m/s], None if there is none of them."""
    return max((lane.speed for lane in lanes if lane.id in ids), default=None)


def lanes_under(path: Path, lanes: Sequence[NetLane], tracks: Tracks, axis: Axis) -> list[Piece]:
    """Return pieces of the lanes of all edges that vehicles drive on.

    Raises:
        UserError: the vehicles drive beside this road.
    """
    low, high = float(tracks.x.min()), float(tracks.x.max())
    pieces = [(lane, _piece(lane, axis, low, high)) for lane in lanes]
    along = [(lane, piece) for lane, piece in pieces if piece is not None]
    used = {lane.edge for lane, piece in along if _carries(piece, tracks)}
    kept = [piece for lane, piece in along if lane.edge in used]
    if not kept:
        raise UserError(
            f"{path}: no lane of this road lies under the vehicles; its coordinates must be theirs. Move the "
            "file away to have the lanes laid where the vehicles drive"
        )
    return kept


def _piece(lane: NetLane, axis: Axis, low: float, high: float) -> Piece | None:
    """Return a lane's piece between two x along the road; None if it is elsewhere, or runs across."""
    x, y, _ = axis.on_road(*_dense(lane.line).T)
    inside = (x >= low) & (x <= high)
    if inside.sum() < 2 or np.ptp(y[inside]) > WANDER:
        return None
    x, y = x[inside], y[inside]
    ahead = x[-1] - x[0]
    if abs(ahead) < STEP:
        return None
    return Piece(1 if ahead > 0 else -1, float(x.min()), float(x.max()), float(np.median(y)), lane.width)


def _dense(line: Floats) -> Floats:
    """Return the points of a polyline, and points between them, `STEP` apart at most."""
    steps = np.hypot(*np.diff(line, axis=0).T)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    parts = [
        np.linspace(way[at], way[at + 1], max(2, int(step // STEP) + 2))[:-1] for at, step in enumerate(steps)
    ]
    places = np.concatenate([*parts, way[-1:]])
    return np.stack([np.interp(places, way, column) for column in line.T], axis=1)


def _carries(piece: Piece, tracks: Tracks) -> bool:
    """Return whether a vehicle drives along on a piece."""
    on = (tracks.x >= piece.begin) & (tracks.x <= piece.end)
    on &= (np.abs(tracks.y - piece.centre) <= piece.width / 2) & (piece.sign * tracks.vx > 0)
    return bool(on.any())
