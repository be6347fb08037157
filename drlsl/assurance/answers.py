"""Ask each tier the same questions; answers are solutions by the goal's variables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final, Protocol

from drlsl.assurance.checks import Case
from drlsl.assurance.tested_rules import Question, Solutions, State, TestedRules
from drlsl.driving.shield import LIMITS
from drlsl.errors import UserError
from drlsl.logic import LimitExceeded, Limits, PrologError
from drlsl.logic import Query as Goal
from drlsl.logic.core import Clause
from drlsl.logic.terms import Atom, Struct, Term
from drlsl.lowering.backends import Scalar, compile_scalar
from drlsl.lowering.frontend import Query, lower
from drlsl.lowering.ir import Undecided
from drlsl.shield import RuleFailure

WRONG: Final = (PrologError, LimitExceeded, RuleFailure, UserError)
"""Exceptions of faulty rules when they are queried; the message gives the reason."""


class Asker(Protocol):
    """A tier that answers questions about states."""

    def ask(self, state: State, question: Question) -> Solutions:
        """Return as many solutions as the question needs; raise one of `WRONG` if the rules do."""


class Interpreter:
    """Asks the interpreter."""

    def __init__(self, rules: TestedRules, limits: Limits = LIMITS) -> None:
        self._rules = rules
        self._limits = limits
        self._goals: dict[str, Goal] = {}
        self._state: State = None

    def ask(self, state: State, question: Question) -> Solutions:
        """Return the solutions of the question in a state."""
        if state is not self._state:
            self._state = None
            self._rules.tell(state)
            self._state = state
        goal = self._goals.get(question.goal)
        if goal is None:
            goal = self._goals[question.goal] = self._rules.engine.prepare(question.goal)
        if question.mode in _SEVERAL:
            found = list(goal.solutions(self._limits))
            return found if question.mode == "all" else _distinct(found)
        first = goal.once(self._limits)
        return [] if first is None else [first]


class Generated:
    """Runs code that was generated for one state; states that it leaves undecided go to the interpreter."""

    def __init__(self, rules: TestedRules, otherwise: Asker) -> None:
        self._rules = rules
        self._otherwise = otherwise
        self._programs: dict[Question, tuple[Scalar, tuple[str, ...]]] = {}

    def prepare(self, question: Question) -> None:
        """Generate the code for a question.

        Raises:
            NotLowerable: only the interpreter can answer it.
        """
        if question in self._programs:
            return
        engine = self._rules.engine
        read = engine.read_goal(question.goal)
        shown = {name: variable for name, variable in read.variables.items() if not name.startswith("_")}
        head: Term = Struct(_GOAL, tuple(shown.values())) if shown else Atom(_GOAL)
        engine.define(_GOAL, len(shown), [Clause(head, read.term)])
        mode = question.mode if shown else "holds"
        program = compile_scalar(lower(engine, self._rules.schema, [Query(_GOAL, len(shown), mode)]))
        self._programs[question] = program, tuple(shown)

    def ask(self, state: State, question: Question) -> Solutions:
        """Return the solutions of a prepared question."""
        program, names = self._programs[question]
        try:
            (answer,) = program(self._rules.facts(state))
        except Undecided:
            return self._otherwise.ask(state, question)
        if not names or question.mode == "holds":
            return [{}] if answer else []
        rows: Sequence[Any] = answer if question.mode in _SEVERAL else [] if answer is None else [answer]
        return [dict(zip(names, row if len(names) > 1 else (row,), strict=True)) for row in rows]


_SEVERAL: Final = ("all", "set")
_GOAL: Final = "$table_goal"


def problem_of(asker: Asker, case: Case, check_index: int) -> str | None:
    """Return the error in the answer to one check of a case; None if it is right."""
    check = case.checks[check_index]
    try:
        found = asker.ask(case.state, check.question)
    except WRONG as error:
        return f"expected {check.expected()}, got an error: {first_line(error)}"
    return check.problem(found)


def first_line(error: BaseException) -> str:
    """Return the first line of an error's message."""
    return (str(error).splitlines() or [type(error).__name__])[0]


def decision_problem(rules: TestedRules, case: Case) -> str | None:
    """Return the error of the decision as a whole: it fails, or should fail and does not."""
    return failure_problem(case, rules.failure(case.state))


def failure_problem(case: Case, failure: str | None) -> str | None:
    """Return the problem with a decision's failure, or with a decision (None) where one was expected."""
    wanted = "a decision" if case.fails is None else f"the failure {case.fails!r}"
    if failure is None:
        return None if case.fails is None else f"expected {wanted}, got a decision"
    if case.fails is not None and case.fails in failure:
        return None
    return f"expected {wanted}, got a failure: {failure.splitlines()[0]}"


def _distinct(found: Sequence[Mapping[str, Any]]) -> Solutions:
    return [one for place, one in enumerate(found) if one not in found[:place]]
