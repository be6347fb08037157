"""Proofs over all sets of facts that a file of properties declares, for rules of any environment."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, Final
from zlib import crc32

import numpy as np

from drlsl.driving.shield import LIMITS
from drlsl.errors import UserError
from drlsl.logic import LimitExceeded, PrologError
from drlsl.lowering.backends import compile_numpy, compile_scalar
from drlsl.lowering.frontend import Answer, Lowered, deep_recursion, lower
from drlsl.lowering.ir import NotLowerable, Undecided
from drlsl.verify.attack import Closeness
from drlsl.verify.floats import Columns, Floats, between, margin_of
from drlsl.verify.properties import Book, Property, load
from drlsl.verify.prove import MARGINS, Status
from drlsl.verify.report import IN_REAL_ARITHMETIC, Request
from drlsl.verify.scope import rows_needed
from drlsl.verify.smt import (
    Algebra,
    Bool,
    Booleans,
    Formula,
    Judges,
    KnownAnswers,
    NotTranslatable,
    Outcome,
    Solver,
)
from drlsl.verify.told.declared import Declared, Key, undeclared
from drlsl.verify.told.drawn_facts import Drawer, Sets, floats_of
from drlsl.verify.told.symbolic_facts import Rows, SymbolicFacts

_DIGITS: Final = (2, 4, 8, None)
_BATCH: Final = 2048
_DRAWN: Final = 0.5
_CLOSE: Final = 1e-3
_MOST_HITS: Final = 16
_SUSPECTS_OF_A_BATCH: Final = 4
_MOST_SUSPECTS: Final = 192
_SLOTS: Final = (3.0, 12.0)
_SHORT: Final = 1.0

_WHATEVER_THE_FACTS: Final = "nothing that it forbids can be, whatever the facts: is a name misspelt?"


@dataclass(slots=True)
class FactsResult:
    """The result for one property.

    `rows` has the number of rows of each relation with which it was proved, by name; `enough` says that a
    proof with them is one for any number. `facts` break it; `error` is what the rules raise on them. `scenes`
    is the number of sets of facts with which a proof was attacked, of which `close` came within 0.001 of
    breaking it.
    """

    name: str
    text: str
    status: Status = "unknown"
    rows: dict[str, int] = field(default_factory=dict)
    enough: bool = False
    seconds: float = 0.0
    reason: str = ""
    facts: dict[Key, list[tuple[Any, ...]]] | None = None
    error: str | None = None
    floats: Floats | None = None
    scenes: int = 0
    close: int = 0
    prover_error: bool = False

    def as_json(self) -> dict[str, Any]:
        """Return the result as `--json` prints it."""
        facts = (
            None
            if self.facts is None
            else {f"{name}/{arity}": rows for (name, arity), rows in self.facts.items()}
        )
        return {
            "property": self.name,
            "status": self.status,
            "rows": self.rows,
            "any_number": self.enough and self.status in ("proved", IN_REAL_ARITHMETIC),
            "seconds": round(self.seconds, 3),
            "reason": self.reason or None,
            "facts": facts,
            "error": self.error,
            "prover_error": self.prover_error,
            "floats": None if self.floats is None else self.floats.as_json(),
            "attack": {"scenes": self.scenes, "close": self.close},
        }


def load_told(request: Request) -> Book | None:
    """Return the rules and properties of a request if they declare the facts of an environment, else None.

    Raises:
        UserError, PrologError: as `drlsl.verify.properties.load`.
    """
    book = load(request.rules, request.properties) if request.properties else None
    return None if book is None or book.told is None else book


def verify_facts(request: Request, book: Book | None = None) -> Iterator[FactsResult]:
    """Prove or refute every property over all sets of facts, and yield each result.

    `book` is what `load_told` returns for the request, if it was called before.

    Raises:
        UserError: a file cannot be read, declares no facts, or there is no such property.
        PrologError: a file is not a valid program.
    """
    book = book or load_told(request)
    if book is None or book.told is None:
        raise UserError("no facts: a file of properties of an environment has facts(Fact, Rows)")
    names = [one.name for one in book.properties]
    for name in request.only:
        if name not in names:
            raise UserError(f"there is no property {name}; there are {', '.join(names)}")
    known = KnownAnswers(request.kept)
    for one in book.properties:
        if not request.only or one.name in request.only:
            started = time.process_time()
            result = FactsResult(one.name, one.text)
            with deep_recursion():
                _examine(book, book.told, one, request, known, result)
            result.seconds = time.process_time() - started
            yield result


def _examine(
    book: Book, declared: Declared, prop: Property, request: Request, known: KnownAnswers, result: FactsResult
) -> None:
    """Prove a property, search facts that break it, and attack what is proved."""
    if prop.name in book.missing:
        result.reason = f"the rules do not define {', '.join(book.missing[prop.name])}"
        return
    try:
        lowered = lower(book.engine, declared.schema, [prop.query])
    except NotLowerable as reason:
        others = undeclared(book.engine, [table.key for table in declared.tables])
        names = ", ".join(f"{name}/{arity}" for name, arity in others)
        result.reason = f"{reason}" + (f"; not declared by facts/2: {names}" if others else "")
        return
    answer = lowered.answers[0]
    declared.check_keys([answer.found, answer.undecided])
    needed = rows_needed(answer)
    rows = {
        table.key: request.vehicles if needed is None else needed[table.relation]
        for table in declared.tables
        if table.is_open
    }
    result.rows, result.enough = {name: count for (name, _), count in rows.items()}, needed is not None
    replay = _Replay(book, declared, prop, lowered)
    question = _Question(declared, answer, rows, request, known)
    try:
        question.decide(result, replay)
    except NotTranslatable as reason:
        result.status, result.reason = "unknown", str(reason)
    if answer.found.is_const and not answer.found.data:
        result.reason = result.reason or _WHATEVER_THE_FACTS
    if result.status == "proved":
        result.floats = margin_of(
            answer, lowered.pool, book.ranges, max([1, *rows.values()]), _columns(declared, rows)
        )
        if result.floats.margin is None:
            result.status, result.reason = IN_REAL_ARITHMETIC, result.floats.because or ""
        more = {key: count + 1 for key, count in rows.items()}
        _Attack(declared, lowered, more, replay, request).run(result)


def _columns(declared: Declared, rows: Mapping[Key, int]) -> Columns:
    """Return the bounds of every column."""
    result = {}
    for table in declared.tables:
        for place, column in enumerate(table.columns):
            bounds = column.bounds
            if column.kind == "integer":
                bounds = (Fraction(column.values[0]), Fraction(column.values[-1]))
            elif column.kind in ("key", "key_of"):
                bounds = (Fraction(0), Fraction(max(1, *rows.values())))
            one = between(*bounds)
            result[table.relation.name, place] = (one, one)
    return result


class _Question:
    """The question to the solver whether any facts break a property, or have the rules raise an error."""

    def __init__(
        self,
        declared: Declared,
        answer: Answer,
        rows: Mapping[Key, int],
        request: Request,
        known: KnownAnswers,
    ) -> None:
        self._declared = declared
        self._roots = {"broken": answer.found, "error": answer.undecided}
        self._rows = rows
        self._seconds = request.time_limit
        self._settings: dict[str, Any] = {"answers": known, "judges": Judges(request.solver)}

    def decide(self, result: FactsResult, replay: _Replay) -> None:
        """Set the status, and the facts that break the property or the reason why it is unknown."""
        ends = time.perf_counter() + self._seconds
        left: Sequence[str] = list(self._roots)
        for clears in (False, True):
            scene = SymbolicFacts(Algebra(clears=clears), self._declared, self._rows)
            formula = Formula(scene.algebra, scene.facts)
            truths = {part: formula.truth(self._roots[part]) for part in left}
            left = [part for part in left if not self._is_impossible(scene, truths[part], ends)]
            if not left:
                result.status = "proved"
                return
            found = self._search(scene, [truths[part] for part in left], replay, ends) if clears else None
            if found is not None:
                result.status, (result.facts, result.error) = "refuted", found
                return
        result.reason = f"no answer in {self._seconds:g} s"

    def _is_impossible(self, scene: SymbolicFacts, truth: Bool, ends: float) -> bool:
        """Ask about a formula for a short time, and then about its alternatives.

        Products are free numbers first.
        """
        linear = Solver(scene, linear=True, **self._settings)
        exact = Solver(scene, linear=False, **self._settings) if scene.algebra.clears else None
        open_ = [(truth, _SHORT)]
        while open_:
            one, slot = open_.pop()
            left = ends - time.perf_counter()
            if left <= 0:
                return False
            outcome = Outcome("none") if one.op == "false" else linear.holds_nowhere(one, min(slot, left))
            if outcome.verdict == "some" and exact is not None:
                outcome = exact.holds_nowhere(one, min(slot, left))
            if outcome.verdict == "none":
                continue
            if outcome.verdict == "some":
                return False
            parts = _alternatives(scene.algebra.booleans, one)
            open_.extend((part, slot) for part in parts)
            if not parts:
                open_.append((one, 4 * slot))
        return True

    def _search(
        self, scene: SymbolicFacts, truths: Sequence[Bool], replay: _Replay, ends: float
    ) -> _Found | None:
        """Return confirmed facts, those that break the property clearly first."""
        solver = Solver(scene, linear=False, **self._settings)
        for slot in _SLOTS:
            for margin in MARGINS:
                for truth in truths:
                    seconds = max(0.5, min(slot, ends - time.perf_counter()))
                    outcome = solver.find(truth, seconds, margin=margin, usual=0)
                    found = None if outcome.model is None else replay.confirmed(scene.of(outcome.model))
                    if found is not None:
                        return found
        return None


def _alternatives(booleans: Booleans, truth: Bool) -> list[Bool]:
    """Return formulas of which one is true if `truth` is; none if there are no alternatives in it."""
    parts = truth.args if truth.op == "and" else (truth,)
    split = max((part for part in parts if part.op == "or"), key=lambda part: len(part.args), default=None)
    if split is None:
        return []
    rest = [part for part in parts if part is not split]
    return [booleans.and_([*rest, one]) for one in split.args]


_Facts = dict[Key, list[tuple[Any, ...]]]
_Found = tuple[_Facts, str | None]
"""Facts that break a property, and the error that the rules raise on them, if that breaks it."""


class _Replay:
    """Runs interpreter and generated code on facts, to see whether they break a property."""

    def __init__(self, book: Book, declared: Declared, prop: Property, lowered: Lowered) -> None:
        self._engine = book.engine
        self._declared = declared
        self._goal = book.engine.prepare(prop.goal)
        self._scalar = compile_scalar(lowered)

    def confirmed(self, exact: Rows) -> _Found | None:
        """Return facts with numbers of few digits that break the property, if some near `exact` do."""
        for digits in _DIGITS:
            facts = {table.key: floats_of(exact, table, digits) for table in self._declared.tables}
            found = self.breaks(facts)
            if found is not None:
                return found
        return None

    def breaks(self, facts: _Facts) -> _Found | None:
        """Return the facts if interpreter and generated code agree that they break the property."""
        for (name, arity), rows in facts.items():
            self._engine.replace_facts(name, arity, rows)
        try:
            if not self._goal.holds(LIMITS):
                return None
        except (PrologError, LimitExceeded) as error:
            return facts, str(error).splitlines()[0]
        with suppress(Undecided):  # left to the interpreter, which has confirmed it
            (broken,) = self._scalar(facts)
            return (facts, None) if broken else None
        return facts, None


class _Attack:
    """Tries to break a proved property by very many sets of facts, drawn and then changed in small steps.

    Nothing here uses the formulas of the solver: the array tier evaluates the sets, and what breaks the
    property there goes to interpreter and generated code.
    """

    def __init__(
        self, declared: Declared, lowered: Lowered, rows: Mapping[Key, int], replay: _Replay, request: Request
    ) -> None:
        self._answer = lowered.answers[0]
        self._program = compile_numpy(lowered)
        self._drawer = Drawer(declared, rows, self._program.code)
        self._close = Closeness([[self._answer.found]], self._program.code)
        self._replay = replay
        self._scenes = request.attack
        self._rng = np.random.default_rng([request.seed, crc32(self._answer.query.name.encode())])
        self._hits = self._suspects = 0

    def run(self, result: FactsResult) -> None:
        """Try all sets, or stop at one that breaks the property."""
        if self._answer.found.is_const and self._answer.undecided.is_const:
            return
        best: Sets | None = None
        far = np.empty(0)
        size = min(_BATCH, self._scenes)
        while result.scenes < self._scenes and result.status not in ("refuted", "unknown"):
            fresh = best is None or result.scenes < _DRAWN * self._scenes
            sets = (
                self._drawer.draw(self._rng, size)
                if best is None or fresh
                else self._drawer.changed(self._rng, best)
            )
            distance = self._tried(sets, result)
            if best is None:
                best, far = sets, distance
            else:
                better = np.flatnonzero(distance <= far)
                best.put(better, sets)
                far[better] = distance[better]

    def _tried(self, sets: Sets, result: FactsResult) -> Any:
        """Return how far sets are from breaking the property; report one that does."""
        facts = self._drawer.arrays(sets)
        answers = self._program({key: rows for key, rows in facts.items() if key in self._program.reads})
        broken = np.broadcast_to(answers.answers[0].value, len(sets)) & ~answers.undecided
        result.scenes += len(sets)
        (distance,) = self._close.distances(facts, len(sets))
        result.close += int((distance < _CLOSE).sum())
        for number in np.flatnonzero(broken)[: max(0, _MOST_HITS - self._hits)]:
            self._hits += 1
            self._look_into(self._drawer.facts(sets, int(number)), result, decided=True)
        undecided = np.broadcast_to(answers.undecided, len(sets))
        for number in np.flatnonzero(undecided)[: min(_SUSPECTS_OF_A_BATCH, _MOST_SUSPECTS - self._suspects)]:
            self._suspects += 1
            self._look_into(self._drawer.facts(sets, int(number)), result, decided=False)
        return distance

    def _look_into(self, facts: _Facts, result: FactsResult, *, decided: bool) -> None:
        """Run interpreter and generated code on facts that the array tier has broken, or left undecided."""
        found = self._replay.breaks(facts)
        if found is not None:
            result.facts, result.error = found
            result.status, result.prover_error = "refuted", True
            result.reason = "facts break it although it was proved, by an error of the prover or of rounding"
        elif decided and result.status != "refuted":
            result.facts, result.status = facts, "unknown"
            result.reason = "the array tier and the interpreter do not agree on facts: please report it"
