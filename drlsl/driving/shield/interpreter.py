"""The reference tier: the program as written, run by the interpreter."""

from __future__ import annotations

from typing import Any

from drlsl import shield
from drlsl.driving.scene import Road, Scene, road_facts, scene_facts
from drlsl.driving.shield.decision import Decision
from drlsl.driving.shield.observation import ObservationSpace
from drlsl.driving.shield.questions import ENTRY, questions_of_a_decision
from drlsl.driving.shield.tier import SceneTier, told
from drlsl.logic import Engine, Limits


class Interpreter(SceneTier):
    """Asserts the facts of a scene in an engine and queries it."""

    name = "interpreter"

    def __init__(self, engine: Engine, limits: Limits, observation: ObservationSpace) -> None:
        """Prepare the queries of the program of `engine`; `limits` hold for each."""
        self.engine = engine
        self.limits = limits
        self.observation = observation
        self.asked = questions_of_a_decision(engine)
        self._decision = shield.Interpreter(engine, self.asked, limits)
        self._entry = shield.Interpreter(engine, [ENTRY], limits)
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
        return self.decision(scene, self._decision.answers())

    def entry_is_safe(self, scene: Scene) -> bool:
        """Return whether the ego may enter where `scene` places it.

        Raises:
            RuleFailure: the rules raised an error.
        """
        self.state_facts(scene)
        (safe,) = self._entry.answers()
        return bool(safe)

    def state_facts(self, scene: Scene) -> None:
        """Assert the facts of `scene` in the engine, in place of those of the previous scene.

        Raises:
            RuleFailure: a number is NaN, or a value is of another kind than its fact has.
        """
        facts = scene_facts(scene)
        if scene.road is not self._road:
            facts |= road_facts(scene.road)
        self._road = None
        self._decision.state(told(facts))
        self._road = scene.road
