"""The protocol of tiers: a tier runs a rule program on scenes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

from drlsl.driving.scene import SCHEMA, Facts, Scene
from drlsl.driving.shield.decision import Decision, Decisions, RuleFailure, decision_of, fail_safe
from drlsl.driving.shield.observation import ObservationSpace
from drlsl.driving.shield.questions import Question
from drlsl.lowering.ir import Undecided

if TYPE_CHECKING:
    from drlsl.driving.scene import SceneBatch
    from drlsl.traffic import Mask

Undecidable: TypeAlias = list[int]
"""Indexes of the scenes that a tier leaves to the interpreter; its answers for them are undefined."""


class Tier(Protocol):
    """Answers the questions of driving for N scenes; a scene on which the rules fail gets the fail-safe."""

    @property
    def name(self) -> str:
        """The name: interpreter, scalar, numpy, numba or torch."""

    def decide_scene(self, scene: Scene) -> Decision:
        """Return the decision about `scene`.

        Raises:
            RuleFailure: the rules gave no usable answer.
            UserError: the rules offer an action that the agent does not know.
            Undecided: only the interpreter can tell.
        """

    def entry_is_safe(self, scene: Scene) -> bool:
        """Return whether the ego may enter where `scene` places it.

        Raises:
            RuleFailure: the rules raised an error.
            Undecided: only the interpreter can tell.
        """

    def decide(self, scenes: SceneBatch) -> tuple[Decisions, Undecidable]:
        """Return the decision about each scene."""

    def entries_are_safe(self, scenes: SceneBatch) -> tuple[Mask, Undecidable]:
        """Return whether the ego may enter where each scene places it; False if the rules fail."""


def told(facts: Facts) -> Facts:
    """Return the facts of a scene with every value of its column's kind.

    Raises:
        RuleFailure: a value is of another kind than its fact has.
    """
    try:
        return {key: SCHEMA.relations[key].conform(rows) for key, rows in facts.items()}
    except (TypeError, ValueError) as error:
        raise RuleFailure(f"a fact cannot be told to the rules: {error}") from error


class SceneTier(ABC):
    """A tier that answers one scene at a time."""

    name: str
    observation: ObservationSpace
    asked: Sequence[Question]
    """The questions whose answers make a decision."""

    @abstractmethod
    def decide_scene(self, scene: Scene) -> Decision:
        """Return the decision about `scene`.

        Raises:
            RuleFailure: the rules gave no usable answer.
            UserError: the rules offer an action that the agent does not know.
            Undecided: only the interpreter can tell.
        """

    @abstractmethod
    def entry_is_safe(self, scene: Scene) -> bool:
        """Return whether the ego may enter where `scene` places it.

        Raises:
            RuleFailure: the rules raised an error.
            Undecided: only the interpreter can tell.
        """

    def decision(self, scene: Scene, answers: Iterable[Any]) -> Decision:
        """Return the decision that the answers to `asked` make.

        Raises:
            RuleFailure: they are not usable.
            UserError: the rules offer an action that the agent does not know.
        """
        return decision_of(self.observation, dict(zip(self.asked, answers, strict=True)), scene)

    def decide(self, scenes: SceneBatch) -> tuple[Decisions, Undecidable]:
        """Return the decision about each scene."""
        decisions, left = Decisions.blank(len(scenes), len(self.observation)), []
        for index in range(len(scenes)):
            try:
                self.decide_into(decisions, index, scenes.scene(index))
            except Undecided:
                left.append(index)
        return decisions, left

    def decide_into(self, decisions: Decisions, index: int, scene: Scene) -> None:
        """Write the decision about one scene, or its fail-safe, into the decisions about many."""
        try:
            decisions.put(index, self.decide_scene(scene))
        except RuleFailure as failure:
            decisions.put(index, fail_safe(scene, self.observation), str(failure))

    def entries_are_safe(self, scenes: SceneBatch) -> tuple[Mask, Undecidable]:
        """Return whether the ego may enter where each scene places it."""
        import numpy as np

        answers, left = np.zeros(len(scenes), np.bool_), []
        for index in range(len(scenes)):
            try:
                answers[index] = self.is_surely_safe_entry(scenes.scene(index))
            except Undecided:
                left.append(index)
        return answers, left

    def is_surely_safe_entry(self, scene: Scene) -> bool:
        """Return whether the rules find the entry safe; False if they fail."""
        try:
            return self.entry_is_safe(scene)
        except RuleFailure:
            return False
