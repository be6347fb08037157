"""The reference tier: the program as written, run by the interpreter."""

from __future__ import annotations

from typing import Any

from drlsl.driving.scene import Road, Scene, road_facts, scene_facts
from drlsl.driving.shield.decision import NO_WISH, Decision, RuleFailure, decision_of
from drlsl.driving.shield.observation import ObservationSpace
from drlsl.driving.shield.questions import (
    ACTIONS,
    COMFORT,
    ENTRY,
    FREE,
    LANE,
    QUESTIONS,
    SPEED,
    STATE,
    Question,
)
from drlsl.driving.shield.tier import SceneTier, told
from drlsl.logic import Engine, LimitExceeded, Limits, PrologError


class Interpreter(SceneTier):
    """Asserts the facts of a scene in an engine and queries it."""

    name = "interpreter"

    def __init__(self, engine: Engine, limits: Limits, observation: ObservationSpace) -> None:
        """Prepare the queries of the program of `engine`; `limits` hold for each."""
        self.engine = engine
        self.observation = observation
        self.limits = limits
        asked = [one for one in QUESTIONS if one.required or engine.defines(one.name, one.arity)]
        self._goals = {one: engine.prepare(one.goal) for one in asked}
        self._road: Road | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Have a copy assert the facts of the road in its own engine."""
        return vars(self) | {"_road": None}

    def decide_scene(self, scene: Scene) -> Decision:
        """Return the decision about `scene`.

        Raises:
            RuleFailure: the rules gave no usable answer.
            UserError: the rules offer an action that the agent does not know.
        """
        self.state_facts(scene)
        try:
            return decision_of(
                self.observation,
                actions=[one[ACTIONS.variable] for one in self._goals[ACTIONS].solutions(self.limits)],
                speed=self._first(SPEED),
                observation=self._first(STATE),
                front_is_free=self._holds(FREE),
                lane=self._first(LANE) if LANE in self._goals else scene.target_lane,
                acceleration=self._first(COMFORT) if COMFORT in self._goals else NO_WISH,
            )
        except (PrologError, LimitExceeded) as error:
            raise RuleFailure(f"the rules raised an error: {error}") from error

    def entry_is_safe(self, scene: Scene) -> bool:
        """Return whether the ego may enter where `scene` places it.

        Raises:
            RuleFailure: the rules raised an error.
        """
        self.state_facts(scene)
        try:
            return self._holds(ENTRY)
        except (PrologError, LimitExceeded) as error:
            raise RuleFailure(f"the rules raised an error: {error}") from error

    def state_facts(self, scene: Scene) -> None:
        """Assert the facts of `scene` in the engine, in place of those of the previous scene.

        Raises:
            RuleFailure: a number is NaN, or a value is of another kind than its fact has.
        """
        facts = scene_facts(scene)
        if scene.road is not self._road:
            facts |= road_facts(scene.road)
        self._road = None
        for (name, arity), rows in told(facts).items():
            try:
                self.engine.replace_facts(name, arity, rows)
            except ValueError as error:
                raise RuleFailure(f"the fact {name}/{arity} cannot be asserted: {error}") from error
        self._road = scene.road

    def _first(self, question: Question) -> object:
        solution = self._goals[question].once(self.limits)
        return None if solution is None else solution[question.variable]

    def _holds(self, question: Question) -> bool:
        return self._goals[question].once(self.limits) is not None
