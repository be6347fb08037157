"""Find the clauses and branches of a rule program that its tables reach, with an instrumented copy.

The copy has a goal ``nb_setval(Point, true)`` at each point, so the solver needs no change.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from drlsl.assurance.answers import WRONG, Interpreter
from drlsl.assurance.checks import Case
from drlsl.assurance.clause_text import ClauseText, clause_texts
from drlsl.assurance.tested_rules import TestedRules
from drlsl.logic import Engine, core
from drlsl.logic.builtins import split_clause
from drlsl.logic.terms import TRUE, Atom, Struct, Term

_FAIL: Final = Atom("fail")
_POINT: Final = "$covered"


@dataclass(frozen=True)
class Point:
    """A point that tests of the rules should reach: `what` happens, and its position.

    `what` is "clause" for a clause that answers, else the branch that is taken.
    """

    what: str
    predicate: str
    clause: int
    file: str
    line: int
    column: int

    @property
    def is_clause(self) -> bool:
        """True for a clause, False for a branch inside one."""
        return self.what == CLAUSE

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}: {self.predicate} clause {self.clause}: {self.what}"


CLAUSE: Final = "answers"


@dataclass(frozen=True)
class Coverage:
    """The points of a program that were reached, and those that were not."""

    reached: tuple[Point, ...]
    missed: tuple[Point, ...]

    def share(self, *, clauses: bool) -> tuple[int, int]:
        """Return the numbers of clauses, or else branches, that were reached, and of all."""
        reached = sum(point.is_clause == clauses for point in self.reached)
        return reached, reached + sum(point.is_clause == clauses for point in self.missed)


class Instrumented:
    """An engine whose program records the points that it reaches; the program is changed in place."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._globals = engine.globals
        self.points: list[Point] = []
        self.sources: list[str | None] = []
        self._entries: list[ClauseText] = []
        for text in clause_texts(engine):
            predicate = text.clause.predicate
            clauses = list(predicate.clauses)
            clauses[text.number - 1] = self._instrumented(text)
            predicate.replace(clauses)

    def begin(self) -> None:
        """Forget the points that were reached."""
        for key in [key for key in self._globals if key.startswith(_POINT)]:
            del self._globals[key]
        self._engine.forget_answers()  # so that the clauses of tabled predicates are run again

    def reached(self) -> set[int]:
        """Return the indexes of the points reached since `begin`."""
        return {int(key.split()[2]) for key in self._globals if key.startswith(f"{_POINT} point")}

    def entered(self) -> set[tuple[str, int]]:
        """Return the clauses, by predicate and number, whose heads matched since `begin`."""
        found = (key.split()[2] for key in self._globals if key.startswith(f"{_POINT} entry"))
        return {(self._entries[int(n)].predicate, self._entries[int(n)].number) for n in found}

    def _instrumented(self, text: ClauseText) -> core.Clause:
        clause = text.clause
        self._entries.append(text)
        entry = _note(f"entry {len(self._entries) - 1}")
        end = self._point(CLAUSE, text)
        body = self._goal(core.body_of(clause), text)
        head, body = split_clause(Struct(":-", (clause.head, _all_of(entry, body, end))))
        return core.Clause(head, body, clause.span, clause.names, clause.source, clause.origin)

    def _point(self, what: str, text: ClauseText, goal: core.Goal | None = None) -> Term:
        """Return a goal that records a point, where another goal stands or at the clause itself."""
        place = goal.place if goal is not None and goal.place is not None else text.clause.span
        self.points.append(Point(what, text.predicate, text.number, place.name, place.line, place.column))
        self.sources.append(text.clause.source)
        return _note(f"point {len(self.points) - 1}")

    def _goal(self, goal: core.Goal, text: ClauseText) -> Term:
        """Return a goal as it is written, with points in it."""
        match goal:
            case core.Conjunction(goals):
                return _all_of(*(self._goal(part, text) for part in goals))
            case core.Disjunction(first, second):
                arms = (
                    _all_of(self._goal(arm, text), self._point("alternative", text, arm))
                    for arm in (first, second)
                )
                return Struct(";", tuple(arms))
            case core.IfThenElse():
                return self._branches(goal, text)
            case core.Negation(inner):
                # It records both outcomes and binds nothing, as before.
                found = _all_of(self._point("negation fails", text, inner), _FAIL)
                none = self._point("negation holds", text, inner)
                return Struct(";", (Struct("->", (self._goal(inner, text), found)), none))
            case core.Opaque(inner) | core.Findall(_, inner):
                return self._calling(goal.term, [inner], text)
            case core.Derived(goals):
                return self._calling(goal.term, goals, text)
            case core.Call():
                places = core.GOAL_ARGUMENTS.get((goal.name, len(goal.args)), ())
                origin = text.clause.origin
                given = [core.read_body(goal.args[place], goal.place, origin) for place in places]
                return self._calling(goal.term, given, text)
        return goal.term

    def _calling(self, term: Term, goals: Sequence[core.Goal], text: ClauseText) -> Term:
        """Return a goal with points in the goals that it is given."""
        if type(term) is not Struct or not goals:
            return term
        args = list(term.args)
        for place, goal in zip(core.GOAL_ARGUMENTS[term.name, len(args)], goals, strict=True):
            args[place] = self._goal(goal, text)
        return Struct(term.name, tuple(args))

    def _branches(self, goal: core.IfThenElse, text: ClauseText) -> Term:
        has_else = goal.otherwise is not core.FAILURE
        otherwise = None
        if has_else:
            otherwise = _all_of(self._point("else", text, goal.otherwise), self._goal(goal.otherwise, text))
        then = _all_of(self._point("then", text, goal.then), self._goal(goal.then, text))
        chosen = Struct("*->" if goal.soft else "->", (self._goal(goal.condition, text), then))
        return chosen if otherwise is None else Struct(";", (chosen, otherwise))


def _note(key: str) -> Term:
    return Struct("nb_setval", (Atom(f"{_POINT} {key}"), TRUE))


def _all_of(*goals: Term) -> Term:
    result = goals[-1]
    for goal in reversed(goals[:-1]):
        result = result if goal is TRUE else Struct(",", (goal, result))
    return result


Traces = Mapping[tuple[int, int], frozenset[tuple[str, int]]]
"""The clauses whose heads matched, by the index of the case and of its check."""


def measure(rules: TestedRules, cases: Sequence[Case]) -> tuple[Coverage, Traces]:
    """Run the checks of all cases on the interpreter, on a copy of the program.

    Returns:
        The coverage, of the whole program or of its `files` and the files they include, and the clauses that
        each check tried.
    """
    copied = rules.fresh()
    noted = Instrumented(copied.engine)
    asker = Interpreter(copied)
    reached: set[int] = set()
    traces = {}
    for index, case in enumerate(cases):
        for number, check in enumerate(case.checks):
            noted.begin()
            try:
                asker.ask(case.state, check.question)
            except WRONG:
                continue
            finally:
                reached |= noted.reached()
                traces[index, number] = frozenset(noted.entered())
    wanted = set(map(str, rules.files))
    counted = [n for n, source in enumerate(noted.sources) if source in wanted or not wanted]
    hits = tuple(noted.points[n] for n in counted if n in reached)
    missed = tuple(noted.points[n] for n in counted if n not in reached)
    return Coverage(hits, missed), traces
