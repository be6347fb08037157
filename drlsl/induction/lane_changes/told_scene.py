"""Scenes of recordings in the words of a table: lanes from the right, offsets, few vehicles."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

from drlsl.assurance import EgoRow, LaneRow, RoadRow, Staging, VehicleRow
from drlsl.driving.scene import Scene, Vehicle
from drlsl.traffic import Direction, Lane

Keeps = Callable[[Staging], bool]
"""Returns whether a scene still shows what it is there to show."""


def staged(scene: Scene) -> Staging | None:
    """Return a scene as a table tells it, without oncoming lanes; None if the ego is not in a lane."""
    own = scene.road.lane(scene.ego.lane)
    if own is None:
        return None
    direction = own.direction
    lanes = sorted(
        (lane for lane in scene.road.lanes if lane.direction is direction),
        key=lambda lane: -direction.sign * lane.centre,
    )
    road = RoadRow(
        lanes=[LaneRow(width=_short(one.width), speed_limit=_short(one.speed_limit)) for one in lanes],
        time_step=scene.road.time_step,
        radar_range=scene.road.radar_range,
    )
    ego = EgoRow(
        lane=lanes.index(own) + 1,
        speed=_short(direction.sign * scene.ego.vx),
        **_box(scene.ego, own, direction),  # type: ignore[arg-type]
    )
    vehicles = {
        f"car{number}": _told(car, scene.ego, lanes, direction)
        for number, car in enumerate(
            (car for car in scene.in_range() if _lane_of(car, lanes) is not None), start=1
        )
    }
    return Staging(road, ego, vehicles, direction)


def _lane_of(car: Vehicle, lanes: list[Lane]) -> Lane | None:
    return next((lane for lane in lanes if abs(car.y - lane.centre) <= lane.width / 2), None)


def _told(car: Vehicle, ego: Vehicle, lanes: list[Lane], direction: Direction) -> VehicleRow:
    lane = _lane_of(car, lanes)
    assert lane is not None
    return VehicleRow(
        lane=lanes.index(lane) + 1,
        offset=_short(direction.sign * (car.x - ego.x)),
        speed=_short(direction.sign * car.vx),
        **_box(car, lane, direction),
    )


def _box(car: Vehicle, lane: Lane, direction: Direction) -> dict[str, float]:
    return {
        "shift": _short(direction.sign * (lane.centre - car.y)),
        "drift": _short(-direction.sign * car.vy),
        "length": _short(car.length),
        "width": _short(car.width),
    }


def _short(value: float, digits: int = 2) -> float:
    return round(value, digits) + 0.0


def simplified(scene: Staging, keeps: Keeps) -> Staging:
    """Return the simplest scene that `keeps` accepts: few vehicles, of usual sizes, with round numbers."""
    for name in list(scene.vehicles):
        fewer = {other: car for other, car in scene.vehicles.items() if other != name}
        scene = _if_kept(scene, replace(scene, vehicles=fewer), keeps)
    lanes = len(scene.road.lanes) if isinstance(scene.road.lanes, list) else scene.road.lanes
    scene = _if_kept(scene, replace(scene, road=RoadRow(lanes=lanes)), keeps)
    for usual in (
        {"shift": 0.0, "drift": 0.0},
        {"length": EgoRow().length},
        {"width": EgoRow().width},
    ):
        scene = _if_kept(scene, replace(scene, ego=scene.ego.model_copy(update=usual)), keeps)
        for name, car in scene.vehicles.items():
            scene = _if_kept(scene, _with(scene, name, car.model_copy(update=usual)), keeps)
    for digits in (0, 1):
        ego = scene.ego.model_copy(update={"speed": _short(scene.ego.speed, digits)})
        scene = _if_kept(scene, replace(scene, ego=ego), keeps)
        for name in scene.vehicles:
            for field in ("speed", "offset"):
                car = scene.vehicles[name]
                rounded = {field: _short(getattr(car, field), digits)}
                scene = _if_kept(scene, _with(scene, name, car.model_copy(update=rounded)), keeps)
    return _named(scene)


def _if_kept(scene: Staging, other: Staging, keeps: Keeps) -> Staging:
    return other if keeps(other) else scene


def _with(scene: Staging, name: str, car: VehicleRow) -> Staging:
    return replace(scene, vehicles={**scene.vehicles, name: car})


def _named(scene: Staging) -> Staging:
    """Return the scene with its vehicles called a, b, c … in their order."""
    names = "abcdefghijklmnopqrstuvwxyz"
    if len(scene.vehicles) > len(names):
        return scene
    return replace(scene, vehicles=dict(zip(names, scene.vehicles.values(), strict=False)))


def moves(scene: Staging, metres: float) -> Iterator[Staging]:
    """Yield the scene with each vehicle in turn so far ahead, and so far back."""
    for name, car in scene.vehicles.items():
        for sign in (1.0, -1.0):
            assert car.offset is not None
            moved = car.model_copy(update={"offset": _short(car.offset + sign * metres)})
            yield _with(scene, name, moved)


def accelerations(scene: Staging, speed: float) -> Iterator[Staging]:
    """Yield the scene with each vehicle in turn so much faster, and so much slower [m/s]."""
    for name, car in scene.vehicles.items():
        for sign in (1.0, -1.0):
            assert car.speed is not None
            yield _with(scene, name, car.model_copy(update={"speed": _short(car.speed + sign * speed)}))


def faster(scene: Staging, speed: float) -> Staging:
    """Return the scene with everyone so much faster [m/s]."""
    cars = {
        name: car.model_copy(update={"speed": _short((car.speed or 0.0) + speed)})
        for name, car in scene.vehicles.items()
    }
    ego = scene.ego.model_copy(update={"speed": _short(scene.ego.speed + speed)})
    return replace(scene, ego=ego, vehicles=cars)
