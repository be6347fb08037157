"""Load CommonRoad scenarios (XML, versions 2018b and 2020a): lanelets, and obstacles with trajectories.

Positions are centres, orientations counter-clockwise from x. Velocities are speeds along the orientation; a
state may lack one, and the vehicle's velocities are then slopes of its positions.

Source: https://commonroad.in.tum.de/documentation, XML_commonRoad_2020a; M. Althoff et al., CommonRoad, IV
2017.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final
from xml.etree import ElementTree

import numpy as np

from drlsl.errors import UserError
from drlsl.traffic.alignment import Axis
from drlsl.traffic.files import open_bytes, readable_xml
from drlsl.traffic.lane_pieces import Piece
from drlsl.traffic.map_tracks import OnMap, assemble_from_map
from drlsl.traffic.named_rows import check_numbers
from drlsl.traffic.plausible import Place
from drlsl.traffic.recording import Dropped, Recording, VehicleClass
from drlsl.traffic.slopes import slopes
from drlsl.traffic.source import Source
from drlsl.traffic.tracks import Tracks
from drlsl.traffic.words import counted

CLASSES: Final = {
    "car": VehicleClass.CAR,
    "taxi": VehicleClass.CAR,
    "priorityVehicle": VehicleClass.CAR,
    "parkedVehicle": VehicleClass.CAR,
    "unknown": VehicleClass.CAR,
    "truck": VehicleClass.TRUCK,
    "bus": VehicleClass.TRUCK,
    "motorcycle": VehicleClass.MOTORCYCLE,
}
"""Types of obstacles that are vehicles; other ones are left out, and counted."""

WINDOW: Final = 3
"""States of the straight lines whose slopes are velocities that are missing."""

TAPER: Final = 1.0
"""Range across the road [m] of a lanelet's middle, above which it is not parallel to the road."""

State = tuple[int, float, float, float, float]
"""Time step, x, y [m], orientation [rad], and speed [m/s], NaN where it is missing."""


def load_commonroad(source: Source) -> Recording:
    """Load a scenario; lanes are the lanelets that span the stretch.

    Raises:
        UserError: the file is no scenario, or holds no moving vehicle.
    """
    path = source.files[0]
    root = _root(path)
    step = _number(path, root.get("timeStepSize"), "timeStepSize")
    if step <= 0:
        raise UserError(f"{path}: timeStepSize {step:g}: expected seconds above 0")
    tracks, classes, notes, dropped = _vehicles(path, root, step)
    lanelets = [_bounds(path, one) for one in root.iter("lanelet") if one.find("leftBound") is not None]
    if not lanelets:
        raise UserError(f"{path}: no lanelet")
    read = OnMap(tracks, 1 / step, classes, None, dropped=dropped, notes=notes)
    return assemble_from_map(
        source.name, Place(path), read, lambda road, rows, axis: [*_pieces(lanelets, axis)]
    )


def _root(path: Path) -> ElementTree.Element:
    with readable_xml(path), open_bytes(path) as file:
        return ElementTree.parse(file).getroot()


def _vehicles(
    path: Path, root: ElementTree.Element, step: float
) -> tuple[Tracks, dict[int, VehicleClass], tuple[str, ...], tuple[Dropped, ...]]:
    tracks, classes = [], {}
    derived = still = others = 0
    for obstacle in [
        *root.findall("dynamicObstacle"),
        *root.findall("staticObstacle"),
        *root.findall("obstacle"),
    ]:
        number = _whole(path, _number(path, obstacle.get("id"), "id of an obstacle"), "id of an obstacle")
        kind = CLASSES.get(obstacle.findtext("type", "unknown"))
        states = [*_states(path, obstacle, number)]
        if kind is None:
            others += len(states)
        elif len(states) < 2:
            still += len(states)
        else:
            made, missing = _track(path, obstacle, number, states, step)
            derived += missing
            tracks.append(made)
            classes[number] = kind
    if not tracks:
        raise UserError(f"{path}: no obstacle with a trajectory; occupancy sets are no recorded traffic")
    joined = Tracks(
        **{
            name: np.concatenate([getattr(one, name) for one in tracks])
            for name in Tracks.__dataclass_fields__
        }
    )
    first = int(joined.frame.min())
    joined = Tracks(
        **{**{n: getattr(joined, n) for n in Tracks.__dataclass_fields__}, "frame": joined.frame - first}
    )
    notes = []
    if derived:
        notes.append(
            f"velocities of {counted(derived, 'vehicle')} are slopes of positions: some states have none"
        )
    reasons = (
        Dropped("an obstacle that does not move", still),
        Dropped("an obstacle that is no vehicle", others),
    )
    return joined, classes, tuple(notes), tuple(item for item in reasons if item.rows)


def _states(path: Path, obstacle: ElementTree.Element, number: int) -> Iterator[State]:
    """Yield the states of an obstacle, the initial one first."""
    trajectory = obstacle.find("trajectory")
    initial = obstacle.find("initialState")
    for state in [
        *([] if initial is None else [initial]),
        *([] if trajectory is None else trajectory.findall("state")),
    ]:
        what = f"obstacle {number}"
        if state.find("position/point") is None:
            raise UserError(f"{path}: {what}: a state without a point as its position")
        x, y = (_number(path, state.findtext(f"position/point/{axis}"), f"{what}: {axis}") for axis in "xy")
        speed = state.find("velocity")
        yield (
            _whole(path, _exact(path, state.find("time"), f"{what}: time"), f"{what}: time"),
            x,
            y,
            _exact(path, state.find("orientation"), f"{what}: orientation"),
            float("nan") if speed is None else _exact(path, speed, f"{what}: velocity"),
        )


def _track(
    path: Path, obstacle: ElementTree.Element, number: int, states: list[State], step: float
) -> tuple[Tracks, bool]:
    """Return the track of an obstacle, and whether its velocities are slopes of positions."""
    box = obstacle.find("shape/rectangle")
    if box is None:
        raise UserError(f"{path}: obstacle {number}: its shape is no rectangle")
    length, width = (
        _number(path, box.findtext(side), f"obstacle {number}: {side}") for side in ("length", "width")
    )
    time, x, y, angle, speed = (np.array(column) for column in zip(*states, strict=True))
    check_numbers(path, np.stack([x, y, np.nan_to_num(speed)]))
    vx, vy = speed * np.cos(angle), speed * np.sin(angle)
    missing = not np.isfinite(speed).all()
    if missing:
        starts = np.flatnonzero(np.concatenate([[True], np.diff(time) != 1]))
        vx, vy = (slopes(values, starts, WINDOW) / step for values in (x, y))
    if not (length > 0 and width > 0):
        raise UserError(
            f"{path}: obstacle {number}: length {length:g}, width {width:g}: expected more than 0"
        )
    count = len(states)
    return (
        Tracks(
            frame=time.astype(np.int64),
            vehicle=np.full(count, number, dtype=np.int64),
            x=x,
            y=y,
            vx=vx,
            vy=vy,
            length=np.full(count, length),
            width=np.full(count, width),
        ),
        missing,
    )


def _exact(path: Path, element: ElementTree.Element | None, what: str) -> float:
    """Return the exact value of an element; an interval is no measurement."""
    if element is None or element.find("exact") is None:
        raise UserError(f"{path}: {what}: expected an exact value")
    return _number(path, element.findtext("exact"), what)


def _whole(path: Path, value: float, what: str) -> int:
    if not 0 <= value < 2**31 or value != int(value):
        raise UserError(f"{path}: {what}: {value:g}: expected a whole number from 0 to 2,147,483,647")
    return int(value)


def _number(path: Path, text: str | None, what: str) -> float:
    try:
        value = float(text or "")
    except ValueError:
        raise UserError(f"{path}: {what}: {text!r} is not a finite number") from None
    if not np.isfinite(value):
        raise UserError(f"{path}: {what}: {text!r} is not a finite number")
    return value


def _bounds(path: Path, lanelet: ElementTree.Element) -> tuple[np.ndarray, np.ndarray]:
    """Return the left and the right bound of a lanelet, points of shape (n, 2)."""
    sides = []
    for name in ("leftBound", "rightBound"):
        points = lanelet.findall(f"{name}/point")
        sides.append(
            np.array(
                [
                    [_number(path, one.findtext(axis), f"lanelet {lanelet.get('id')}") for axis in "xy"]
                    for one in points
                ]
            )
        )
    if len(sides[0]) != len(sides[1]) or len(sides[0]) < 2:
        raise UserError(
            f"{path}: lanelet {lanelet.get('id')}: its bounds need the same number of points, at least two"
        )
    return sides[0], sides[1]


def _pieces(lanelets: list[tuple[np.ndarray, np.ndarray]], axis: Axis) -> Iterator[Piece]:
    for left, right in lanelets:
        (x_left, y_left, _), (x_right, y_right, _) = (axis.on_road(*side.T) for side in (left, right))
        x, y = (x_left + x_right) / 2, (y_left + y_right) / 2
        if np.ptp(y) <= TAPER:
            yield Piece(
                sign=1 if x[-1] > x[0] else -1,
                begin=float(x.min()),
                end=float(x.max()),
                centre=float(np.median(y)),
                width=float(np.median(np.abs(y_left - y_right))),
            )
