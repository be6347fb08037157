"""Scenes in the words of a driver: lanes counted from the right, gaps from bumper to bumper.

Authors of tables compute no coordinates. Rows give the places of vehicles as the ego's driver sees them;
`scene_of` lays them out on the road for one direction of travel.
"""

from __future__ import annotations

import math
import random
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Final, Literal, Self, TypeAlias, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, Field, model_validator

from drlsl.driving.scene import ACCELERATION_LIMIT, BRAKING_LIMIT, CENTRE_TOLERANCE, EGO, Road, Scene, Vehicle
from drlsl.traffic import Direction, Lane

Positive = Annotated[float, Field(gt=0)]
LaneWord = Literal["left", "own", "right"]

# With these and lanes 3.5 m wide, places and sizes add up exactly, so a row can be exactly at a limit.
LENGTH: Final = 4.5
WIDTH: Final = 2.0
EGO_X: Final = 256.0


class Row(BaseModel):
    """A part of a table that refuses unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=True)


class LaneRow(Row):
    """A lane that differs from the others; `apart` is the strip between it and the lane to its right [m].

    `ends`: how far ahead of the ego's front bumper it ends [m], along the ego's direction; without, it goes
    on.
    """

    width: Positive | None = None
    speed_limit: Positive | None = None
    apart: float = Field(0.0, ge=0)
    ends: float | None = None


class RoadRow(Row):
    """The road: `lanes` of the ego's direction, left of them the `median` and `oncoming` ones; SI units."""

    lanes: Annotated[int, Field(ge=1)] | list[LaneRow] = 3
    oncoming: Annotated[int, Field(ge=0)] | list[LaneRow] = 0
    median: float = Field(2.0, ge=0)
    lane_width: Positive = 3.5
    speed_limit: Positive = 30.0
    time_step: Positive = 0.04
    radar_range: Positive = 100.0
    acceleration_limit: Positive = ACCELERATION_LIMIT
    braking_limit: Positive = BRAKING_LIMIT
    centre_tolerance: float = Field(CENTRE_TOLERANCE, ge=0)


class BoxRow(Row):
    """The common fields of ego and vehicles; SI units.

    `shift`: offset of its centre to the ego driver's left of the lane's centre; `drift`: the speed that way.
    """

    shift: float = 0.0
    drift: float = 0.0
    length: Positive = LENGTH
    width: Positive = WIDTH


class EgoRow(BoxRow):
    """The ego: its lane, counted from the right; its speed [m/s]; the lane that it steers for."""

    lane: int = Field(1, ge=1)
    speed: float = 20.0
    target: LaneWord | int = "own"


class VehicleRow(BoxRow):
    """Another vehicle: its lane, its place along the road, and its speed in its lane's direction [m/s].

    `lane` is left, own or right of the ego's, or a number: 1, 2 … from the right, or -1, -2 … for oncoming
    lanes from the median. Exactly one is given of `ahead` and `behind`, the gap from bumper to bumper [m],
    and `offset`, the distance of its centre ahead of the ego's [m].
    """

    lane: LaneWord | int = "own"
    ahead: float | None = None
    behind: float | None = None
    offset: float | None = None
    speed: float | None = None

    @model_validator(mode="after")
    def _is_somewhere(self) -> Self:
        if sum(place is not None for place in (self.ahead, self.behind, self.offset)) != 1:
            raise ValueError("expected one of ahead, behind (bumper to bumper) and offset (between centres)")
        return self


_Box = TypeVar("_Box", bound=BoxRow)

_Strip: TypeAlias = tuple[float, float, Direction, float | None]
"""A lane's width [m], limit [m/s] and direction, and where it ends, ahead of the ego's front [m]."""


class Layout:
    """A road as the driver sees it and as the rules see it, for one direction of travel."""

    def __init__(self, row: RoadRow, direction: Direction, ego_length: float = LENGTH) -> None:
        lanes = [LaneRow() for _ in range(row.lanes)] if isinstance(row.lanes, int) else row.lanes
        self.sign: Final = direction.sign
        self.count: Final = len(lanes)
        self._centres: list[float] = []
        self._front = EGO_X + self.sign * ego_length / 2
        strips: list[_Strip] = []
        edge = 0.0
        opposite = (
            Direction.RIGHT_TO_LEFT if direction is Direction.LEFT_TO_RIGHT else Direction.LEFT_TO_RIGHT
        )
        oncoming = [LaneRow()] * row.oncoming if isinstance(row.oncoming, int) else row.oncoming
        for number, lane in enumerate([*lanes, *oncoming]):
            width = lane.width or row.lane_width
            apart = lane.apart + (row.median if number == len(lanes) else 0.0)
            self._centres.append(edge + apart + width / 2)
            along = direction if number < len(lanes) else opposite
            strips.append((width, lane.speed_limit or row.speed_limit, along, lane.ends))
            edge += apart + width
        self._edge = edge
        self.road: Final = Road(
            tuple(self._lane(n, *strip) for n, strip in self._from_the_top(strips)),
            row.time_step,
            row.radar_range,
            row.acceleration_limit,
            row.braking_limit,
            row.centre_tolerance,
        )

    def _from_the_top(self, strips: list[_Strip]) -> list[tuple[int, _Strip]]:
        numbered = list(enumerate(strips))
        return numbered[::-1] if self.sign > 0 else numbered

    def _lane(
        self, number: int, width: float, limit: float, direction: Direction, ends: float | None
    ) -> Lane:
        end = None if ends is None else self._front + self.sign * ends
        return Lane(self.lane_id(number), direction, self.y(self._centres[number]), width, limit, end)

    def lane_id(self, number: int) -> int:
        """Return the road's id of a lane, given by its place from the right, from 0."""
        return len(self._centres) - number if self.sign > 0 else number + 1

    def y(self, from_the_right: float) -> float:
        """Return the y of a place, given in metres from the road's right edge in the ego's direction."""
        return self._edge - from_the_right if self.sign > 0 else from_the_right

    def number(self, lane: LaneWord | int, ego_lane: int) -> int:
        """Return the place from the right, from 0, of a row's lane; negative numbers are oncoming lanes.

        Raises:
            ValueError: the road has no such lane.
        """
        if isinstance(lane, str):
            number = ego_lane + {"left": 1, "own": 0, "right": -1}[lane]
            known = 0 <= number < self.count
        else:
            number = lane - 1 if lane > 0 else self.count - 1 - lane
            known = 0 <= number < (self.count if lane > 0 else len(self._centres)) and lane != 0
        if not known:
            raise ValueError(f"the road has no lane {lane!r} here")
        return number

    def centre(self, number: int) -> float:
        """Return the distance of a lane's centre from the road's right edge [m]."""
        return self._centres[number]


@dataclass(frozen=True)
class Staging:
    """A scene in the words of its driver, for one direction of travel."""

    road: RoadRow
    ego: EgoRow
    vehicles: Mapping[str, VehicleRow]
    direction: Direction

    def state(self) -> Scene:
        """Return the scene on the road.

        Raises:
            ValueError: a lane that the road does not have.
        """
        return scene_of(self.road, self.ego, self.vehicles, self.direction)

    def row(self) -> str:
        """Return the scene as a row of a table, in one line of YAML."""
        vehicles = {name: _given(vehicle) for name, vehicle in self.vehicles.items()}
        parts = {"road": _given(self.road), "ego": _given(self.ego), "vehicles": vehicles}
        row = {"directions": self.direction.value, **{key: value for key, value in parts.items() if value}}
        return yaml.safe_dump(row, default_flow_style=True, width=math.inf, sort_keys=False).strip()

    def changed(self, chance: random.Random) -> Staging:
        """Return a scene like it with other speeds, gaps and places, of two decimals."""
        vehicles = {name: _moved(chance, row) for name, row in self.vehicles.items()}
        for number in range(1, chance.choice((1, 1, 2, 3))):
            vehicles[f"more{number}"] = _other(chance, self)
        return replace(self, ego=_moved(chance, self.ego), vehicles=vehicles)


def _given(row: Row) -> dict[str, object]:
    return row.model_dump(exclude_defaults=True)


def _other(chance: random.Random, staging: Staging) -> VehicleRow:
    """Return one more vehicle."""
    lanes = staging.road.lanes
    return VehicleRow(
        lane=chance.randint(1, lanes if isinstance(lanes, int) else len(lanes)),
        offset=round(chance.gauss(0.0, 25.0), 2),
        speed=round(max(0.0, staging.ego.speed + chance.gauss(0.0, 5.0)), 2),
        drift=chance.choice((0.0, 0.0, round(chance.gauss(0.0, 1.0), 2))),
    )


def _moved(chance: random.Random, row: _Box) -> _Box:
    """Return a box with some of its numbers changed, most of them slightly."""
    spreads = {"speed": 5.0, "shift": 0.5, "drift": 0.5, "ahead": 10.0, "behind": 10.0, "offset": 2.0}
    update = {}
    for name, spread in spreads.items():
        value = getattr(row, name, None)
        if value is not None and chance.random() < 0.5:
            update[name] = round(value + chance.gauss(0.0, spread * chance.choice((0.02, 1.0))), 2)
    if isinstance(row, EgoRow | VehicleRow) and update.get("speed", 0.0) < 0.0:
        update["speed"] = 0.0
    return row.model_copy(update=update)


def scene_of(road: RoadRow, ego: EgoRow, vehicles: Mapping[str, VehicleRow], direction: Direction) -> Scene:
    """Return the scene that rows describe, with the ego driving in `direction`.

    Raises:
        ValueError: a lane that the road does not have.
    """
    layout = Layout(road, direction, ego.length)
    own = layout.number(ego.lane, 0)
    box = _box(EGO, layout, own, ego, 0.0, ego.speed)
    others = tuple(
        _box(name, layout, layout.number(row.lane, own), row, _offset(row, ego), _speed(row, ego))
        for name, row in vehicles.items()
    )
    return Scene(layout.road, box, others, layout.lane_id(layout.number(ego.target, own)))


def _offset(row: VehicleRow, ego: EgoRow) -> float:
    touching = (ego.length + row.length) / 2
    if row.ahead is not None:
        return touching + row.ahead
    if row.behind is not None:
        return -touching - row.behind
    assert row.offset is not None, "VehicleRow has exactly one of the three"
    return row.offset


def _speed(row: VehicleRow, ego: EgoRow) -> float:
    return ego.speed if row.speed is None else row.speed


def _box(name: str, layout: Layout, number: int, row: BoxRow, offset: float, speed: float) -> Vehicle:
    y = layout.y(layout.centre(number) + row.shift)
    sign = layout.sign
    along = sign if number < layout.count else -sign
    return Vehicle(
        name,
        layout.road.lane_at(y),
        EGO_X + sign * offset,
        y,
        along * speed,
        -sign * row.drift,
        row.length,
        row.width,
    )
