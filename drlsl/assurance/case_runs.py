"""Run the cases of tables on every tier."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from drlsl.assurance.answers import Generated, Interpreter, decision_problem, failure_problem, problem_of
from drlsl.assurance.checks import Case
from drlsl.assurance.tested_rules import Question, TestedRules
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


def run_cases(rules: TestedRules, cases: Sequence[Case], arrays: Sequence[str] = ("numpy",)) -> Outcome:
    """Run cases on the interpreter, on code for one state, and on these tiers for arrays of states."""
    outcome = Outcome(cases=len(cases))
    wrong: dict[tuple[int, str, str], list[str]] = {}
    for tier, results in (
        ("interpreter", _interpreted(rules, cases)),
        ("scalar", _generated(rules, cases, outcome)),
        *((tier, _arrays(rules, cases, outcome, tier)) for tier in arrays),
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


def _interpreted(rules: TestedRules, cases: Sequence[Case]) -> Iterator[Result]:
    asker = Interpreter(rules)
    for index, case in enumerate(cases):
        yield index, "decision", decision_problem(rules, case)
    for index, case in enumerate(cases):
        for number, check in enumerate(case.checks):
            yield index, check.what, problem_of(asker, case, number)


def _generated(rules: TestedRules, cases: Sequence[Case], outcome: Outcome) -> Iterator[Result]:
    asker = Generated(rules, Interpreter(rules))
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


def _arrays(rules: TestedRules, cases: Sequence[Case], outcome: Outcome, tier: str) -> Iterator[Result]:
    """Yield the answers to the usual questions, for all states at once."""
    try:
        found = list(rules.on_arrays(tier, [case.state for case in cases]))
    except UserError as reason:
        outcome.notes.append(str(reason))
        return
    for index, (case, answered) in enumerate(zip(cases, found, strict=True)):
        if case.fails is not None or answered.failure is not None:
            yield index, "decision", failure_problem(case, answered.failure)
            continue
        for check in case.checks:
            if check.question in answered.answers:
                yield index, check.what, check.problem(answered.answers[check.question])
