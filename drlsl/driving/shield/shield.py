"""The shield: a rule program that decides which actions are safe in a scene."""

from __future__ import annotations

import copy
import logging
import threading
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar

from drlsl.driving.scene import Scene
from drlsl.driving.shield.action_names import unknown_actions
from drlsl.driving.shield.decision import Decision, Decisions
from drlsl.driving.shield.highway_rules import default_rules
from drlsl.driving.shield.interpreter import Interpreter
from drlsl.driving.shield.observation import ObservationSpace, declared_observation
from drlsl.driving.shield.questions import QUESTIONS
from drlsl.errors import UserError
from drlsl.logic import Engine, Limits
from drlsl.lowering.ir import Undecided
from drlsl.shield import consult_rules, program_files

if TYPE_CHECKING:
    from drlsl.driving.scene import SceneBatch
    from drlsl.driving.shield.tier import Tier
    from drlsl.traffic import Mask

T = TypeVar("T")

_LOG: Final = logging.getLogger(__name__)

LIMITS: Final = Limits(inferences=2_000_000)
"""The limits of one query of the rules; a program that never ends must not stop the car from braking."""


class Shield:
    """A rule program and the tiers that run it; threads may share one, and take turns."""

    def __init__(self, engine: Engine, *, tier: str = "interpreter", seconds: float | None = None) -> None:
        """Check the program that `engine` has consulted.

        `tier` decides one scene and many; a scene that it leaves undecided goes to the interpreter. `LIMITS`,
        and `seconds` [s] if given, bound one query of the interpreter; beyond them the rules count as having
        failed.

        Raises:
            UserError: a required predicate is missing, a clause is about an action that the agent does not
                know, or the names or bounds of the observation are not usable.
        """
        missing = [str(one) for one in QUESTIONS if one.required and not engine.defines(one.name, one.arity)]
        if missing:
            raise UserError(
                f"the rule program does not define {', '.join(missing)}; rules/highway.pl shows what is asked"
            )
        for place, problem in unknown_actions(engine):
            raise UserError(f"{place}: {problem}")
        self.lock = threading.RLock()
        """Held during every query; hold it, too, when asserting facts and querying the engine directly."""
        observation = declared_observation(engine)
        self._interpreter = Interpreter(engine, replace(LIMITS, seconds=seconds), observation)
        self._requested_tier = tier
        self._chosen_tier: Tier | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Return the engine and its queries; a copy generates the code of its tier anew."""
        with self.lock:
            state = vars(self).copy()
        del state["lock"]
        return state | {"_chosen_tier": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self.lock = threading.RLock()

    def __copy__(self) -> Shield:
        """Return a deep copy: two shields on one engine would overwrite each other's facts."""
        return copy.deepcopy(self)

    @classmethod
    def default(cls, *, tier: str = "interpreter") -> Shield:
        """Return the shield of the default program, highway.pl."""
        return cls.from_files(default_rules(), tier=tier)

    @classmethod
    def from_files(
        cls, paths: Sequence[str | Path], *, tier: str = "interpreter", seconds: float | None = None
    ) -> Shield:
        """Return the shield of the program in `paths`, consulted in order; no path: highway.pl.

        A name such as paper.pl, if there is no such file, means the program that ships with the package.
        Findings in the files are logged as warnings.

        Raises:
            UserError: a file cannot be read, or the program lacks a required predicate.
            PrologError: a file is not a valid program.
        """
        engine = Engine()
        for path in paths or default_rules():
            consult_rules(engine, path)
        for warning in engine.warnings:
            _LOG.warning("%s", warning)
        return cls(engine, tier=tier, seconds=seconds)

    def with_tier(self, tier: str) -> Shield:
        """Return a shield of the same program with another tier; the two take turns.

        Raises:
            UserError: the tier cannot run the program.
        """
        other = Shield.__new__(Shield)
        vars(other).update(vars(self) | {"_requested_tier": tier, "_chosen_tier": None})
        with self.lock:
            other._tier()
        return other

    @property
    def engine(self) -> Engine:
        """The engine with the program."""
        return self._interpreter.engine

    def files(self) -> list[Path]:
        """Return the rule files that the program's clauses come from, in the order of their names."""
        self.prepare()
        return program_files(self.engine)

    @property
    def observation(self) -> ObservationSpace:
        """The names and bounds of the numbers that `state/1` gives."""
        return self._interpreter.observation

    @property
    def limits(self) -> Limits:
        """The limits of one query of the interpreter."""
        return self._interpreter.limits

    def decide(self, scene: Scene) -> Decision:
        """Return the decision about `scene`.

        Raises:
            RuleFailure: the rules gave no usable answer.
            UserError: the tier cannot run the program, or the rules offer an action that the agent does not
                know.
        """
        return self._of_one(lambda tier: tier.decide_scene(scene))

    def entry_is_safe(self, scene: Scene) -> bool:
        """Return whether the ego may enter where `scene` places it.

        Raises:
            RuleFailure: the rules raised an error.
            UserError: the tier cannot run the program.
        """
        return self._of_one(lambda tier: tier.entry_is_safe(scene))

    def decide_batch(self, scenes: SceneBatch) -> Decisions:
        """Return the decision about each of N scenes; if the rules fail, the fail-safe, marked as such.

        Raises:
            UserError: the tier cannot run the program, or the rules offer an action that the agent does not
                know.
        """
        with self.lock:
            decisions, undecided = self._tier().decide(scenes)
            for index in undecided:
                self._interpreter.decide_into(decisions, index, scenes.scene(index))
            return decisions

    def entries_are_safe(self, scenes: SceneBatch) -> Mask:
        """Return whether the ego may enter where each scene places it, shape (N,); False if the rules fail.

        Raises:
            UserError: the tier cannot run the program.
        """
        with self.lock:
            answers, undecided = self._tier().entries_are_safe(scenes)
            for index in undecided:
                answers[index] = self._interpreter.is_surely_safe_entry(scenes.scene(index))
            return answers

    def prepare(self) -> None:
        """Compile the rules for the tier, which their first use does otherwise.

        Raises:
            UserError: the tier cannot run the program, or its `state/1` gives other numbers than it declares.
        """
        with self.lock:
            self._tier()

    @property
    def tier(self) -> str:
        """The tier: interpreter, scalar, numpy, numba or torch.

        Raises:
            UserError: the requested tier cannot run the program.
        """
        with self.lock:
            return self._tier().name

    def state_facts(self, scene: Scene) -> None:
        """Assert the facts of `scene` in the engine, in place of those of the previous scene.

        If threads share the shield, hold `lock` until the engine has been queried.

        Raises:
            RuleFailure: a number is NaN, or a value is of another kind than its fact has.
        """
        with self.lock:
            self._interpreter.state_facts(scene)

    def _of_one(self, ask: Callable[[Tier], T]) -> T:
        """Return what the tier says of one scene, or the interpreter if the tier leaves it undecided."""
        with self.lock:
            try:
                return ask(self._tier_for_one())
            except Undecided:
                return ask(self._interpreter)

    def _tier_for_one(self) -> Tier:
        """Return the tier for one scene; for the interpreter nothing else is loaded, so a query is light."""
        return self._interpreter if self._requested_tier == self._interpreter.name else self._tier()

    def _tier(self) -> Tier:
        if self._chosen_tier is None:
            from drlsl.driving.shield.dispatch import choose_tier

            self._chosen_tier = choose_tier(self._requested_tier, self._interpreter)
            _LOG.info("the rules run on the %s tier", self._chosen_tier.name)
        return self._chosen_tier
