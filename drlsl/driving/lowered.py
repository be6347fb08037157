"""The faster tiers: the shield's program lowered to code for one scene."""

from __future__ import annotations

from typing import Final

from drlsl.driving.scene import EGO, Facts, Road, Scene, Vehicle, road_facts, scene_facts
from drlsl.driving.shield import Decision, Shield
from drlsl.logic.lowering.errors import NotLowerable
from drlsl.logic.lowering.lower import Query, lower
from drlsl.logic.lowering.scalar import compile_scalar
from drlsl.logic.lowering.schema import Relation, Schema
from drlsl.logic.lowering.support import Undecided

SCHEMA: Final = Schema(
    [
        Relation(
            "vehicle", ("atom", "int", *["float"] * 6), key=0, first=EGO, capacity=40, fields=Vehicle._fields
        ),
        Relation(
            "road_lane",
            ("int", "atom", "float", "float", "float"),
            key=0,
            capacity=6,
            fields=("id", "direction", "centre", "width", "speed_limit"),
        ),
        Relation("target_lane", ("int",), single=True),
        Relation("time_step", ("float",), single=True),
        Relation("radar_range", ("float",), single=True),
        Relation("acceleration_limit", ("float",), single=True),
        Relation("braking_limit", ("float",), single=True),
        Relation("centre_tolerance", ("float",), single=True),
    ]
)
"""What the facts of a scene look like; `drlsl.driving.scene` makes them."""

QUERIES: Final = (
    Query("safe_actions", 1, "all"),
    Query("longitudinal_velocity", 1, "first"),
    Query("state", 1, "first"),
    Query("front_is_free", 0, "holds"),
    Query("lane_to_keep", 1, "first"),
)
"""What a decision asks, in the order of the answers; a program may leave the last undefined."""

ENTRY: Final = Query("entry_is_safe", 0, "holds")


class ScalarAsker:
    """Answers by generated code for one scene; where that cannot decide, by the interpreter."""

    def __init__(self, shield: Shield) -> None:
        """Lower the shield's program.

        Raises:
            NotLowerable: a rule that only the interpreter can run, with its place and the reason.
        """
        queries = QUERIES if shield.gives_lane else QUERIES[:-1]
        self._shield = shield
        self._answers = compile_scalar(lower(shield.engine, SCHEMA, queries))
        self._entry = compile_scalar(lower(shield.engine, SCHEMA, [ENTRY]))
        self._road: Road | None = None
        self._road_facts: Facts = {}

    def decide(self, scene: Scene) -> Decision:
        """What is safe in `scene`; raises what the interpreter raises."""
        try:
            actions, speed, observation, free, *lane = self._answers(self._facts(scene))
        except Undecided:
            return self._shield.decide(scene)
        return self._shield.checked(
            actions=actions,
            speed=speed,
            observation=observation,
            front_is_free=free,
            lane=lane[0] if lane else scene.target_lane,
        )

    def entry_is_safe(self, scene: Scene) -> bool:
        """Whether the ego may be placed where `scene` has it; raises what the interpreter raises."""
        try:
            (safe,) = self._entry(self._facts(scene))
        except Undecided:
            return self._shield.entry_is_safe(scene)
        return bool(safe)

    def _facts(self, scene: Scene) -> Facts:
        if scene.road is not self._road:
            self._road, self._road_facts = scene.road, road_facts(scene.road)
        return {**self._road_facts, **scene_facts(scene)}


__all__ = ["ENTRY", "QUERIES", "SCHEMA", "NotLowerable", "ScalarAsker"]
