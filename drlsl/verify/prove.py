"""Prove properties of a rule program, case by case, or find scenes that break them."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Final, Literal, TypeAlias

from drlsl.errors import UserError
from drlsl.logic.terms import Atom
from drlsl.lowering.frontend import Answer, deep_recursion, lower
from drlsl.lowering.ir import NotLowerable, Pool
from drlsl.verify.confirmation import Counterexample, Replay
from drlsl.verify.floats import Floats, margin_of
from drlsl.verify.names import mentioned, reads_lane_ends
from drlsl.verify.properties import Book, Property, load
from drlsl.verify.ranges import Case
from drlsl.verify.scope import witnesses
from drlsl.verify.smt import (
    FOCUS,
    Algebra,
    Bool,
    Formula,
    Judges,
    KnownAnswers,
    NotTranslatable,
    Outcome,
    Solver,
    SolverChoice,
    SymbolicScene,
)

Status: TypeAlias = Literal["proved", "proved in real arithmetic only", "refuted", "unknown"]
"""The status of a property that a scene breaks by rounding."""

Part: TypeAlias = Literal["broken", "error"]
"""The two ways to refute a property: a scene breaks it, or the rules raise an error on the way."""

MARGINS: Final = (Fraction(1, 10), Fraction(1, 10**4), Fraction(0))
"""Amounts by which a scene must break a property: a clear break is searched first."""

PARTS: Final[tuple[Part, ...]] = ("broken", "error")

USUAL: Final = (2, 1, 0)
"""The kinds of numbers that must have their usual values: speeds too, all others, none."""

FIRST_TRY: Final = 12.0
"""Time for a proof before scenes are searched [s]: most proofs with exact products take less."""

SLOTS: Final = (0.7, 3.0, 12.0, 48.0)
"""Time limit of one attempt at a scene, by round [s]."""


@dataclass(frozen=True, slots=True)
class Finding:
    """The result for a property in one case.

    `confirmed`: the number of proved questions that cvc5 confirmed, `unanswered`: those with one solver's
    answer.
    """

    property: str
    case: Case
    status: Status
    seconds: float
    reason: str = ""
    counterexample: Counterexample | None = None
    confirmed: int = 0
    unanswered: int = 0


@dataclass(frozen=True, slots=True)
class Task:
    """Properties to examine in one case, with up to `vehicles` vehicles besides the ego."""

    case: Case
    properties: tuple[str, ...]
    vehicles: int
    time_limit: float


@dataclass(frozen=True, slots=True)
class Prover:
    """A prepared rule program: its lowered properties, each with a sufficient number of vehicles.

    `refused` gives the reason for each property that cannot be made a formula. `names` has, by property, the
    names of vehicles that the rules or the property compare with, `ends` the properties that depend on where
    lanes end. `known` remembers answers, for cases that ask the same question.
    """

    book: Book
    answers: dict[str, Answer]
    enough: dict[str, int | None]
    refused: dict[str, str]
    names: dict[str, frozenset[Atom]] = field(default_factory=dict)
    ends: set[str] = field(default_factory=set)
    known: KnownAnswers = field(default_factory=KnownAnswers)
    judges: Judges = field(default_factory=Judges)
    _pools: dict[str, Pool] = field(default_factory=dict)
    _replays: dict[str, Replay] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        rules: Sequence[str | Path],
        properties: Sequence[str | Path],
        only: Sequence[str] = (),
        solver: SolverChoice = "z3",
        kept: Path | None = None,
    ) -> Prover:
        """Load the rules and lower their properties: all, or `only` some; `kept` is a file of answers.

        Raises:
            UserError, PrologError: as `drlsl.verify.properties.load`; or there is no such property.
        """
        book = load(rules, properties)
        known = [one.name for one in book.properties]
        for name in only:
            if name not in known:
                raise UserError(f"there is no property {name}; there are {', '.join(known)}")
        prover = cls(book, {}, {}, {}, known=KnownAnswers(kept), judges=Judges(solver))
        for one in book.properties:
            if only and one.name not in only:
                continue
            if one.name in book.missing:
                missing = ", ".join(book.missing[one.name])
                prover.refused[one.name] = f"the rules do not define {missing}"
                continue
            try:
                lowered = lower(book.engine, book.facts, [one.query])
            except NotLowerable as reason:
                prover.refused[one.name] = str(reason)
            else:
                prover.answers[one.name] = answer = lowered.answers[0]
                prover.enough[one.name] = witnesses(answer)
                prover._pools[one.name] = lowered.pool
                roots = [answer.found, answer.undecided]
                prover.names[one.name] = mentioned(roots, FOCUS)
                if reads_lane_ends(roots):
                    prover.ends.add(one.name)
        return prover

    def property(self, name: str) -> Property:
        """Return the property of that name."""
        return next(one for one in self.book.properties if one.name == name)

    def floats(self, name: str, vehicles: int) -> Floats:
        """Return what a proof of a property, with up to `vehicles` vehicles, implies for doubles."""
        with deep_recursion():
            return margin_of(
                self.answers[name], self._pools[name], self.book.ranges, self._most(name, vehicles)
            )

    def run(self, task: Task) -> list[Finding]:
        """Return the findings about each property of a task, with no more vehicles than sufficient."""
        simple: dict[tuple[int, frozenset[Atom], bool], _Translation] = {}
        findings = []
        with deep_recursion():
            for name in task.properties:
                started = time.perf_counter()
                few = replace(task, vehicles=self._most(name, task.vehicles))
                kind = (few.vehicles, self.names[name], name in self.ends)
                if kind not in simple:
                    simple[kind] = _Translation(self, few, name, clears=False)
                before = replace(self.judges)
                finding = self._look(name, few, simple[kind], started)
                confirmed = self.judges.confirmed - before.confirmed
                unanswered = self.judges.unanswered - before.unanswered
                findings.append(replace(finding, confirmed=confirmed, unanswered=unanswered))
        return findings

    def _look(self, name: str, task: Task, simple: _Translation, started: float) -> Finding:
        def found(status: Status, reason: str = "", counterexample: Counterexample | None = None) -> Finding:
            return Finding(name, task.case, status, time.perf_counter() - started, reason, counterexample)

        try:
            left = simple.possible(name, PARTS, task.time_limit)
            if not left:
                return found("proved")
            exact = _Translation(self, task, name, clears=True)
            left = exact.possible(name, left, min(FIRST_TRY, task.time_limit / 2))
            if not left:
                return found("proved")
            # the search and the proof share the remaining time
            search = _Search(self, task, name, started + task.time_limit / 2)
            counterexample = search.scene()
            if counterexample is not None:
                return found("refuted", "", counterexample)
            left = exact.possible(name, left, task.time_limit / 2)
        except NotTranslatable as reason:
            return found("unknown", str(reason))
        if not left:
            return found("proved")
        return found("unknown", _why(left, search, task.time_limit))

    def _most(self, name: str, vehicles: int) -> int:
        """Return the number of vehicles to examine: a sufficient number covers any number."""
        enough = self.enough[name]
        return vehicles if enough is None else min(vehicles, enough)

    def replay(self, name: str) -> Replay:
        """Return the checker of a property's counterexamples."""
        if name not in self._replays:
            self._replays[name] = Replay(self.book.engine, self.property(name), self.book.facts)
        return self._replays[name]


def _why(left: Mapping[Part, Outcome], search: _Search, seconds: float) -> str:
    """Return the reason why there is neither a proof nor a scene."""
    reasons = {outcome.reason for outcome in left.values() if outcome.verdict == "unknown"}
    if search.ran_out or reasons & {"timeout", "canceled"}:
        return f"time limit of {seconds:g} s"
    if reasons:
        return f"the solver gave up: {', '.join(sorted(reasons))}"
    return "the scenes that the solver finds break it only at a rounding limit"


class _Translation:
    """The formulas of one case, made on demand, for a property and others like it.

    Properties are alike if they mention the same names of vehicles, and all or none where lanes end.
    """

    def __init__(self, prover: Prover, task: Task, name: str, *, clears: bool) -> None:
        self._prover = prover
        book = prover.book
        self.scene = SymbolicScene(
            Algebra(clears=clears),
            task.case,
            book.ranges,
            task.vehicles,
            tuple(book.unknowns),
            prover.names[name],
            ends=name in prover.ends,
        )
        self._formula = Formula(self.scene.algebra, self.scene.facts)
        self._linear = Solver(self.scene, linear=True, answers=prover.known, judges=prover.judges)
        self.exact = Solver(self.scene, linear=False, answers=prover.known, judges=prover.judges)
        self._known: dict[Bool, Outcome] = {}

    def truth(self, name: str, part: Part) -> Bool:
        """Return the formula of a part: the property is broken, or the rules raise an error on the way."""
        answer = self._prover.answers[name]
        return self._formula.truth(answer.found if part == "broken" else answer.undecided)

    def possible(self, name: str, parts: Iterable[Part], seconds: float) -> dict[Part, Outcome]:
        """Return the parts of a property's negation that may be true in some scene; none: it is proved."""
        outcomes = {part: self._outcome(self.truth(name, part), seconds) for part in parts}
        return {part: outcome for part, outcome in outcomes.items() if outcome.verdict != "none"}

    def _outcome(self, truth: Bool, seconds: float) -> Outcome:
        known = self._known.get(truth)
        if known is None or known.verdict == "unknown":
            known = self._known[truth] = self._ask(truth, seconds)
        return known

    def _ask(self, truth: Bool, seconds: float) -> Outcome:
        """Ask first with products as free numbers, then with cleared divisions, then exactly."""
        if truth is self.scene.algebra.booleans.false:
            return Outcome("none")
        outcome = self._linear.holds_nowhere(truth, seconds)
        if outcome.verdict == "none" or not self.scene.algebra.clears:
            return outcome
        for one in truth.args if truth.op == "or" else (truth,):
            outcome = self._linear.holds_nowhere(one, seconds)
            if outcome.verdict != "none":
                outcome = self.exact.holds_nowhere(one, seconds)
            if outcome.verdict != "none":
                return outcome
        return Outcome("none")

    def linearly_possible(self, name: str, parts: Iterable[Part], seconds: float) -> list[Part]:
        """Return the parts that hold in some scene if products may be any numbers."""
        false = self.scene.algebra.booleans.false
        truths = {part: self.truth(name, part) for part in parts}
        return [
            part
            for part, truth in truths.items()
            if truth is not false and self._linear.holds_nowhere(truth, seconds).verdict != "none"
        ]


class _Search:
    """Searches a scene that breaks a property: few vehicles first, and usual numbers if possible."""

    def __init__(self, prover: Prover, task: Task, name: str, deadline: float) -> None:
        self._prover = prover
        self._task = task
        self._name = name
        self._deadline = deadline
        self._translations: dict[int, _Translation] = {}
        self._parts: dict[int, list[Part]] = {}

    @property
    def ran_out(self) -> bool:
        """True if the time is up."""
        return time.perf_counter() >= self._deadline

    def scene(self) -> Counterexample | None:
        """Return a confirmed counterexample, if one is found: many short attempts before long ones."""
        hopeless: set[_Attempt] = set()
        for seconds in SLOTS:
            for attempt in self._attempts():
                if self.ran_out:
                    return None
                if attempt in hopeless:
                    continue
                outcome = self._find(attempt, seconds)
                if outcome.verdict != "unknown":
                    hopeless.add(attempt)
                if outcome.model is not None:
                    scene = self._translations[attempt.vehicles].scene
                    found = self._prover.replay(self._name).confirm(scene, outcome.model)
                    if found is not None:
                        return found
        return None

    def _attempts(self) -> Iterator[_Attempt]:
        """Yield all kinds of scenes, the smallest and most usual first."""
        for vehicles in range(self._task.vehicles + 1):
            for part in self._possible(vehicles):
                for usual in USUAL:
                    for margin in MARGINS:
                        yield _Attempt(vehicles, part, usual, margin)

    def _possible(self, vehicles: int) -> list[Part]:
        """Return the ways in which a scene with `vehicles` vehicles may be wrong, by linear arithmetic."""
        if vehicles not in self._parts:
            if self.ran_out:
                return []
            task = replace(self._task, vehicles=vehicles)
            parts: Iterable[Part] = _Translation(self._prover, task, self._name, clears=False).possible(
                self._name, PARTS, self._left()
            )
            if parts:
                translation = self._translations[vehicles] = _Translation(
                    self._prover, task, self._name, clears=True
                )
                parts = translation.linearly_possible(self._name, parts, self._left())
            self._parts[vehicles] = list(parts)
        return self._parts[vehicles]

    def _find(self, attempt: _Attempt, seconds: float) -> Outcome:
        translation = self._translations[attempt.vehicles]
        truth = translation.truth(self._name, attempt.part)
        return translation.exact.find(
            truth, min(seconds, self._left()), margin=attempt.margin, usual=attempt.usual
        )

    def _left(self) -> float:
        return max(0.001, self._deadline - time.perf_counter())


@dataclass(frozen=True, slots=True)
class _Attempt:
    """The kind of scene that is searched."""

    vehicles: int
    part: Part
    usual: int
    margin: Fraction
