"""The choice of the tier that answers."""

from __future__ import annotations

from functools import partial
from typing import Final

from drlsl import shield
from drlsl.driving.scene import Scene, SceneBatch
from drlsl.driving.shield.compiled import ArrayTier, ScalarTier, check_state
from drlsl.driving.shield.decision import Decision, Decisions
from drlsl.driving.shield.interpreter import Interpreter
from drlsl.driving.shield.tier import Tier, Undecidable
from drlsl.shield import array_compiler, fastest_for_many
from drlsl.traffic import Mask

FEW: Final = 8
"""Batches of fewer scenes are answered faster one scene at a time."""


def choose_tier(requested: str, interpreter: Interpreter) -> Tier:
    """Return the tier of the name `requested`; `auto` is the fastest that can run the program.

    Raises:
        UserError: the tier cannot run the program or its library is missing, or the program offers an unknown
            action or gives another number of observed numbers than it declares.
    """
    check_state(interpreter.engine, interpreter.observation)
    lowered = partial(_lowered, interpreter)
    reference: Tier = interpreter
    return shield.choose_tier(requested, reference, lowered, partial(fastest_for_many, lowered, BySize))


class BySize:
    """One tier for few scenes, another for many."""

    def __init__(self, few: Tier, many: Tier) -> None:
        self.name = many.name
        self._few = few
        self._many = many

    def decide_scene(self, scene: Scene) -> Decision:
        """Return the decision about `scene`.

        Raises:
            RuleFailure: the rules gave no usable answer.
            UserError: the rules offer an action that the agent does not know.
            Undecided: only the interpreter can tell.
        """
        return self._few.decide_scene(scene)

    def entry_is_safe(self, scene: Scene) -> bool:
        """Return whether the ego may enter where `scene` places it.

        Raises:
            RuleFailure: the rules raised an error.
            Undecided: only the interpreter can tell.
        """
        return self._few.entry_is_safe(scene)

    def decide(self, scenes: SceneBatch) -> tuple[Decisions, Undecidable]:
        """Return the decision about each scene."""
        return self._for(scenes).decide(scenes)

    def entries_are_safe(self, scenes: SceneBatch) -> tuple[Mask, Undecidable]:
        """Return whether the ego may enter where each scene places it."""
        return self._for(scenes).entries_are_safe(scenes)

    def _for(self, scenes: SceneBatch) -> Tier:
        return self._few if len(scenes) < FEW else self._many


def _lowered(interpreter: Interpreter, name: str) -> Tier:
    engine, observation = interpreter.engine, interpreter.observation
    if name == "scalar":
        return ScalarTier(engine, observation)
    return ArrayTier(name, engine, observation, array_compiler(name))
