"""The faster tiers: the shield's program lowered to code for one scene, and to arrays for many."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from drlsl.driving.scene import (
    EGO,
    EGO_ID,
    SCHEMA,
    Action,
    Decisions,
    Facts,
    Road,
    Row,
    Scene,
    SceneBatch,
    action_of_atom,
    road_facts,
    scene_facts,
)
from drlsl.driving.shield.shield import OBSERVATION_SIZE, Decision, Shield
from drlsl.logic.lowering.batch_program import BatchAnswer, BatchProgram, Rows
from drlsl.logic.lowering.errors import NotLowerable, Undecided
from drlsl.logic.lowering.forms import array_forms
from drlsl.logic.lowering.lower import Lowered, Query, lower
from drlsl.logic.lowering.scalar import compile_scalar
from drlsl.logic.lowering.schema import Relation

Mask: TypeAlias = npt.NDArray[np.bool_]

ACTIONS: Final = Query("safe_actions", 1, "set")
SPEED: Final = Query("longitudinal_velocity", 1, "first")
STATE: Final = Query("state", 1, "first")
FREE: Final = Query("front_is_free", 0, "holds")
ENTRY: Final = Query("entry_is_safe", 0, "holds")
LANE: Final = Query("lane_to_keep", 1, "first")

ASKED: Final = (ACTIONS, FREE, SPEED, STATE, ENTRY, LANE)
"""What driving asks a program; LANE only of one that defines it."""

_NUMBERS: Final = frozenset({"int", "float", "number"})

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

    def __init__(self, shield: Shield, compile_program: Callable[[Lowered], BatchProgram[Any]]) -> None:
        """Lower the shield's program.

        Raises:
            NotLowerable: a rule that only the interpreter can run, with its place and the reason.
            UserError: the rules can offer an action that the agent does not know.
        """
        queries = [ACTIONS, SPEED, STATE, FREE, *([LANE] if shield.gives_lane else [])]
        lowered = lower(shield.engine, SCHEMA, queries)
        _check_forms(lowered)
        answers = compile_program(lowered)
        self._actions = [action_of_atom(atom) for atom in answers.choices[ACTIONS]]
        self._answers = _Program(answers)
        self._entry = _Program(compile_program(lower(shield.engine, SCHEMA, [ENTRY])))

    def decide(self, scenes: SceneBatch) -> tuple[Decisions, npt.NDArray[np.bool_]]:
        """The decisions, and (N,) which of them mean nothing because the interpreter has to be asked."""
        (actions, speed, state, free, *lane), undecided = self._answers(scenes)
        mask = np.zeros((len(scenes), len(Action)), dtype=np.bool_)
        for column, action in enumerate(self._actions):
            mask[:, action] |= actions.value[:, column]
        decisions = Decisions(
            action_mask=mask,
            target_speed=np.asarray(speed.value, dtype=np.float64),
            observation=np.asarray(state.value, dtype=np.float64),
            front_is_free=free.value,
            lane_to_keep=np.asarray(lane[0].value, dtype=np.int64) if lane else scenes.target_lane.copy(),
            failures={},
        )
        unusable = undecided | speed.fails | state.fails | _unusable(decisions)
        return decisions, unusable | lane[0].fails if lane else unusable

    def entries_are_safe(self, scenes: SceneBatch) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
        """Whether each entry is safe, and which of these answers mean nothing; both of shape (N,)."""
        (entry,), undecided = self._entry(scenes)
        return entry.value, undecided


def _check_forms(lowered: Lowered) -> None:
    """Have the answers be numbers, as many as a decision has.

    Raises:
        NotLowerable: they are not, in no scene; the interpreter tells what they are.
    """
    for form in array_forms(lowered)[1:]:
        kinds = [node.kind for node in form.values]
        if form.query == SPEED and not (form.plain and kinds[0] in _NUMBERS):
            raise NotLowerable(str(form.query), None, "its answer is no speed in m/s")
        if form.query == STATE and (len(kinds) != OBSERVATION_SIZE or not _NUMBERS.issuperset(kinds)):
            raise NotLowerable(str(form.query), None, f"its answer is no list of {OBSERVATION_SIZE} numbers")
        if form.query == LANE and not (form.plain and kinds[0] == "int"):
            raise NotLowerable(str(form.query), None, "its answer is no lane")


class _Program:
    """An array program that is told scenes; the facts of their roads are kept from batch to batch."""

    def __init__(self, program: BatchProgram[Any]) -> None:
        self._program = program
        self._reads_names = 0 in program.columns_read("vehicle", 8)
        self._roads: tuple[Road, ...] = ()
        self._road_rows: dict[tuple[str, int], Any] = {}

    def __call__(self, scenes: SceneBatch) -> tuple[list[BatchAnswer[npt.NDArray[Any]]], Mask]:
        """The answers, and the scenes that are undecided, as NumPy arrays."""
        result = self._program(self._facts(scenes))
        answers = [BatchAnswer(_numpy(answer.value), _numpy(answer.fails)) for answer in result.answers]
        return answers, _numpy(result.undecided)

    def _facts(self, scenes: SceneBatch) -> dict[tuple[str, int], Any]:
        if scenes.roads is not self._roads:
            self._roads, self._road_rows = scenes.roads, self._rows_of(scenes.roads)
        names = None
        if self._reads_names:
            names = np.where(scenes.id == EGO_ID, self._program.code(EGO), scenes.id + FIRST_OTHER)
        columns = (names, scenes.lane, scenes.x, scenes.y, scenes.vx, scenes.vy, scenes.length, scenes.width)
        road_rows = self._road_rows
        if len(scenes.roads) > 1:
            road_rows = {name: replace(rows, index=scenes.road) for name, rows in road_rows.items()}
        return {
            **road_rows,
            ("vehicle", 8): Rows(columns, scenes.valid),
            ("target_lane", 1): Rows([scenes.target_lane]),
        }

    def _rows_of(self, roads: tuple[Road, ...]) -> dict[tuple[str, int], Any]:
        """The facts of the roads that the program reads, a table for each road; of one road, made ready."""
        facts = [road_facts(road) for road in roads]
        rows = {
            (name, arity): self._tables(SCHEMA.relations[name, arity], [one[name, arity] for one in facts])
            for name, arity in facts[0]
            if (name, arity) in self._program.reads
        }
        if len(roads) > 1:
            return rows
        return {key: self._program.table(*key, one) for key, one in rows.items()}

    def _tables(self, relation: Relation, tables: Sequence[Sequence[Row]]) -> Rows:
        most = max(map(len, tables))
        columns = []
        for place, kind in enumerate(relation.columns):
            column = np.zeros((len(tables), most), dtype=np.float64 if kind == "float" else np.int64)
            for number, rows in enumerate(tables):
                cells = [row[place] for row in rows]
                codes = [self._program.code(str(cell)) for cell in cells] if kind == "atom" else cells
                column[number, : len(rows)] = codes
            columns.append(column)
        if relation.single:
            return Rows([column[:, 0] for column in columns])
        return Rows(columns, np.arange(most) < np.array([[len(rows)] for rows in tables]))


def _numpy(values: Any) -> npt.NDArray[Any]:
    """Values as a NumPy array, from whatever device they are on."""
    return np.asarray(values if isinstance(values, np.ndarray) else values.cpu())


def _unusable(decisions: Decisions) -> Mask:
    """Decisions that a `Decision` could not hold, shape (N,)."""
    usable = (
        decisions.action_mask.any(axis=1)
        & np.isfinite(decisions.target_speed)
        & (decisions.target_speed >= 0)
        & ((decisions.observation >= 0) & (decisions.observation <= 1)).all(axis=1)
    )
    return np.asarray(~usable)
