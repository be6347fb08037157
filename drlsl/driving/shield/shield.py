"""The shield: a rule program, asked what is safe in a scene."""

from __future__ import annotations

import copy
import logging
import math
import threading
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeGuard

from drlsl.driving.scene import SCHEMA, Action, Road, Scene, action_of_atom, road_facts, scene_facts
from drlsl.errors import UserError
from drlsl.logic import Engine, LimitExceeded, Limits, PrologError, Solution

if TYPE_CHECKING:
    from drlsl.driving.scene import Decisions, SceneBatch
    from drlsl.driving.shield.dispatch import ArrayTier

_LOG: Final = logging.getLogger(__name__)

OBSERVATION_SIZE: Final = 10
"""Numbers in an observation. Source: paper, State Space."""

LIMITS: Final = Limits(inferences=2_000_000)
"""What one question to the rules may cost; a program that never ends must not stop the car from braking."""

LOADING: Final = Limits(inferences=20_000_000, seconds=60.0)
"""What loading a rule file may cost, its directives included."""

REQUIRED: Final = (
    ("safe_actions", 1),
    ("front_is_free", 0),
    ("longitudinal_velocity", 1),
    ("state", 1),
    ("entry_is_safe", 0),
)
"""The predicates that a rule program must define."""


class RuleFailure(Exception):
    """The rules gave no usable answer: an error, an exhausted limit, no action, a number out of range."""


@dataclass(frozen=True, slots=True)
class Decision:
    """What the rules say about one scene.

    `safe_actions` in the order derived, never empty; `target_speed` [m/s] >= 0; `observation`: 10 numbers
    in [0, 1]; `front_is_free`; `lane_to_keep`: the lane that lane keeping steers for.
    """

    safe_actions: tuple[Action, ...]
    target_speed: float
    observation: tuple[float, ...]
    front_is_free: bool
    lane_to_keep: int

    @property
    def action_mask(self) -> tuple[int, int, int]:
        """1 for every action that is offered, by action index."""
        keep, left, right = (int(action in self.safe_actions) for action in Action)
        return keep, left, right


class Shield:
    """A rule program and the engine that runs it; threads may share one, and take turns."""

    def __init__(self, engine: Engine, *, tier: str = "interpreter", seconds: float | None = None) -> None:
        """Check the program that `engine` has consulted.

        One question to the rules may cost what `LIMITS` says, and `seconds` of time [s] where that is given;
        beyond that it is a failure of the rules.

        Raises:
            UserError: a predicate of `REQUIRED` is missing, or `tier` cannot run the program.
        """
        missing = [f"{name}/{arity}" for name, arity in REQUIRED if not engine.defines(name, arity)]
        if missing:
            raise UserError(
                f"the rule program does not define {', '.join(missing)}; rules/highway.pl shows what is asked"
            )
        self.engine = engine
        self.limits = replace(LIMITS, seconds=seconds)
        self.lock = threading.RLock()
        """Held for every question; who tells facts and asks the engine itself has to hold it meanwhile."""
        self.gives_lane = engine.defines("lane_to_keep", 1)
        self._road: Road | None = None
        self._safe_actions = engine.prepare("safe_actions(Action)")
        self._front_is_free = engine.prepare("front_is_free")
        self._velocity = engine.prepare("longitudinal_velocity(Speed)")
        self._state = engine.prepare("state(Observation)")
        self._lane_to_keep = engine.prepare("lane_to_keep(Lane)")
        self._entry_is_safe = engine.prepare("entry_is_safe")
        self._requested_tier = tier
        self._arrays: ArrayTier | None = None

    def __getstate__(self) -> dict[str, Any]:
        """The engine and what is asked of it; the generated code of the tier is made again by a copy."""
        with self.lock:
            state = vars(self).copy()
        del state["lock"]
        return state | {"_road": None, "_arrays": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self.lock = threading.RLock()

    def __copy__(self) -> Shield:
        """The same as a deep copy: two shields on one engine would tell it facts behind each other's back."""
        return copy.deepcopy(self)

    @classmethod
    def default(cls, *, tier: str = "interpreter") -> Shield:
        """The shield of the default program, highway.pl."""
        return cls.from_files(default_rules(), tier=tier)

    @classmethod
    def from_files(
        cls, paths: Sequence[str | Path], *, tier: str = "interpreter", seconds: float | None = None
    ) -> Shield:
        """The shield of the program that `paths` hold, consulted in order; no path: the default program.

        A name such as paper.pl, where there is no such file, means the program that ships with the package.
        What looks wrong in the files is logged as warnings.

        Raises:
            UserError: a file cannot be read, or the program lacks a predicate that is asked.
            PrologError: a file is not a valid program.
        """
        engine = Engine()
        for path in paths or default_rules():
            consult_rules(engine, path)
        for warning in engine.warnings:
            _LOG.warning("%s", warning)
        return cls(engine, tier=tier, seconds=seconds)

    def decide(self, scene: Scene) -> Decision:
        """What is safe in `scene`.

        Raises:
            RuleFailure: the rules gave no usable answer.
            UserError: the rules offer an action that the agent does not know.
        """
        with self.lock:
            self.state_facts(scene)
            try:
                return self.checked(
                    actions=[solution["Action"] for solution in self._safe_actions.solutions(self.limits)],
                    speed=_value(self._velocity.once(self.limits), "Speed"),
                    observation=_value(self._state.once(self.limits), "Observation"),
                    front_is_free=self._front_is_free.once(self.limits) is not None,
                    lane=_value(self._lane_to_keep.once(self.limits), "Lane")
                    if self.gives_lane
                    else scene.target_lane,
                )
            except (PrologError, LimitExceeded) as error:
                raise RuleFailure(f"the rules raised an error: {error}") from error

    def entry_is_safe(self, scene: Scene) -> bool:
        """Whether the ego may be placed where `scene` has it.

        Raises:
            RuleFailure: the rules raised an error.
        """
        with self.lock:
            self.state_facts(scene)
            try:
                return self._entry_is_safe.once(self.limits) is not None
            except (PrologError, LimitExceeded) as error:
                raise RuleFailure(f"the rules raised an error: {error}") from error

    def decide_batch(self, scenes: SceneBatch) -> Decisions:
        """What is safe in each of N scenes; one without a usable answer gets the fail-safe, and is marked."""
        with self.lock:
            return self._array_tier().decide(scenes)

    def entries_are_safe(self, scenes: SceneBatch) -> list[bool]:
        """Whether the ego may be placed where each scene has it; False where there is no usable answer."""
        with self.lock:
            return self._array_tier().entries_are_safe(scenes)

    @property
    def tier(self) -> str:
        """What runs the rules for a batch: interpreter, scalar, numpy, numba or torch."""
        with self.lock:
            return self._array_tier().name

    def _array_tier(self) -> ArrayTier:
        if self._arrays is None:
            from drlsl.driving.shield.dispatch import (
                choose_tier,  # numpy: loaded only where batches are asked
            )

            self._arrays = choose_tier(self, self._requested_tier)
            _LOG.info("the rules run on the %s tier", self._arrays.name)
        return self._arrays

    def state_facts(self, scene: Scene) -> None:
        """Tell the engine about `scene`: its facts replace those of the scene before.

        Where threads share the shield, hold `lock` until the engine has been asked.

        Raises:
            RuleFailure: a number is NaN, or a value is of another kind than its fact has.
        """
        facts = scene_facts(scene)
        if scene.road is not self._road:
            facts |= road_facts(scene.road)
        self._road = None
        for (name, arity), rows in facts.items():
            try:
                self.engine.replace_facts(name, arity, SCHEMA.relations[name, arity].conform(rows))
            except (TypeError, ValueError) as error:
                raise RuleFailure(f"the fact {name}/{arity} cannot be told: {error}") from error
        self._road = scene.road

    def checked(
        self, *, actions: list[object], speed: object, observation: object, front_is_free: bool, lane: object
    ) -> Decision:
        """The decision that a tier's answers make; an answer that is None has no solution.

        Raises:
            RuleFailure: an answer is not usable.
            UserError: the rules offer an action that the agent does not know.
        """
        safe = tuple(dict.fromkeys(action_of_atom(atom) for atom in actions))
        if not safe:
            raise RuleFailure("the rules offer no action")
        for predicate, answer in (
            ("longitudinal_velocity/1", speed),
            ("state/1", observation),
            ("lane_to_keep/1", lane),
        ):
            if answer is None:
                raise RuleFailure(f"{predicate} has no solution")
        if not _is_number(speed) or speed < 0:
            raise RuleFailure(f"longitudinal_velocity/1 gave {speed!r}; expected a speed in m/s, 0 or more")
        if not isinstance(observation, list) or len(observation) != OBSERVATION_SIZE:
            raise RuleFailure(f"state/1 gave {observation!r}; expected a list of {OBSERVATION_SIZE} numbers")
        if not all(_is_number(item) and 0 <= item <= 1 for item in observation):
            raise RuleFailure(f"state/1 gave {observation!r}; expected numbers from 0 to 1")
        if not isinstance(lane, int):
            raise RuleFailure(f"lane_to_keep/1 gave {lane!r}; expected a lane")
        return Decision(safe, float(speed), tuple(map(float, observation)), front_is_free, lane)


def default_rules() -> tuple[Path, ...]:
    """The files of the default program.

    Raises:
        UserError: the package has no rules.
    """
    return (rules_folder() / "highway.pl",)


def rules_folder() -> Path:
    """Where the programs are that ship with the package: in it, or in the checkout of an editable install.

    Raises:
        UserError: neither place has them.
    """
    package = Path(str(files("drlsl")))
    for folder in (package / "rules", package.parent / "rules"):
        if (folder / "highway.pl").is_file():
            return folder
    raise UserError(f"no rules/highway.pl in {package} or beside it; install drlsl again")


def consult_rules(engine: Engine, path: str | Path) -> None:
    """Consult a rule file, or the program of this name that ships with the package.

    The files that it names are looked for beside it, then among the programs that ship.

    Raises:
        UserError: the file cannot be read.
        PrologError: it is not a valid program, or loading it goes beyond `LOADING`.
    """
    try:
        engine.consult(rule_file(path), [rules_folder()], limits=LOADING)
    except OSError as error:
        raise UserError(f"cannot read the rule file {path}: {error.strerror}") from error


def rule_file(path: str | Path) -> Path:
    """A rule file, or the program of this name that ships with the package."""
    if Path(path).exists() or len(Path(path).parts) > 1:
        return Path(path)
    shipped = rules_folder() / path
    return shipped if shipped.is_file() else Path(path)


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float) and math.isfinite(value)


def _value(solution: Solution | None, variable: str) -> object:
    return None if solution is None else solution[variable]
