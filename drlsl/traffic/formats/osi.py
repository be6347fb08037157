"""Load ASAM OSI traces: .mcap, as of omega-prime, and .osi, of GroundTruth messages (extra `osi`).

Positions are those of the boxes' centres, velocities of the world's frame. A field that was never set reads
as 0.0 in Protobuf; it is asked whether it was set, and velocities that were not are slopes of positions.

Source: ASAM OSI 3, osi_object.proto and osi_lane.proto; https://github.com/OpenSimulationInterface.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np

from drlsl.errors import UserError
from drlsl.files import needed
from drlsl.traffic.alignment import Axis
from drlsl.traffic.formats.sumo_net import lanes_under, read_road
from drlsl.traffic.lane_pieces import Piece, pieces_of_ids
from drlsl.traffic.map_tracks import OnMap, assemble_from_map
from drlsl.traffic.named_rows import check_numbers, frames_of
from drlsl.traffic.plausible import Place
from drlsl.traffic.recording import Dropped, Recording, VehicleClass
from drlsl.traffic.slopes import slopes
from drlsl.traffic.source import Source
from drlsl.traffic.tracks import Tracks
from drlsl.traffic.words import counted

TRUCKS: Final = ("HEAVY_TRUCK", "SEMITRACTOR", "SEMITRAILER", "TRAILER", "BUS", "WORK_MACHINE")
ON_RAILS: Final = ("BICYCLE", "TRAM", "TRAIN", "WHEELCHAIR", "STANDUP_SCOOTER", "MICROMOBILITY_DEVICE")
"""Types that are no vehicles of a freeway: they are left out, and counted."""

DRIVING: Final = "DRIVING"

WINDOW: Final = 5
"""Frames of the straight lines whose slopes are velocities that were not set."""

TAPER: Final = 1.0
"""Range across the road [m] of a lane's border, above which it is not parallel to the road."""


def load_osi(source: Source) -> Recording:
    """Load a trace; lanes lie between their boundaries, as a road beside the file says, or by assignment.

    The last are where vehicles that are assigned to a lane drive.

    Raises:
        UserError: the extra is not installed, or the file is no trace of GroundTruth messages.
    """
    path = source.files[0]
    lines: dict[int, np.ndarray] = {}
    lanes: dict[int, tuple[list[int], list[int]]] = {}
    rows: list[tuple[float, ...]] = []
    classes: dict[int, VehicleClass] = {}
    others = 0
    for message in _messages(path):
        for line in message.lane_boundary:
            points = [(point.position.x, point.position.y) for point in line.boundary_line]
            lines.setdefault(line.id.value, np.array(points))
        for lane in message.lane:
            kind = lane.classification
            if kind is not None and kind.type.name == DRIVING:
                sides = (kind.left_lane_boundary_id, kind.right_lane_boundary_id)
                lanes.setdefault(lane.id.value, tuple([one.value for one in side] for side in sides))  # type: ignore[arg-type]
        time = message.timestamp.seconds + message.timestamp.nanos / 1e9
        for item in message.moving_object:
            kind_of = _class(item)
            if kind_of is None:
                others += 1
                continue
            classes.setdefault(item.id.value, kind_of)
            rows.append(_row(path, time, item))
    if not rows:
        raise UserError(f"{path}: no vehicle in any GroundTruth message")
    table = np.array(rows)
    tracks, rate, derived = _tracks(path, table)
    notes = (f"velocities of {counted(derived, 'vehicle')} are slopes of positions: they were not set",)
    read = OnMap(
        tracks,
        rate,
        classes,
        None,
        dropped=(Dropped("a pedestrian, animal, bicycle or train", others),) if others else (),
        notes=notes if derived else (),
    )
    assigned = table[:, 8]

    def pieces(road: Tracks, order: np.ndarray, axis: Axis) -> list[Piece]:
        given = [*_pieces(lines, lanes, axis)]
        if not given and len(source.files) > 1:
            return lanes_under(source.files[1], read_road(source.files[1]), road, axis)
        on = assigned[order] >= 0
        return given or pieces_of_ids(assigned[order][on], road.x[on], road.vx[on], road.y[on])

    return assemble_from_map(source.name, Place(path), read, pieces)


def _messages(path: Path) -> Iterator[Any]:
    with needed("OSI traces", "betterosi", "osi"):
        import betterosi
    kind = {"osi_message_type": "GroundTruth"} if path.suffix == ".osi" else {"return_ground_truth": True}
    try:
        yield from betterosi.read(str(path), **kind)
    except UserError:
        raise
    except Exception as error:
        why = (str(error) or type(error).__name__).splitlines()[0]
        raise UserError(f"{path}: cannot be read: {why}") from error


def _class(item: Any) -> VehicleClass | None:
    """Return the class of a moving object, None if it is no vehicle."""
    if item.type.name in ("PEDESTRIAN", "ANIMAL"):
        return None
    kind = item.vehicle_classification
    name = "UNKNOWN" if kind is None else kind.type.name
    if name in ON_RAILS:
        return None
    if name in TRUCKS:
        return VehicleClass.TRUCK
    return VehicleClass.MOTORCYCLE if name == "MOTORBIKE" else VehicleClass.CAR


def _row(path: Path, time: float, item: Any) -> tuple[float, ...]:
    """Return time, id, x, y, vx, vy, length, width and the assigned lane, NaN and -1 for what was not set."""
    base = item.base
    where = f"{path}: object {item.id.value} at {time:g} s"
    for part, names in (("position", "xy"), ("dimension", ("length", "width"))):
        given = None if base is None else getattr(base, part)
        if given is None or not all(given.has_field(name) for name in names):
            raise UserError(f"{where}: {part} was not set")
    velocity = base.velocity
    known = velocity is not None and velocity.has_field("x") and velocity.has_field("y")
    vx, vy = (velocity.x, velocity.y) if known else (np.nan, np.nan)
    size = base.dimension
    if size.length <= 0 or size.width <= 0:
        raise UserError(f"{where}: length {size.length:g}, width {size.width:g}: expected more than 0")
    lane = item.assigned_lane_id[0].value if item.assigned_lane_id else -1
    place = base.position
    return (time, item.id.value, place.x, place.y, vx, vy, size.length, size.width, lane)


def _tracks(path: Path, table: np.ndarray) -> tuple[Tracks, float, int]:
    """Return the tracks, the frame rate, and the number of vehicles whose velocities are slopes."""
    check_numbers(path, table[:, 2:4])
    frame, rate = frames_of(path, table[:, 0])
    vehicle, x, y, vx, vy, length, width = table[:, 1:8].T
    unset = np.isin(vehicle, np.unique(vehicle[np.isnan(vx) | np.isnan(vy)]))
    if unset.any():
        order = np.lexsort((frame, vehicle))
        new = np.ones(len(order), dtype=np.bool_)
        new[1:] = (np.diff(vehicle[order]) != 0) | (np.diff(frame[order]) != 1)
        starts = np.flatnonzero(new)
        for speed, values in ((vx, x), (vy, y)):
            slope = np.empty(len(order))
            slope[order] = slopes(values[order], starts, WINDOW) * rate
            speed[unset] = slope[unset]
    tracks = Tracks(
        frame=frame, vehicle=vehicle.astype(np.int64), x=x, y=y, vx=vx, vy=vy, length=length, width=width
    )
    return tracks, rate, len(np.unique(vehicle[unset]))


def _pieces(
    lines: dict[int, np.ndarray], lanes: dict[int, tuple[list[int], list[int]]], axis: Axis
) -> Iterator[Piece]:
    for sides in lanes.values():
        points = [[lines[one] for one in side if one in lines and len(lines[one])] for side in sides]
        if not all(points):
            continue
        (x_left, y_left, _), (_, y_right, _) = (axis.on_road(*np.concatenate(side).T) for side in points)
        if max(np.ptp(y_left), np.ptp(y_right)) <= TAPER:
            left, right = float(np.median(y_left)), float(np.median(y_right))
            # To the right of traffic from left to right y is larger.
            yield Piece(
                1 if right > left else -1,
                float(x_left.min()),
                float(x_left.max()),
                (left + right) / 2,
                abs(right - left),
            )
