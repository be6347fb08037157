"""The choice of the tier that answers."""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from typing import Any, Final

from drlsl.driving.scene import Scene, SceneBatch
from drlsl.driving.shield.compiled import ArrayTier, ScalarTier, check_state
from drlsl.driving.shield.decision import Decision, Decisions
from drlsl.driving.shield.interpreter import Interpreter
from drlsl.driving.shield.tier import Tier, Undecidable
from drlsl.errors import UserError
from drlsl.files import cache_folder
from drlsl.lowering.backends import BatchProgram, compile_numpy
from drlsl.lowering.frontend import Lowered
from drlsl.lowering.ir import NotLowerable

_LOG: Final = logging.getLogger(__name__)

FEW: Final = 8
"""Batches of fewer scenes are answered faster one scene at a time."""


def choose_tier(requested: str, interpreter: Interpreter) -> Tier:
    """Return the tier of the name `requested`; `auto` is the fastest that can run the program.

    Raises:
        UserError: the tier cannot run the program or its library is missing, or the program offers an unknown
            action or gives another number of observed numbers than it declares.
    """
    check_state(interpreter.engine, interpreter.observation)
    if requested == "interpreter":
        return interpreter
    try:
        return _fastest(interpreter) if requested == "auto" else _named(requested, interpreter)
    except NotLowerable as problem:
        if requested != "auto":
            raise UserError(f"the {requested} tier cannot run these rules: {problem}") from problem
        _LOG.warning("the rules run on the interpreter, which is slow: %s", problem)
        return interpreter


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

    def entries_are_safe(self, scenes: SceneBatch) -> tuple[list[bool], Undecidable]:
        """Return whether the ego may enter where each scene places it."""
        return self._for(scenes).entries_are_safe(scenes)

    def _for(self, scenes: SceneBatch) -> Tier:
        return self._few if len(scenes) < FEW else self._many


def _named(name: str, interpreter: Interpreter) -> Tier:
    engine, observation = interpreter.engine, interpreter.observation
    if name == "scalar":
        return ScalarTier(engine, observation)
    return ArrayTier(name, engine, observation, _compiler(name))


def _fastest(interpreter: Interpreter) -> Tier:
    """Return the Numba tier if Numba is installed, else NumPy's; both need a program that can be lowered."""
    if find_spec("numba") is not None:
        try:
            return _named("numba", interpreter)
        except ImportError as problem:
            _LOG.warning("the rules run on the numpy tier, since numba does not load: %s", problem)
    return BySize(_named("scalar", interpreter), _named("numpy", interpreter))


def _compiler(name: str) -> Callable[[Lowered], BatchProgram[Any]]:
    """Return the compiler of a tier's array programs; its library is loaded here.

    Raises:
        UserError: the library is not installed.
    """
    if name == "numpy":
        return compile_numpy
    if name == "torch":
        if find_spec("torch") is None:
            raise UserError("the torch tier needs PyTorch, which is missing: pip install 'drlsl[train]'")
        from drlsl.lowering.backends import compile_torch

        return compile_torch
    if find_spec("numba") is None:
        raise UserError("the numba tier needs numba, which is not installed: pip install 'drlsl[fast]'")
    from drlsl.lowering.backends import compile_numba

    return partial(compile_numba, folder=cache_folder() / "rules")
