"""How a batch of scenes gets its answers: the interpreter, generated code for one scene, or arrays."""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, Final, Protocol

import numpy as np

from drlsl.driving.scene import FAIL_SAFE_MASK, Decisions, Scene, SceneBatch, fail_safe_speed
from drlsl.driving.shield.compiled import ArrayAsker, ScalarAsker
from drlsl.driving.shield.shield import OBSERVATION_SIZE, Decision, RuleFailure
from drlsl.errors import UserError
from drlsl.logic.lowering.batch_program import BatchProgram
from drlsl.logic.lowering.errors import NotLowerable
from drlsl.logic.lowering.lower import Lowered
from drlsl.logic.lowering.numpy_backend import compile_numpy
from drlsl.traffic import cache_folder

if TYPE_CHECKING:
    from drlsl.driving.shield.shield import Shield

_log: Final = logging.getLogger(__name__)

FEW: Final = 8
"""Batches of fewer scenes are answered faster one scene at a time."""


class ArrayTier(Protocol):
    """Answers for a batch of scenes."""

    @property
    def name(self) -> str:
        """interpreter, scalar, numpy, numba or torch."""

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


class BatchTier:
    """A batch answered at once by array programs; a few scenes, and undecided ones, one at a time."""

    def __init__(self, shield: Shield, name: str, few: int = 0) -> None:
        """Lower the shield's program; batches of less than `few` scenes are answered one scene at a time.

        Raises:
            NotLowerable: a rule that only the interpreter can run.
            UserError: the rules can offer an action that the agent does not know, or the tier's library is
                missing.
        """
        self.name = name
        self._arrays = ArrayAsker(shield, _compiler(name))
        self._one_by_one = SceneBySceneTier("scalar", ScalarAsker(shield)) if few else None
        self._interpreter = SceneBySceneTier("interpreter", shield)
        self._few = few

    def decide(self, scenes: SceneBatch) -> Decisions:
        """What is safe in each scene, or its fail-safe."""
        if self._one_by_one is not None and len(scenes) < self._few:
            return self._one_by_one.decide(scenes)
        decisions, unusable = self._arrays.decide(scenes)
        for index in unusable.nonzero()[0].tolist():
            self._interpreter.decide_into(decisions, scenes, index)
        return decisions

    def entries_are_safe(self, scenes: SceneBatch) -> list[bool]:
        """Whether the ego may be placed where each scene has it."""
        if self._one_by_one is not None and len(scenes) < self._few:
            return self._one_by_one.entries_are_safe(scenes)
        safe, undecided = self._arrays.entries_are_safe(scenes)
        answers: list[bool] = safe.tolist()
        for index in undecided.nonzero()[0].tolist():
            answers[index] = self._interpreter.entry_is_safe(scenes.scene(index))
        return answers


def _compiler(name: str) -> Callable[[Lowered], BatchProgram[Any]]:
    """What makes the array programs of a tier; its library is loaded here.

    Raises:
        UserError: the library is not installed.
    """
    if name == "numpy":
        return compile_numpy
    if name == "torch":
        from drlsl.logic.lowering.torch_backend import compile_torch

        return compile_torch
    if find_spec("numba") is None:
        raise UserError("the numba tier needs numba, which is not installed: pip install 'drlsl[fast]'")
    from drlsl.logic.lowering.numba_backend import compile_numba

    return partial(compile_numba, folder=cache_folder() / "rules")


def choose_tier(shield: Shield, requested: str) -> ArrayTier:
    """The tier that `requested` names; `auto` is the fastest that can run the shield's program.

    Raises:
        UserError: the tier cannot run the program or its library is missing, or the program offers an unknown
            action.
    """
    if requested == "interpreter":
        return SceneBySceneTier("interpreter", shield)
    try:
        if requested == "scalar":
            return SceneBySceneTier("scalar", ScalarAsker(shield))
        return _fastest(shield) if requested == "auto" else BatchTier(shield, requested)
    except NotLowerable as problem:
        if requested != "auto":
            raise UserError(f"the {requested} tier cannot run these rules: {problem}") from problem
        _log.warning("the rules run on the interpreter, which is slow: %s", problem)
        return SceneBySceneTier("interpreter", shield)


def _fastest(shield: Shield) -> ArrayTier:
    """Machine code where Numba is installed, else arrays; both need a program that can be lowered."""
    if find_spec("numba") is not None:
        try:
            return BatchTier(shield, "numba")
        except ImportError as problem:
            _log.warning("the rules run on the numpy tier, since numba does not load: %s", problem)
    return BatchTier(shield, "numpy", FEW)
