"""Test whether tables notice the mutants of a rule program."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import partial
from typing import Any, Final

from drlsl.assurance.answers import (
    WRONG,
    Asker,
    Generated,
    Interpreter,
    decision_problem,
    first_line,
    problem_of,
)
from drlsl.assurance.checks import Case
from drlsl.assurance.clause_text import ClauseText, clause_texts
from drlsl.assurance.coverage import Traces, measure
from drlsl.assurance.mutants import Mutant, mutants_of
from drlsl.assurance.tested_rules import Question, TestedRules
from drlsl.assurance.witness import Search, Witness, changed
from drlsl.errors import UserError
from drlsl.logic import Engine, Limits, PrologError
from drlsl.logic.builtins import split_clause
from drlsl.logic.core import Clause
from drlsl.logic.syntax import read_term
from drlsl.logic.terms import names
from drlsl.lowering.ir import NotLowerable
from drlsl.workers import ALONE, Crew, Function, in_order

LIMITS: Final = Limits(inferences=300_000)
"""Limits of one query of a mutant; the rules need a hundredth of it."""

_FIRST: Final = 12
"""Checks that the interpreter makes before code is generated for a mutant."""

_WORTHWHILE: Final = 8
"""Number of checks of the same question from which on generated code is faster."""

_WITNESSES: Final = 10
"""Number of survivors for which a state is searched; each takes a few seconds."""

Key = tuple[int, int]


@dataclass(frozen=True)
class Verdict:
    """The verdict on a mutant: its place, its change, and the check that noticed it; None if none did."""

    name: str
    kind: str
    place: str
    before: str
    after: str
    killed_by: str | None


@dataclass(frozen=True)
class Score:
    """The verdicts on all mutants of a program.

    `reasons` explain survivors, by their names; `witnesses` have a state for the first ones without a
    reason, or None if none was found.
    """

    verdicts: tuple[Verdict, ...]
    reasons: Mapping[str, str]
    witnesses: Mapping[str, Witness | None]

    @property
    def killed(self) -> int:
        """The number of mutants that were noticed."""
        return sum(verdict.killed_by is not None for verdict in self.verdicts)

    @property
    def survivors(self) -> list[Verdict]:
        """The mutants that were not noticed."""
        return [verdict for verdict in self.verdicts if verdict.killed_by is None]

    @property
    def unexplained(self) -> list[Verdict]:
        """The survivors that have no reason."""
        return [verdict for verdict in self.survivors if verdict.name not in self.reasons]

    @property
    def share(self) -> float:
        """Killed over all mutants, survivors with a reason included, from 0 to 1."""
        return self.killed / len(self.verdicts) if self.verdicts else 1.0


class TiersDisagree(Exception):
    """Generated code and the interpreter answer differently: a fault of DRLSL, not of the rules."""


class MutantTester:
    """Puts mutants into the files of a program, one after the other, and runs the tables on each.

    Rules that the files build on, by ensure_loaded/1, are left unchanged.
    """

    def __init__(self, rules: TestedRules, cases: Sequence[Case]) -> None:
        self._rules = rules.fresh()
        self._engine: Engine = self._rules.engine
        self._cases = cases
        self._traces: Traces = measure(rules, cases)[1]
        self._reach = _Reach(self._engine)
        self._interpreter = Interpreter(self._rules, LIMITS)
        self.clauses: Final = clause_texts(self._engine, rules.files)
        self.mutants: Final = mutants_of(self.clauses)
        self._lucky: list[Key] = []

    def test_clause(self, number: int) -> list[Verdict]:
        """Return the verdicts on all mutants of one clause."""
        clause = self.clauses[number]
        self._lucky = []
        return [self.verdict(mutant) for mutant in self.mutants if mutant.clause is clause]

    def verdict(self, mutant: Mutant) -> Verdict:
        """Put a mutant in, run checks until one fails, and take it out again."""
        killed_by: str | None
        try:
            with self.mutated(mutant):
                killed_by = self._killer(mutant.clause)
        except PrologError as error:
            killed_by = f"not a clause: {first_line(error)}"
        except TiersDisagree as fault:
            raise TiersDisagree(f"{mutant.name}: {fault}") from fault
        return Verdict(mutant.name, mutant.kind, mutant.place, mutant.before, mutant.after, killed_by)

    @contextmanager
    def mutated(self, mutant: Mutant) -> Iterator[TestedRules]:
        """Put the slip into the program while the context lasts.

        Raises:
            PrologError: the changed text is not a clause.
        """
        predicate = mutant.clause.clause.predicate
        before, clauses = list(predicate.clauses), _mutated(mutant, self._engine)
        predicate.replace(clauses)
        predicate.defined = bool(clauses) or predicate.dynamic
        try:
            yield self._rules
        finally:
            predicate.replace(before)

    def witness(self, mutant: Mutant) -> Witness | None:
        """Return a state similar to the tables' in which the mutant's answer differs from the rules'."""
        name = mutant.clause.clause.predicate.name
        usual = (question for question in self._rules.usual if self._reach.reaches(question, name))
        questions = dict.fromkeys([*usual, *map(self._question, self._relevant(mutant.clause))])
        stagings = [case.staging for case in self._cases if case.staging is not None]
        search = Search(self._interpreter, list(questions), changed(stagings))
        with self.mutated(mutant):
            search.note()
        return search.difference()

    def _killer(self, clause: ClauseText) -> str | None:
        """Return the first check that fails, by place and question."""
        keys = self._relevant(clause)
        for key in keys[:_FIRST]:
            if self._problem(self._interpreter, key) is not None:
                return self._noticed(key)
        generated = Generated(self._rules, self._interpreter)
        by_question: dict[Question, list[Key]] = {}
        for key in keys[_FIRST:]:
            by_question.setdefault(self._question(key), []).append(key)
        for question, group in by_question.items():
            quickly = len(group) >= _WORTHWHILE and _can(generated, question)
            for key in group:
                problem = self._problem(generated if quickly else self._interpreter, key)
                if problem is None:
                    continue
                if quickly and self._problem(self._interpreter, key) is None:
                    raise TiersDisagree(f"{self._words(key)}: right on the interpreter, on scalar {problem}")
                return self._noticed(key)
        for case in self._cases:
            if case.fails is not None and decision_problem(self._rules, case) is not None:
                return f"{case.place} decision"
        return None

    def _problem(self, asker: Asker, key: Key) -> str | None:
        return problem_of(asker, self._cases[key[0]], key[1])

    def _relevant(self, clause: ClauseText) -> list[Key]:
        """Return the checks that may depend on a clause, likely ones first.

        First those that noticed mutants of this clause before, then those that tried it, then those that
        tried another clause of its predicate. Checks that cannot reach the predicate are left out.
        """
        own, predicate = (clause.predicate, clause.number), clause.predicate
        name = clause.clause.predicate.name

        def rank(key: Key) -> tuple[int, Key]:
            tried = self._traces[key]
            if own in tried:
                return 0, key
            return (1, key) if any(other == predicate for other, _ in tried) else (2, key)

        keys = [
            (case, check)
            for case in range(len(self._cases))
            for check in range(len(self._cases[case].checks))
            if self._reach.reaches(self._question((case, check)), name)
        ]
        return list(dict.fromkeys([*self._lucky, *sorted(keys, key=rank)]))

    def _question(self, key: Key) -> Question:
        return self._cases[key[0]].checks[key[1]].question

    def _noticed(self, key: Key) -> str:
        self._lucky = [key, *(other for other in self._lucky if other != key)]
        return self._words(key)

    def _words(self, key: Key) -> str:
        case = self._cases[key[0]]
        return f"{case.place} {case.checks[key[1]].what}"


def _can(generated: Generated, question: Question) -> bool:
    try:
        generated.prepare(question)
    except (NotLowerable, *WRONG):
        return False
    return True


def _mutated(mutant: Mutant, engine: Engine) -> list[Clause]:
    """Return the clauses of the mutant's predicate."""
    old = mutant.clause.clause
    clauses = list(old.predicate.clauses)
    at = mutant.clause.number - 1
    if mutant.swapped is not None:
        clauses[at], clauses[at + 1] = clauses[at + 1], clauses[at]
    elif mutant.text is None:
        del clauses[at]
    else:
        read = read_term(mutant.text, engine.operators, engine.flags, mutant.clause.source.name)
        head, body = split_clause(read.term)
        clauses[at] = Clause(head, body, old.span, read.variables, old.source, read)
    return clauses


class _Reach:
    """The predicates that a question can call, by names: a superset, since every atom and functor counts."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._names: dict[str, set[str]] = {}
        for name, arity in engine.predicates():
            known = self._names.setdefault(name, set())
            known.update(each for clause in engine.clauses(name, arity) for each in names(clause.body))
        self._known: dict[Question, frozenset[str]] = {}

    def reaches(self, question: Question, name: str) -> bool:
        """Return whether the question may call a predicate of that name."""
        known = self._known.get(question)
        if known is None:
            goal = self._engine.read_goal(question.goal).term
            known = self._known[question] = self._closure(set(names(goal)))
        return name in known

    def _closure(self, called: set[str]) -> frozenset[str]:
        todo = list(called)
        while todo:
            for name in self._names.get(todo.pop(), set()) - called:
                called.add(name)
                todo.append(name)
        return frozenset(called)


def score(
    rules: TestedRules,
    cases: Sequence[Case],
    reasons: Mapping[str, str] | None = None,
    *,
    crew: Crew = ALONE,
) -> Score:
    """Have a crew test every mutant of a program with cases that the program itself passes.

    The program and the cases travel with the work; whoever does it, the score is the same.

    Raises:
        UserError: a name in `reasons` is not that of a survivor; or as `Crew.perform`.
    """
    perform = partial(crew.perform, partial(_testing, rules, cases))
    clauses = range(len(clause_texts(rules.engine, rules.files)))
    verdicts = tuple(verdict for some in in_order(perform(clauses)) for verdict in some)
    result = Score(verdicts, reasons or {}, {})
    _refuse_stale(result)
    searched = [verdict.name for verdict in result.unexplained[:_WITNESSES]]
    found = in_order(perform(searched)) if searched else ()
    return replace(result, witnesses=dict(zip(searched, found, strict=True)))


def _testing(rules: TestedRules, cases: Sequence[Case]) -> Function[int | str, Any]:
    """Return what tests the mutants of a clause, or searches a witness for a mutant by its name."""
    tester = MutantTester(rules, cases)
    by_name = {mutant.name: mutant for mutant in tester.mutants}
    return lambda task, _stop: (
        tester.test_clause(task) if isinstance(task, int) else tester.witness(by_name[task])
    )


def _refuse_stale(found: Score) -> None:
    """Refuse a reason for a mutant that is not a survivor: it hides the mutant it was written for."""
    verdicts = {verdict.name: verdict for verdict in found.verdicts}
    for name in found.reasons:
        verdict = verdicts.get(name)
        if verdict is None:
            near = get_close_matches(name, verdicts, 1)
            hint = f"; did you mean {near[0]!r}" if near else ""
            raise UserError(f"a reason is given for the mutant {name!r}, which does not exist{hint}")
        if verdict.killed_by is not None:
            raise UserError(
                f"a reason is given for {name!r}, but {verdict.killed_by} notices it: take it out"
            )
