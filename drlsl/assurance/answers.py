"""Ask each tier the same questions; answers are solutions by the goal's variables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, Protocol

from drlsl.assurance.checks import Case, Question, Solutions
from drlsl.driving.scene import SCHEMA, Facts, Road, Scene, road_facts, scene_facts
from drlsl.driving.shield import LIMITS, RuleFailure, Shield
from drlsl.errors import UserError
from drlsl.logic import Engine, LimitExceeded, Limits, PrologError
from drlsl.logic import Query as Goal
from drlsl.logic.core import Clause
from drlsl.logic.terms import Atom, Struct, Term
from drlsl.lowering.backends import Scalar, compile_scalar
from drlsl.lowering.frontend import Query, lower
from drlsl.lowering.ir import Undecided

WRONG: Final = (PrologError, LimitExceeded, RuleFailure, UserError)
"""Exceptions of faulty rules when they are queried; the message gives the reason."""


class Asker(Protocol):
    """A tier that answers questions about scenes."""

    def ask(self, scene: Scene, question: Question) -> Solutions:
        """Return as many solutions as the question needs; raise one of `WRONG` if the rules do."""


class Interpreter:
    """Asks the interpreter."""

    def __init__(self, shield: Shield, limits: Limits = LIMITS) -> None:
        self._shield = shield
        self._limits = limits
        self._goals: dict[str, Goal] = {}
        self._scene: Scene | None = None

    def ask(self, scene: Scene, question: Question) -> Solutions:
        """Return the solutions of the question in a scene."""
        if scene is not self._scene:
            self._scene = None
            self._shield.state_facts(scene)
            self._scene = scene
        goal = self._goals.get(question.goal)
        if goal is None:
            goal = self._goals[question.goal] = self._shield.engine.prepare(question.goal)
        if question.mode == "all":
            return list(goal.solutions(self._limits))
        first = goal.once(self._limits)
        return [] if first is None else [first]


class Generated:
    """Runs code that was generated for one scene; scenes that it leaves undecided go to the interpreter."""

    def __init__(self, engine: Engine, otherwise: Asker) -> None:
        self._engine = engine
        self._otherwise = otherwise
        self._programs: dict[Question, tuple[Scalar, tuple[str, ...]]] = {}
        self._road: Road | None = None
        self._road_facts: Facts = {}

    def prepare(self, question: Question) -> None:
        """Generate the code for a question.

        Raises:
            NotLowerable: only the interpreter can answer it.
        """
        if question in self._programs:
            return
        read = self._engine.read_goal(question.goal)
        shown = {name: variable for name, variable in read.variables.items() if not name.startswith("_")}
        head: Term = Struct(_GOAL, tuple(shown.values())) if shown else Atom(_GOAL)
        self._engine.define(_GOAL, len(shown), [Clause(head, read.term)])
        mode = question.mode if shown else "holds"
        program = compile_scalar(lower(self._engine, SCHEMA, [Query(_GOAL, len(shown), mode)]))
        self._programs[question] = program, tuple(shown)

    def ask(self, scene: Scene, question: Question) -> Solutions:
        """Return the solutions of a prepared question."""
        program, names = self._programs[question]
        if scene.road is not self._road:
            self._road, self._road_facts = scene.road, road_facts(scene.road)
        try:
            (answer,) = program({**self._road_facts, **scene_facts(scene)})
        except Undecided:
            return self._otherwise.ask(scene, question)
        if not names or question.mode == "holds":
            return [{}] if answer else []
        rows: Sequence[Any] = answer if question.mode == "all" else [] if answer is None else [answer]
        return [dict(zip(names, row if len(names) > 1 else (row,), strict=True)) for row in rows]


_GOAL: Final = "$table_goal"


def problem_of(asker: Asker, case: Case, check_index: int) -> str | None:
    """Return the error in the answer to one check of a case; None if it is right."""
    check = case.checks[check_index]
    try:
        found = asker.ask(case.scene, check.question)
    except WRONG as error:
        return f"expected {check.expected()}, got an error: {first_line(error)}"
    return check.problem(found)


def first_line(error: BaseException) -> str:
    """Return the first line of an error's message."""
    return (str(error).splitlines() or [type(error).__name__])[0]


def decision_problem(shield: Shield, case: Case) -> str | None:
    """Return the error of the decision as a whole: it fails, or should fail and does not."""
    try:
        shield.decide(case.scene)
    except (RuleFailure, UserError) as failure:
        return failure_problem(case, first_line(failure))
    return failure_problem(case, None)


def failure_problem(case: Case, failure: str | None) -> str | None:
    """Return the problem with a decision's failure, or with a decision (None) where one was expected."""
    wanted = "a decision" if case.fails is None else f"the failure {case.fails!r}"
    if failure is None:
        return None if case.fails is None else f"expected {wanted}, got a decision"
    if case.fails is not None and case.fails in failure:
        return None
    return f"expected {wanted}, got a failure: {failure.splitlines()[0]}"
