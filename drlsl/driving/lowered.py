"""The faster tiers: the shield's program lowered to code for one scene, and to arrays for many."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from drlsl.driving.actions import Action, action_of_atom
from drlsl.driving.batch import EGO_ID, Decisions, SceneBatch
from drlsl.driving.scene import EGO, Facts, Road, Scene, Vehicle, road_facts, scene_facts
from drlsl.driving.shield import OBSERVATION_SIZE, Decision, Shield
from drlsl.logic.lowering.errors import Undecided
from drlsl.logic.lowering.lower import Query, lower
from drlsl.logic.lowering.numpy_backend import ArrayProgram, ArrayResult, Rows, compile_numpy
from drlsl.logic.lowering.scalar import compile_scalar
from drlsl.logic.lowering.schema import Relation, Schema

ROAD_LANE: Final = Relation(
    "road_lane",
    ("int", "atom", "float", "float", "float"),
    key=0,
    capacity=6,
    fields=("id", "direction", "centre", "width", "speed_limit"),
)

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
        ROAD_LANE,
        Relation("target_lane", ("int",), single=True),
        Relation("time_step", ("float",), single=True),
        Relation("radar_range", ("float",), single=True),
        Relation("acceleration_limit", ("float",), single=True),
        Relation("braking_limit", ("float",), single=True),
        Relation("centre_tolerance", ("float",), single=True),
    ]
)
"""What the facts of a scene look like; `drlsl.driving.scene` makes them."""

SPEED: Final = Query("longitudinal_velocity", 1, "first")
STATE: Final = Query("state", 1, "first")
FREE: Final = Query("front_is_free", 0, "holds")
ENTRY: Final = Query("entry_is_safe", 0, "holds")
LANE: Final = Query("lane_to_keep", 1, "first")

FIRST_OTHER: Final = 1 << 20
"""The integer that stands for vehicle 0 in arrays; atoms of the program have smaller ones."""


class ScalarAsker:
    """Answers by generated code for one scene; where that cannot decide, by the interpreter."""

    def __init__(self, shield: Shield) -> None:
        """Lower the shield's program.

        Raises:
            NotLowerable: a rule that only the interpreter can run, with its place and the reason.
        """
        queries = [
            Query("safe_actions", 1, "all"),
            SPEED,
            STATE,
            FREE,
            *([LANE] if shield.gives_lane else []),
        ]
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


class ArrayAsker:
    """Answers for many scenes by array programs; `undecided` scenes are left to the interpreter."""

    def __init__(self, shield: Shield) -> None:
        """Lower the shield's program.

        Raises:
            NotLowerable: a rule that only the interpreter can run, with its place and the reason.
            UserError: the rules can offer an action that the agent does not know.
        """
        actions = Query("safe_actions", 1, "set")
        queries = [actions, SPEED, STATE, FREE, *([LANE] if shield.gives_lane else [])]
        self._answers = compile_numpy(lower(shield.engine, SCHEMA, queries))
        self._entry = compile_numpy(lower(shield.engine, SCHEMA, [ENTRY]))
        self._actions = [action_of_atom(atom) for atom in self._answers.choices[actions]]
        self._tables = _RoadTables()

    def decide(self, scenes: SceneBatch) -> tuple[Decisions, npt.NDArray[np.bool_]]:
        """The decisions, and (N,) which of them mean nothing because the interpreter has to be asked."""
        result = self._answers(self._facts(scenes, self._answers))
        actions, speed, state, free, *lane = result.answers
        mask = np.zeros((len(scenes), len(Action)), dtype=np.bool_)
        for column, action in enumerate(self._actions):
            mask[:, action] |= actions.value[:, column]
        decisions = Decisions(
            action_mask=mask,
            target_speed=np.asarray(speed.value, dtype=np.float64),
            observation=np.asarray(state.value, dtype=np.float64),
            front_is_free=np.asarray(free.value, dtype=np.bool_),
            lane_to_keep=np.asarray(lane[0].value, dtype=np.int64) if lane else scenes.target_lane,
            failures={},
        )
        return decisions, _unusable(decisions, result)

    def entries_are_safe(self, scenes: SceneBatch) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
        """Whether each entry is safe, and which of these answers mean nothing; both of shape (N,)."""
        result = self._entry(self._facts(scenes, self._entry))
        return np.asarray(result.answers[0].value, dtype=np.bool_), result.undecided

    def _facts(self, scenes: SceneBatch, program: ArrayProgram) -> dict[tuple[str, int], Rows]:
        names = np.where(scenes.id == EGO_ID, program.code(EGO), scenes.id + FIRST_OTHER)
        columns = (names, scenes.lane, scenes.x, scenes.y, scenes.vx, scenes.vy, scenes.length, scenes.width)
        return {
            **self._tables.rows(scenes, program),
            ("vehicle", 8): Rows(columns, scenes.valid),
            ("target_lane", 1): Rows([scenes.target_lane]),
        }


class _RoadTables:
    """The facts of roads as arrays, kept from batch to batch."""

    def __init__(self) -> None:
        self._roads: tuple[Road, ...] = ()
        self._program: ArrayProgram | None = None
        self._tables: dict[tuple[str, int], Rows] = {}

    def rows(self, scenes: SceneBatch, program: ArrayProgram) -> dict[tuple[str, int], Rows]:
        """The road facts of every scene; shared by all of them where there is one road."""
        if scenes.roads is not self._roads or program is not self._program:
            self._roads, self._program = scenes.roads, program
            self._tables = _road_tables(scenes.roads, program)
        if len(scenes.roads) == 1:
            return self._tables
        return {
            name: Rows(
                [None if column is None else column[scenes.road] for column in rows.columns],
                None if rows.valid is None else rows.valid[scenes.road],
            )
            for name, rows in self._tables.items()
        }


def _road_tables(roads: tuple[Road, ...], program: ArrayProgram) -> dict[tuple[str, int], Rows]:
    """Rows of shape (number of roads, L) for the lanes, and (number of roads,) for the rest."""
    facts = [road_facts(road) for road in roads]
    tables = {}
    for name in facts[0]:
        if name == (ROAD_LANE.name, ROAD_LANE.arity):
            continue
        tables[name] = Rows([np.array([rows[name][0][0] for rows in facts], dtype=np.float64)])
    lanes = [rows[ROAD_LANE.name, ROAD_LANE.arity] for rows in facts]
    most = max(map(len, lanes))
    columns = []
    for place, kind in enumerate(ROAD_LANE.columns):
        column = np.zeros((len(roads), most), dtype=np.float64 if kind == "float" else np.int64)
        for road, rows in enumerate(lanes):
            values = [program.code(str(row[place])) if kind == "atom" else row[place] for row in rows]
            column[road, : len(rows)] = values
        columns.append(column)
    valid = np.arange(most) < np.array([[len(rows)] for rows in lanes])
    tables[ROAD_LANE.name, ROAD_LANE.arity] = Rows(columns, valid)
    return tables


def _unusable(decisions: Decisions, result: ArrayResult) -> npt.NDArray[np.bool_]:
    """Scenes that the arrays leave undecided, and those whose answer a `Decision` could not hold."""
    _, speed, state, _, *lane = result.answers
    fails = speed.fails | state.fails
    for answer in lane:
        fails = fails | answer.fails
    if decisions.observation.shape[1] != OBSERVATION_SIZE:
        return np.ones_like(fails)
    usable = (
        decisions.action_mask.any(axis=1)
        & np.isfinite(decisions.target_speed)
        & (decisions.target_speed >= 0)
        & ((decisions.observation >= 0) & (decisions.observation <= 1)).all(axis=1)
    )
    return np.asarray(result.undecided | fails | ~usable)
