"""How a batch of scenes gets its answers: the interpreter, generated code for one scene, or arrays."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Final, Protocol

import numpy as np

from drlsl.driving.batch import FAIL_SAFE_MASK, Decisions, SceneBatch, fail_safe_speed
from drlsl.driving.lowered import ArrayAsker, ScalarAsker
from drlsl.driving.scene import Scene
from drlsl.driving.shield import OBSERVATION_SIZE, Decision, RuleFailure

if TYPE_CHECKING:
    from drlsl.driving.shield import Shield
from drlsl.errors import UserError
from drlsl.logic.lowering.errors import NotLowerable
from drlsl.logic.lowering.numpy_backend import compile_numpy

_log: Final = logging.getLogger(__name__)

FEW: Final = 8
"""Batches of fewer scenes are answered faster one scene at a time."""


class ArrayTier(Protocol):
    """Answers for a batch of scenes."""

    @property
    def name(self) -> str:
        """interpreter, scalar or numpy."""

    def decide(self, scenes: SceneBatch) -> Decisions:
        """What is safe in each scene, or its fail-safe."""

    def entries_are_safe(self, scenes: SceneBatch) -> list[bool]:
        """Whether the ego may be placed where each scene has it."""


class Asker(Protocol):
    """Answers for one scene; both may raise RuleFailure."""

    def decide(self, scene: Scene) -> Decision:
        """What is safe in `scene`."""

    def entry_is_safe(self, scene: Scene) -> bool:
        """Whether the ego may be placed where `scene` has it."""


class SceneBySceneTier:
    """A batch answered one scene at a time."""

    def __init__(self, name: str, asker: Asker) -> None:
        self.name = name
        self._asker = asker

    def decide(self, scenes: SceneBatch) -> Decisions:
        """What is safe in each scene, or its fail-safe."""
        count = len(scenes)
        decisions = Decisions(
            action_mask=np.zeros((count, 3), dtype=np.bool_),
            target_speed=np.zeros(count),
            observation=np.zeros((count, OBSERVATION_SIZE)),
            front_is_free=np.zeros(count, dtype=np.bool_),
            lane_to_keep=np.zeros(count, dtype=np.int64),
            failures={},
        )
        for index in range(count):
            self.decide_into(decisions, scenes, index)
        return decisions

    def decide_into(self, decisions: Decisions, scenes: SceneBatch, index: int) -> None:
        """Write what is safe in one scene, or its fail-safe, into the arrays."""
        scene = scenes.scene(index)
        try:
            decision = self._asker.decide(scene)
        except RuleFailure as failure:
            _fail_safely(decisions, index, scene, str(failure))
        else:
            _fill(decisions, index, decision)

    def entries_are_safe(self, scenes: SceneBatch) -> list[bool]:
        """Whether the ego may be placed where each scene has it."""
        return [self.entry_is_safe(scenes.scene(index)) for index in range(len(scenes))]

    def entry_is_safe(self, scene: Scene) -> bool:
        """Whether the ego may be placed where `scene` has it."""
        try:
            return self._asker.entry_is_safe(scene)
        except RuleFailure:
            return False  # a place the rules cannot judge is no place to start from


def _fill(decisions: Decisions, index: int, decision: Decision) -> None:
    """Write one scene's decision into the arrays."""
    decisions.action_mask[index] = decision.action_mask
    decisions.target_speed[index] = decision.target_speed
    decisions.observation[index] = decision.observation
    decisions.front_is_free[index] = decision.front_is_free
    decisions.lane_to_keep[index] = decision.lane_to_keep


def _fail_safely(decisions: Decisions, index: int, scene: Scene, reason: str) -> None:
    """Write the fail-safe for one scene into the arrays: keep the lane and brake, and say why."""
    decisions.action_mask[index] = FAIL_SAFE_MASK
    decisions.target_speed[index] = fail_safe_speed(abs(scene.ego.vx), scene.road)
    decisions.observation[index] = 0.0
    decisions.front_is_free[index] = False
    decisions.lane_to_keep[index] = scene.target_lane
    decisions.failures[index] = reason


class NumpyTier:
    """A batch answered at once by array programs; a few scenes, and undecided ones, one at a time."""

    name = "numpy"

    def __init__(self, shield: Shield, few: int = FEW) -> None:
        """Lower the shield's program; batches of less than `few` scenes are answered one scene at a time.

        Raises:
            NotLowerable: a rule that only the interpreter can run.
            UserError: the rules can offer an action that the agent does not know.
        """
        self._arrays = ArrayAsker(shield, compile_numpy)
        self._one_by_one = SceneBySceneTier("scalar", ScalarAsker(shield))
        self._interpreter = SceneBySceneTier("interpreter", shield)
        self._few = few

    def decide(self, scenes: SceneBatch) -> Decisions:
        """What is safe in each scene, or its fail-safe."""
        if len(scenes) < self._few:
            return self._one_by_one.decide(scenes)
        decisions, unusable = self._arrays.decide(scenes)
        for index in np.flatnonzero(unusable).tolist():
            self._interpreter.decide_into(decisions, scenes, index)
        return decisions

    def entries_are_safe(self, scenes: SceneBatch) -> list[bool]:
        """Whether the ego may be placed where each scene has it."""
        if len(scenes) < self._few:
            return self._one_by_one.entries_are_safe(scenes)
        safe, undecided = self._arrays.entries_are_safe(scenes)
        for index in np.flatnonzero(undecided).tolist():
            safe[index] = self._interpreter.entry_is_safe(scenes.scene(index))
        return list(map(bool, safe))


def choose_tier(shield: Shield, requested: str) -> ArrayTier:
    """The tier that `requested` names; `auto` is the fastest that can run the shield's program.

    Raises:
        UserError: the tier cannot run the program, or the program offers an unknown action.
    """
    if requested == "interpreter":
        return SceneBySceneTier("interpreter", shield)
    try:
        if requested == "scalar":
            return SceneBySceneTier("scalar", ScalarAsker(shield))
        return NumpyTier(shield, FEW if requested == "auto" else 0)
    except NotLowerable as problem:
        if requested != "auto":
            raise UserError(f"the {requested} tier cannot run these rules: {problem}") from problem
        _log.warning("the rules run on the interpreter, which is slow: %s", problem)
        return SceneBySceneTier("interpreter", shield)
