"""Rules of driving under test: they are told scenes, and asked what the shield asks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, Self

from drlsl.assurance.tested_rules import Answered, Question, Solutions, State, TestedRules
from drlsl.driving import shield
from drlsl.driving.scene import ATOMS, SCHEMA, Road, SceneBatch, road_facts, scene_facts
from drlsl.driving.shield import Decisions, Shield
from drlsl.logic import Engine
from drlsl.lowering.ir import Schema
from drlsl.shield import Facts
from drlsl.traffic import Mask

ACTIONS, SPEED, OBSERVATION, FRONT, ENTRY, LANE, COMFORT = (
    Question(one.goal, one.mode)
    for one in (
        shield.ACTIONS,
        shield.SPEED,
        shield.STATE,
        shield.FREE,
        shield.ENTRY,
        shield.LANE,
        shield.COMFORT,
    )
)
DRIVING: Final = (ACTIONS, SPEED, OBSERVATION, FRONT, ENTRY)
"""The questions of driving to every program; `LANE` and `COMFORT` only to those that define them."""


class DrivingRules(TestedRules):
    """A program that says how to drive."""

    states = "scenes"

    def __init__(self, asked: Shield, files: Sequence[Path] = ()) -> None:
        """Take a shield on the interpreter; without `files` the whole program is examined."""
        super().__init__(files)
        self.shield: Final = asked
        self._road: Road | None = None
        self._road_facts: Facts = {}

    @classmethod
    def of(cls, files: Sequence[Path]) -> Self:
        """Return the program of some files.

        Raises:
            UserError: a file cannot be read, or the program lacks a required predicate.
            PrologError: a file is not a valid program.
        """
        return cls(Shield.from_files(files), files)

    @property
    def engine(self) -> Engine:
        return self.shield.engine

    @property
    def schema(self) -> Schema:
        return SCHEMA

    @property
    def usual(self) -> Sequence[Question]:
        return DRIVING

    def tell(self, state: State) -> None:
        self.shield.state_facts(state)

    def facts(self, state: State) -> Facts:
        if state.road is not self._road:
            self._road, self._road_facts = state.road, road_facts(state.road)
        return {**self._road_facts, **scene_facts(state)}

    def decide(self, state: State) -> None:
        self.shield.decide(state)

    def on_arrays(self, tier: str, states: Sequence[State]) -> Iterator[Answered]:
        tested = self.shield.with_tier(tier)
        batch = SceneBatch.of(states)
        decisions, entries = tested.decide_batch(batch), tested.entries_are_safe(batch)
        for index in range(len(states)):
            failure = decisions.failures.get(index)
            yield Answered({} if failure else _answers(decisions, entries, index), failure)


def _answers(decisions: Decisions, entries: Mask, index: int) -> Mapping[Question, Solutions]:
    """Return one scene's decision as the solutions of the corresponding goals."""
    offered: list[Any] = [atom for atom, on in zip(ATOMS, decisions.action_mask[index], strict=True) if on]
    holds: Final[list[Mapping[str, Any]]] = [{}]
    return {
        ACTIONS: [{"Action": atom} for atom in offered],
        SPEED: [{"Speed": float(decisions.target_speed[index])}],
        OBSERVATION: [{"Observation": decisions.observation[index].tolist()}],
        FRONT: holds if decisions.front_is_free[index] else [],
        ENTRY: holds if entries[index] else [],
        LANE: [{"Lane": int(decisions.lane_to_keep[index])}],
        COMFORT: [{"Acceleration": float(decisions.comfortable_acceleration[index])}],
    }
