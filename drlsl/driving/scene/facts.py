"""The facts that describe a scene to a rule program, and their schema."""

from __future__ import annotations

from typing import Final, TypeAlias

from drlsl.driving.scene.ego_limits import EGO_LIMITS
from drlsl.driving.scene.model import EGO, Road, Scene, Vehicle
from drlsl.lowering.ir import Relation, Schema

Row: TypeAlias = tuple[str | int | float, ...]
Facts: TypeAlias = dict[tuple[str, int], list[Row]]

_NUMBERS: Final = ("time_step", "radar_range", *EGO_LIMITS)
"""What a road has one number of, each a fact of that name."""

SCHEMA: Final = Schema(
    [
        Relation(
            "vehicle",
            ("atom", "int", "float", "float", "float", "float", "float", "float"),
            key=0,
            first=EGO,
            capacity=40,
            fields=Vehicle._fields,
        ),
        Relation(
            "road_lane",
            ("int", "atom", "float", "float", "float"),
            key=0,
            capacity=6,
            fields=("id", "direction", "centre", "width", "speed_limit"),
        ),
        Relation("lane_end", ("int", "float"), key=0, capacity=6, fields=("lane", "x")),
        Relation("target_lane", ("int",), single=True),
        *(Relation(name, ("float",), single=True) for name in _NUMBERS),
    ]
)
"""The schema of a scene's facts."""


def facts_of(scene: Scene) -> Facts:
    """Return all the facts of a scene, those of its road included."""
    return {**road_facts(scene.road), **scene_facts(scene)}


def road_facts(road: Road) -> Facts:
    """Return the facts that hold for every scene on one road."""
    return {
        ("road_lane", 5): [
            (lane.id, lane.direction.value, lane.centre, lane.width, lane.speed_limit) for lane in road.lanes
        ],
        ("lane_end", 2): [(lane.id, lane.end) for lane in road.lanes if lane.end is not None],
        **{(name, 1): [(getattr(road, name),)] for name in _NUMBERS},
    }


def scene_facts(scene: Scene) -> Facts:
    """Return the facts of one moment: the ego first, then the vehicles in radar range."""
    return {
        ("vehicle", 8): [scene.ego, *scene.in_range()],
        ("target_lane", 1): [(scene.target_lane,)],
    }
