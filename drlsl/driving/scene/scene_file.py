"""The JSON form of a scene, for `drlsl query --state FILE`; the names of fields state their units."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from drlsl.driving.scene.model import EGO, Road, Scene, Vehicle
from drlsl.driving.scene.scene_keys import BOX, ROAD, SCENE
from drlsl.errors import UserError
from drlsl.files import parse_json, read_text
from drlsl.traffic import Direction, Lane


def load_scene(path: str | Path) -> Scene:
    """Read a scene file.

    Raises:
        UserError: the file cannot be read, is not JSON (with line and column), or is not a possible scene.
    """
    return parse_scene(read_text(path, "the scene"), str(path))


def parse_scene(text: str, name: str) -> Scene:
    """Return the scene that JSON `text` describes; `name` is its name in errors.

    Raises:
        UserError: the text is not JSON (with line and column), or not a possible scene.
    """
    data = parse_json(text, name)
    if not SCENE(data):
        from drlsl.driving.scene.scene_schema import check_scene

        check_scene(data, name)
    data = SCENE.filled(data)
    for problem in _problems(data):
        raise UserError(f"{name}: {problem}")
    return _scene(data)


def _problems(data: Mapping[str, Any]) -> Iterator[str]:
    """Yield the problems that the kinds of the values cannot express."""
    ego, vehicles = data["ego"], data["vehicles"]
    known = Counter(lane["id"] for lane in data["road"]["lanes"])
    for lane_id, times in known.items():
        if times > 1:
            yield f"road.lanes has lane {lane_id} {times} times; each lane needs an id of its own"
    listed = ", ".join(map(str, known))
    for place, lane in _named_lanes(data):
        if lane not in known:
            yield f"{place} is {lane}, a lane that the road lacks; it has {listed}"
    names = Counter(vehicle["id"] for vehicle in vehicles)
    for name, times in names.items():
        if name == EGO:
            yield f"vehicles has one called {EGO!r}; that name is the ego's own"
        if times > 1:
            yield f"vehicles has {name!r} {times} times; each vehicle needs an id of its own"
    if ego["lane"] is None and not _road(data["road"]).lane_at(ego["y_m"]):
        yield f"ego.y_m is {ego['y_m']}, which is in no lane of the road; give ego.lane or move the ego"


def _named_lanes(data: Mapping[str, Any]) -> Iterator[tuple[str, int]]:
    places = {
        "ego.lane": data["ego"]["lane"],
        "ego.target_lane": data["ego"]["target_lane"],
        **{f"vehicles[{index}].lane": vehicle["lane"] for index, vehicle in enumerate(data["vehicles"])},
    }
    yield from ((place, lane) for place, lane in places.items() if lane is not None)


def _road(data: Mapping[str, Any]) -> Road:
    lanes = sorted(map(_lane, data["lanes"]), key=lambda lane: lane.centre)
    return Road(tuple(lanes), data["time_step_s"], data["radar_range_m"])


def _lane(data: Mapping[str, Any]) -> Lane:
    return Lane(
        data["id"],
        Direction(data["direction"]),
        data["centre_m"],
        data["width_m"],
        data["speed_limit_mps"],
        data["end_m"],
    )


def _vehicle(name: str, box: Mapping[str, Any], road: Road) -> Vehicle:
    x, y, vx, vy = box["x_m"], box["y_m"], box["vx_mps"], box["vy_mps"]
    lane = road.lane_at(y) if box["lane"] is None else box["lane"]
    return Vehicle(name, lane, x, y, vx, vy, box["length_m"], box["width_m"])


def _scene(data: Mapping[str, Any]) -> Scene:
    road = _road(data["road"])
    ego = _vehicle(EGO, data["ego"], road)
    target = data["ego"]["target_lane"]
    vehicles = tuple(_vehicle(vehicle["id"], vehicle, road) for vehicle in data["vehicles"])
    return Scene(road, ego, vehicles, ego.lane if target is None else target)


def scene_defaults() -> dict[str, float]:
    """Return the numbers that a scene file may leave out, by the names of their fields."""
    keys = {**ROAD.keys, **BOX}
    return {name: key.default for name, key in keys.items() if isinstance(key.default, float)}


def scene_json(scene: Scene) -> str:
    """Return the scene file of `scene`, which `load_scene` reads back as the same scene."""
    road = scene.road
    data = {
        "road": {
            "lanes": [_lane_json(lane) for lane in road.lanes],
            "time_step_s": road.time_step,
            "radar_range_m": road.radar_range,
        },
        "ego": {**_box_json(scene.ego), "target_lane": scene.target_lane},
        "vehicles": [{"id": vehicle.id, **_box_json(vehicle)} for vehicle in scene.vehicles],
    }
    return json.dumps(data, indent=2, allow_nan=False) + "\n"


def _lane_json(lane: Lane) -> dict[str, float | int | str]:
    data = {
        "id": lane.id,
        "direction": lane.direction.value,
        "centre_m": lane.centre,
        "width_m": lane.width,
        "speed_limit_mps": lane.speed_limit,
    }
    return data if lane.end is None else {**data, "end_m": lane.end}


def write_scenes(folder: Path, scenes: Mapping[str, Scene]) -> list[Path]:
    """Write a scene file for each name into a folder, which is made; return the files.

    Raises:
        UserError: they cannot be written.
    """
    files = {folder / f"{name}.json": scene for name, scene in scenes.items()}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for path, scene in files.items():
            path.write_text(scene_json(scene), encoding="utf-8")
    except OSError as error:
        raise UserError(f"cannot write {folder}: {error.strerror}") from error
    return list(files)


def _box_json(vehicle: Vehicle) -> dict[str, float | int]:
    box = {
        "x_m": vehicle.x,
        "y_m": vehicle.y,
        "vx_mps": vehicle.vx,
        "vy_mps": vehicle.vy,
        "length_m": vehicle.length,
        "width_m": vehicle.width,
    }
    return {**box, "lane": vehicle.lane} if vehicle.lane else dict(box)
