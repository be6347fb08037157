"""The JSON form of a scene, for `drlsl query --state FILE`; the names of fields state their units."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from drlsl.driving.scene.model import EGO, Road, Scene, Vehicle
from drlsl.errors import UserError
from drlsl.files import parse_json, problem_text, read_text
from drlsl.traffic import Direction, Lane

Positive = Annotated[float, Field(gt=0)]


class _Model(BaseModel):
    # Only whole scenes are validated: parts without validators of their own save time.
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=True, defer_build=True)


class LaneModel(_Model):
    """One lane of the road."""

    id: int = Field(ge=1, description="The lane's number; any order, each once.")
    direction: Literal["left_to_right", "right_to_left"] = Field(
        description="Direction of travel: left_to_right is +x; y points downward, so its left is -y."
    )
    centre_m: float = Field(description="The y of its centre line.")
    width_m: Positive = Field(description="Its width.")
    speed_limit_mps: Positive = Field(description="Its speed limit.")
    end_m: float | None = Field(None, description="The x where it ends; if not given, it goes on.")


class RoadModel(_Model):
    """The road and the sensing."""

    lanes: list[LaneModel] = Field(min_length=1, description="Every lane, of both directions.")
    time_step_s: Positive = Field(0.04, description="The time until the rules are asked again.")
    radar_range_m: Positive = Field(100.0, description="Range of the ego's sensing.")


class BoxModel(_Model):
    """A vehicle's box and velocity."""

    x_m: float = Field(description="The centre along the road.")
    y_m: float = Field(description="The centre across the road, downward.")
    vx_mps: float = Field(description="Velocity along x: negative for right_to_left.")
    vy_mps: float = Field(0.0, description="Velocity along y: positive is downward.")
    length_m: Positive = Field(4.6, description="Length along the road.")
    width_m: Positive = Field(1.9, description="Width across the road.")
    lane: int | None = Field(None, description="Its lane; if not given, the lane that holds its centre.")


class EgoModel(BoxModel):
    """The ego."""

    target_lane: int | None = Field(
        None, description="The lane it steers for; if not given, the lane it is in."
    )


class VehicleModel(BoxModel):
    """Another vehicle."""

    id: str = Field(min_length=1, description="Its name; each once, and not 'ego'.")


class SceneModel(_Model):
    """A scene: the road, the ego and the vehicles around it."""

    road: RoadModel
    ego: EgoModel
    vehicles: list[VehicleModel] = Field([], description="The other vehicles, in any order.")


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
    try:
        model = SceneModel.model_validate(data)
    except ValidationError as error:
        raise UserError(f"{name}: {_first_problem(error)}") from error
    for problem in _problems(model):
        raise UserError(f"{name}: {problem}")
    return _scene(model)


def _first_problem(error: ValidationError) -> str:
    """Return the first problem, with its place, and the number of further ones."""
    problems = error.errors(include_url=False, include_context=False)
    first = problems[0]
    place = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in first["loc"]).lstrip(".")
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    unknown = f"is not a field of a scene{more}; docs/scene.schema.json lists them"
    return problem_text(first, place or "the scene", unknown, more)


def _problems(model: SceneModel) -> Iterator[str]:
    """Yield the problems that the types of the fields cannot express."""
    known = Counter(lane.id for lane in model.road.lanes)
    for lane_id, times in known.items():
        if times > 1:
            yield f"road.lanes has lane {lane_id} {times} times; each lane needs an id of its own"
    listed = ", ".join(map(str, known))
    for place, lane in _named_lanes(model):
        if lane not in known:
            yield f"{place} is {lane}, a lane that the road lacks; it has {listed}"
    names = Counter(vehicle.id for vehicle in model.vehicles)
    for name, times in names.items():
        if name == EGO:
            yield f"vehicles has one called {EGO!r}; that name is the ego's own"
        if times > 1:
            yield f"vehicles has {name!r} {times} times; each vehicle needs an id of its own"
    road = _road(model.road)
    if model.ego.lane is None and not road.lane_at(model.ego.y_m):
        yield f"ego.y_m is {model.ego.y_m}, which is in no lane of the road; give ego.lane or move the ego"


def _named_lanes(model: SceneModel) -> Iterator[tuple[str, int]]:
    if model.ego.lane is not None:
        yield "ego.lane", model.ego.lane
    if model.ego.target_lane is not None:
        yield "ego.target_lane", model.ego.target_lane
    for index, vehicle in enumerate(model.vehicles):
        if vehicle.lane is not None:
            yield f"vehicles[{index}].lane", vehicle.lane


def _road(model: RoadModel) -> Road:
    lanes = sorted(
        (
            Lane(
                lane.id,
                Direction(lane.direction),
                lane.centre_m,
                lane.width_m,
                lane.speed_limit_mps,
                lane.end_m,
            )
            for lane in model.lanes
        ),
        key=lambda lane: lane.centre,
    )
    return Road(tuple(lanes), model.time_step_s, model.radar_range_m)


def _vehicle(name: str, box: BoxModel, road: Road) -> Vehicle:
    lane = road.lane_at(box.y_m) if box.lane is None else box.lane
    return Vehicle(name, lane, box.x_m, box.y_m, box.vx_mps, box.vy_mps, box.length_m, box.width_m)


def _scene(model: SceneModel) -> Scene:
    road = _road(model.road)
    ego = _vehicle(EGO, model.ego, road)
    return Scene(
        road=road,
        ego=ego,
        vehicles=tuple(_vehicle(vehicle.id, vehicle, road) for vehicle in model.vehicles),
        target_lane=ego.lane if model.ego.target_lane is None else model.ego.target_lane,
    )


def scene_defaults() -> dict[str, float]:
    """Return the numbers that a scene file may leave out, by the names of their fields."""
    fields = {**RoadModel.model_fields, **BoxModel.model_fields}
    return {name: field.default for name, field in fields.items() if isinstance(field.default, float)}


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
