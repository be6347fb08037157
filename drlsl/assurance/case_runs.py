"""Run the cases of tables on every tier."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from drlsl.assurance.answers import Generated, Interpreter, decision_problem, failure_problem, problem_of
from drlsl.assurance.checks import (
    ACTIONS,
    COMFORT,
    ENTRY,
    FRONT,
    LANE,
    OBSERVATION,
    SPEED,
    Case,
    Question,
    Solutions,
)
from drlsl.driving.scene import ATOMS, SceneBatch
from drlsl.driving.shield import Decisions, Shield
from drlsl.errors import UserError
from drlsl.logic import PrologError
from drlsl.lowering.ir import NotLowerable


@dataclass(frozen=True)
class Failure:
    """A wrong answer: its row, case and question, the error, and the tiers."""

    place: str
    case: str
    what: str
    problem: str
    tiers: tuple[str, ...]


@dataclass
class Outcome:
    """The results of running tables: `answers` counts checks by tier, `notes` list what tiers cannot run."""

    cases: int = 0
    answers: dict[str, int] = field(default_factory=dict)
    failures: list[Failure] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def run_cases(shield: Shield, cases: Sequence[Case], arrays: Sequence[str] = ("numpy",)) -> Outcome:
    """Run cases on the interpreter, on code for one scene, and on these tiers for arrays of scenes."""
    outcome = Outcome(cases=len(cases))
    wrong: dict[tuple[int, str, str], list[str]] = {}
    for tier, results in (
        ("interpreter", _interpreted(shield, cases)),
        ("scalar", _generated(shield, cases, outcome)),
        *((tier, _arrays(shield, cases, outcome, tier)) for tier in arrays),
    ):
        for index, what, problem in results:
            outcome.answers[tier] = outcome.answers.get(tier, 0) + 1
            if problem is not None:
                wrong.setdefault((index, what, problem), []).append(tier)
    for (index, what, problem), tiers in sorted(wrong.items()):
        case = cases[index]
        outcome.failures.append(Failure(case.place, case.name, what, problem, tuple(tiers)))
    return outcome


Result = tuple[int, str, str | None]


def _interpreted(shield: Shield, cases: Sequence[Case]) -> Iterator[Result]:
    asker = Interpreter(shield)
    for index, case in enumerate(cases):
        yield index, "decision", decision_problem(shield, case)
    for index, case in enumerate(cases):
        for number, check in enumerate(case.checks):
            yield index, check.what, problem_of(asker, case, number)


def _generated(shield: Shield, cases: Sequence[Case], outcome: Outcome) -> Iterator[Result]:
    asker = Generated(shield.engine, Interpreter(shield))
    able: dict[Question, bool] = {}
    for index, case in enumerate(cases):
        for number, check in enumerate(case.checks):
            if check.question not in able:
                able[check.question] = _prepares(asker, check.question, outcome)
            if able[check.question]:
                yield index, check.what, problem_of(asker, case, number)


def _prepares(asker: Generated, question: Question, outcome: Outcome) -> bool:
    try:
        asker.prepare(question)
    except NotLowerable as reason:
        outcome.notes.append(f"only the interpreter answers {question.goal}: {reason.reason}")
        return False
    except PrologError:  # it is not a goal; the interpreter reports that for each row that asks it
        return False
    return True


def _arrays(shield: Shield, cases: Sequence[Case], outcome: Outcome, name: str) -> Iterator[Result]:
    """Yield the answers to the questions of driving, for all scenes at once."""
    try:
        tested = shield.with_tier(name)
    except UserError as reason:
        outcome.notes.append(str(reason))
        return
    batch = SceneBatch.of([case.scene for case in cases])
    decisions, entries = tested.decide_batch(batch), tested.entries_are_safe(batch)
    for index, case in enumerate(cases):
        failure = decisions.failures.get(index)
        if case.fails is not None or failure is not None:
            yield index, "decision", failure_problem(case, failure)
            continue
        answers = _answers(decisions, entries, index)
        for check in case.checks:
            if check.question in answers:
                yield index, check.what, check.problem(answers[check.question])


def _answers(decisions: Decisions, entries: Sequence[bool], index: int) -> Mapping[Question, Solutions]:
    """Return one scene's decision as the solutions of the corresponding goals."""
    offered: list[Any] = [atom for atom, on in zip(ATOMS, decisions.action_mask[index], strict=True) if on]
    holds: Final[list[Mapping[str, Any]]] = [{}]
    return {
        ACTIONS: [{"Action": atom} for atom in offered],
        SPEED: [{"Speed": float(decisions.target_speed[index])}],
        OBSERVATION: [{"Observation": decisions.observation[index].tolist()}],
        FRONT: holds if decisions.front_is_free[index] else [],
        ENTRY: holds if entries[index] else [],
        LANE: [{"Lane": int(decisions.lane_to_keep[index])}],
        COMFORT: [{"Acceleration": float(decisions.comfortable_acceleration[index])}],
    }
