"""The faster tiers: a rule program lowered to code for one scene, and to arrays for many."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from drlsl.driving.scene import (
    SCHEMA,
    Action,
    Facts,
    Road,
    Scene,
    SceneBatch,
    action_of_atom,
    road_facts,
    scene_facts,
)
from drlsl.driving.shield.decision import NO_WISH, Decision, Decisions, RuleFailure
from drlsl.driving.shield.gathered import gather
from drlsl.driving.shield.observation import ObservationSpace
from drlsl.driving.shield.questions import (
    ACTIONS,
    COMFORT,
    ENTRY,
    LANE,
    NAMES,
    QUESTIONS,
    SPEED,
    STATE,
    Question,
    questions_of_a_decision,
)
from drlsl.driving.shield.scene_program import SceneProgram
from drlsl.driving.shield.tier import SceneTier, Undecidable, told
from drlsl.errors import UserError
from drlsl.logic import Engine
from drlsl.logic.terms import NIL, Struct
from drlsl.lowering.backends import BatchProgram, compile_scalar, machine_code
from drlsl.lowering.frontend import Lowered, Query, array_forms, lower
from drlsl.lowering.ir import Bag, Node, NotLowerable, Sym, Undecided, emitted, resolve
from drlsl.traffic import Mask

_NUMBERS: Final = frozenset({"int", "float", "number"})


def query_of(question: Question, *, ordered: bool = False) -> Query:
    """Return the query to lower for a question; with `ordered`, the order of its answers matters."""
    mode = "set" if question.mode == "all" and not ordered else question.mode
    return Query(question.name, question.arity, mode)


ASKED: Final = tuple(map(query_of, QUESTIONS))
"""The queries of driving, to be lowered for arrays."""


class ScalarTier(SceneTier):
    """Generated code for one scene."""

    name = "scalar"

    def __init__(self, engine: Engine, observation: ObservationSpace) -> None:
        """Lower the program.

        Raises:
            NotLowerable: a rule that only the interpreter can run, with its place and the reason.
        """
        self.observation = observation
        self.asked = questions_of_a_decision(engine)
        queries = [query_of(one, ordered=True) for one in self.asked]
        self._answers = compile_scalar(lower(engine, SCHEMA, queries))
        self._entry = compile_scalar(lower(engine, SCHEMA, [query_of(ENTRY)]))
        self._road: Road | None = None
        self._road_facts: Facts = {}

    def decide_scene(self, scene: Scene) -> Decision:
        """Return the decision about `scene`.

        Raises:
            RuleFailure: the rules gave no usable answer.
            UserError: the rules offer an action that the agent does not know.
            Undecided: only the interpreter can tell.
        """
        return self.decision(scene, self._answers(self._facts(scene)))

    def entry_is_safe(self, scene: Scene) -> bool:
        """Return whether the ego may enter where `scene` places it.

        Raises:
            Undecided: only the interpreter can tell.
        """
        (safe,) = self._entry(self._facts(scene))
        return bool(safe)

    def _facts(self, scene: Scene) -> Facts:
        if scene.road is not self._road:
            self._road_facts = told(road_facts(scene.road))
            self._road = scene.road
        return {**self._road_facts, **told(scene_facts(scene))}


class ArrayTier:
    """Array programs for many scenes at once."""

    def __init__(
        self,
        name: str,
        engine: Engine,
        observation: ObservationSpace,
        compile_program: Callable[[Lowered], BatchProgram[Any]],
    ) -> None:
        """Lower the program, and compile it.

        Raises:
            NotLowerable: a rule that only the interpreter can run, with its place and the reason.
            UserError: the rules can offer an action that the agent does not know.
        """
        self._asked = questions_of_a_decision(engine)
        lowered = lower(engine, SCHEMA, [query_of(one) for one in self._asked])
        _check_forms(lowered, len(observation))
        answers = compile_program(lowered)
        self.name = name
        self._observation = observation
        atoms = answers.choices[query_of(ACTIONS)]
        self._actions = np.array([action_of_atom(atom) for atom in atoms], dtype=np.int64)
        self._low, self._high = np.array(observation.low), np.array(observation.high)
        optional = self._asked[4:]
        self._optional = [optional.index(one) if one in optional else None for one in (LANE, COMFORT)]
        self._answers = SceneProgram(answers)
        self._entry = SceneProgram(compile_program(lower(engine, SCHEMA, [query_of(ENTRY)])))

    def decide_scene(self, scene: Scene) -> Decision:
        """Return the decision about `scene`, a batch of one.

        Raises:
            RuleFailure: a value of the scene is of another kind than its fact has.
            Undecided: only the interpreter can tell.
        """
        decisions, undecided = self.decide(_alone(scene))
        if undecided:
            raise Undecided
        return decisions.one(0)

    def entry_is_safe(self, scene: Scene) -> bool:
        """Return whether the ego may enter where `scene` places it.

        Raises:
            RuleFailure: a value of the scene is of another kind than its fact has.
            Undecided: only the interpreter can tell.
        """
        (safe,), undecided = self.entries_are_safe(_alone(scene))
        if undecided:
            raise Undecided
        return bool(safe)

    def decide(self, scenes: SceneBatch) -> tuple[Decisions, Undecidable]:
        """Return the decision about each scene."""
        found, undecided = self._answers(scenes)
        count = len(scenes)
        actions, speed, state, free, *optional = found
        lane, comfort = (optional[place] if place is not None else None for place in self._optional)
        wishes = np.full(count, NO_WISH) if comfort is None else _floats(comfort.value)
        speeds, numbers = _floats(speed.value), _floats(state.value)
        mask, doubtful = np.empty((count, len(Action)), dtype=np.bool_), np.empty(count, dtype=np.bool_)
        any_doubtful = machine_code(gather)(
            undecided,
            np.ascontiguousarray(actions.value),
            self._actions,
            speeds,
            speed.fails,
            numbers,
            state.fails,
            wishes,
            undecided if comfort is None else comfort.fails,
            undecided if lane is None else lane.fails,
            self._low,
            self._high,
            mask,
            doubtful,
        )
        decisions = Decisions(
            action_mask=mask,
            target_speed=speeds,
            observation=numbers,
            front_is_free=free.value,
            lane_to_keep=scenes.target_lane.copy() if lane is None else np.asarray(lane.value, np.int64),
            comfortable_acceleration=wishes,
            failures={},
        )
        return decisions, doubtful.nonzero()[0].tolist() if any_doubtful else []

    def entries_are_safe(self, scenes: SceneBatch) -> tuple[Mask, Undecidable]:
        """Return whether the ego may enter where each scene places it."""
        (entry,), undecided = self._entry(scenes)
        return entry.value, undecided.nonzero()[0].tolist()


def _alone(scene: Scene) -> SceneBatch:
    """Return the batch of one scene.

    Raises:
        RuleFailure: a value of it is of another kind than its fact has.
    """
    try:
        return SceneBatch.of([scene])
    except (TypeError, ValueError) as error:
        raise RuleFailure(f"a fact cannot be told to the rules: {error}") from error


def _check_forms(lowered: Lowered, observed: int) -> None:
    """Check that the answers are numbers, as many as a decision has, with an observation of so many.

    Raises:
        NotLowerable: they are not, in any scene; the interpreter will report what they are.
    """
    for form in array_forms(lowered)[1:]:
        kinds = [node.kind for node in form.values]
        if form.query == query_of(SPEED) and not (form.plain and kinds[0] in _NUMBERS):
            raise NotLowerable(str(form.query), None, "its answer is no speed in m/s")
        if form.query == query_of(STATE) and (len(kinds) != observed or not _NUMBERS.issuperset(kinds)):
            raise NotLowerable(str(form.query), None, "its answer is no list of numbers")
        if form.query == query_of(COMFORT) and not (form.plain and kinds[0] in _NUMBERS):
            raise NotLowerable(str(form.query), None, "its answer is no acceleration in m/s²")
        if form.query == query_of(LANE) and not (form.plain and kinds[0] == "int"):
            raise NotLowerable(str(form.query), None, "its answer is no lane")


def check_state(engine: Engine, observation: ObservationSpace) -> None:
    """Check that `state/1` gives a number for each name, as far as that can be seen without a scene.

    Raises:
        UserError: it gives a list of another length, something that is no number, or no list.
    """
    try:
        lowered = lower(engine, SCHEMA, [query_of(STATE)])
    except NotLowerable:
        return
    named = engine.defines(NAMES.name, NAMES.arity)
    why = f"one for each name of {NAMES}" if named else f"the paper's, since the program has no {NAMES}"
    for solution in emitted(lowered.answers[0].tree):
        problem = _misfit(solution.terms[0], observation)
        if problem:
            place = engine.clauses(STATE.name, STATE.arity)[0].span or "asserted"
            raise UserError(f"{place}: {STATE} gives {problem}; expected {len(observation)} numbers, {why}")


def _misfit(state: Sym, observation: ObservationSpace) -> str:
    """Return what a solution of `state/1` is instead of a number for each name; nothing if it fits."""
    state = resolve(state)
    if isinstance(state, Bag):
        return ""
    items, rest = [], state
    while isinstance(rest, Struct) and rest.name == "." and len(rest.args) == 2:
        items.append(resolve(rest.args[0]))
        rest = resolve(rest.args[1])
    if rest is not NIL:
        return "" if items and isinstance(rest, Bag) else "no list"
    if len(items) != len(observation):
        return f"a list of {len(items)}"
    for name, item in zip(observation.names, items, strict=True):
        if not (isinstance(item, int | float) or (isinstance(item, Node) and item.kind in _NUMBERS)):
            return f"no number as {name}"
    return ""


def _floats(values: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    """Return numbers as floats, in C order."""
    return np.ascontiguousarray(values, dtype=np.float64)
