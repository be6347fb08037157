"""A whole verification: every property in every case, on several processes, and its result.

Proofs are judged in floats, and attacked, before they are reported.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any, Final, TypeAlias

from drlsl.shield import own_files
from drlsl.verify.attack import SCENES, SEED, Attack, Hit, Orders, attack
from drlsl.verify.confirmation import Counterexample
from drlsl.verify.floats import Floats
from drlsl.verify.prove import Finding, Prover, Status, Task
from drlsl.verify.ranges import Case, Range, all_cases
from drlsl.verify.smt import SolverChoice
from drlsl.workers import ALONE, Crew, Function, Make, in_order

IN_REAL_ARITHMETIC: Final = "proved in real arithmetic only"
"""The status of a property that floats may break without any limit, or do break in a scene."""

_MOST_UNKNOWN: Final = 3
"""Number of unknown cases after which a property is not tried in more."""


@dataclass(frozen=True, slots=True)
class Request:
    """A request to verify; no rules and no properties stand for the default ones.

    `only` names properties, none for all; `time_limit` [s] is for one property in one case. Proofs are
    attacked with `attack` scenes, drawn by `seed`; 0: not at all. `solver` is the one that proves. `kept` is
    a file of the solver's answers, which is made and added to; with None every question is asked.
    """

    rules: tuple[Path, ...] = ()
    properties: tuple[Path, ...] = ()
    vehicles: int = 6
    only: tuple[str, ...] = ()
    time_limit: float = 60.0
    crew: Crew = ALONE
    cases: tuple[Case, ...] = field(default_factory=lambda: tuple(all_cases()))
    attack: int = SCENES
    seed: int = SEED
    solver: SolverChoice = "z3"
    kept: Path | None = None


@dataclass(slots=True)
class Result:
    """The result for one property.

    `enough`: a proof with that number of vehicles holds for any number; None if that is unknown. `seconds` of
    all processes together. `attack` is the result of attacking it, None if it was not attacked;
    `prover_error`: it was proved and is refuted by a scene. `floats` is what the proof implies for floats,
    None without a proof. With two solvers, `confirmed` questions were answered alike by both and `unanswered`
    ones by only one. `amount` is the distance from the limit at which a scene breaks it by rounding.
    """

    name: str
    text: str
    vehicles: int
    enough: int | None = None
    status: Status = "proved"
    seconds: float = 0.0
    reason: str = ""
    case: Case | None = None
    counterexample: Counterexample | None = None
    unknown: int = 0
    attack: Attack | None = None
    prover_error: bool = False
    floats: Floats | None = None
    amount: Fraction | None = None
    confirmed: int = 0
    unanswered: int = 0

    @property
    def for_any_number(self) -> bool:
        """True if it is proved for any number of vehicles."""
        proved = self.status in ("proved", IN_REAL_ARITHMETIC)
        return proved and self.enough is not None and self.enough <= self.vehicles

    def take(self, finding: Finding) -> None:
        """Add the finding in one case."""
        self.seconds += finding.seconds
        self.confirmed += finding.confirmed
        self.unanswered += finding.unanswered
        if finding.status == "refuted" and self.status != "refuted":
            self.status, self.case, self.reason = "refuted", finding.case, ""
            self.counterexample = finding.counterexample
        elif finding.status == "unknown":
            self.unknown += 1
            if self.status == "proved":
                self.status, self.case = "unknown", finding.case
                self.reason = f"{finding.reason} ({finding.case})"

    def take_judgement(self, judged: Judgement) -> None:
        """Add what its proof implies for floats, and the result of the attack."""
        self.seconds += judged.seconds
        self.take_floats(judged.floats)
        if judged.attack is not None:
            self.take_attack(judged.attack)

    def take_floats(self, floats: Floats) -> None:
        """Add what its proof implies for floats."""
        self.floats = floats
        if floats.margin is None:
            self.status, self.reason = IN_REAL_ARITHMETIC, floats.because or ""

    def take_attack(self, attacked: Attack) -> None:
        """Add the result of the attack; within the margin floats may decide differently."""
        self.attack = attacked
        hit = attacked.hit
        if hit is None:
            return
        if hit.kind == "tiers":
            self.status = "unknown"
            self.reason = "the array tier and the interpreter do not agree on a scene: please report it"
        elif hit.kind == "exact":
            self.status, self.prover_error, self.floats = "refuted", True, None
            self.reason = (
                "a scene breaks it although it was proved: this is an error of the prover, please report it"
            )
        elif self._is_within_margin(hit):
            return
        else:
            self.reason = (
                f"{self.reason}; {_rounds(hit)}" if self.status == IN_REAL_ARITHMETIC else _rounds(hit)
            )
            self.status, self.amount = IN_REAL_ARITHMETIC, hit.amount
        self.counterexample = hit.counterexample

    def _is_within_margin(self, hit: Hit) -> bool:
        """Return whether floats may judge a scene differently, by the margin of the proof."""
        margin = None if self.floats is None else self.floats.margin
        return margin is not None and hit.amount is not None and hit.amount <= Fraction(margin)

    def as_json(self) -> dict[str, Any]:
        """Return the result as `--json` prints it."""
        return {
            "property": self.name,
            "status": self.status,
            "vehicles": self.vehicles,
            "any_number": self.for_any_number,
            "seconds": round(self.seconds, 3),
            "reason": self.reason or None,
            "counterexample": None if self.counterexample is None else self.counterexample.as_json(),
            "confirmed": self.confirmed,
            "unanswered": self.unanswered,
            "prover_error": self.prover_error,
            "floats": None if self.floats is None else self.floats.as_json(),
            "amount": None if self.amount is None else float(self.amount),
            "attack": None if self.attack is None else self.attack.as_json(),
        }


def _rounds(hit: Hit) -> str:
    """Return the reason why a hit limits a proof to real arithmetic."""
    if hit.kind == "open":
        return "a scene breaks it in floats, and exact arithmetic cannot judge that scene"
    if hit.amount is None:
        return "a scene breaks it in floats only"
    return f"a scene breaks it in floats only: a comparison that lies {float(hit.amount):.3g} from its limit"


@dataclass(frozen=True, slots=True)
class Report:
    """The results for all properties, and the scenes that they cover.

    `ranges` includes those of the `unknowns`, numbers besides the scene, names with descriptions.
    """

    results: list[Result]
    ranges: dict[str, Range]
    cases: int
    unknowns: dict[str, str] = field(default_factory=dict)


def verify(request: Request, progress: Callable[[int, int], None] = lambda _done, _all: None) -> Report:
    """Prove or refute every property; `progress` is called with the numbers of finished and of all steps.

    Whoever does the work, findings count in the order of the cases: the result is the same.

    Raises:
        UserError: a file cannot be read, there is no such property, or no such cluster.
        PrologError: a file is not a valid program.
    """
    prover = Prover.of(request.rules, request.properties, request.only, request.solver, request.kept)
    results = {one.name: one for one in _results(prover, request)}
    perform = partial(request.crew.perform, _maker(prover, request), files=own_files(prover.book.engine))
    cases = len(request.cases)
    agenda = _Agenda(request, results, prover)

    def found() -> Iterator[tuple[int, list[Finding]]]:
        for count, (number, findings) in enumerate(perform(agenda.tasks()), start=1):
            progress(count, cases + len(results))
            agenda.note(findings)
            yield number, findings

    for findings in in_order(found()):
        agenda.take(findings)
    raids = [raid for one in results.values() if (raid := _raid(one, request)) is not None]
    for count, (_, judged) in enumerate(perform(raids), start=1):
        results[judged.property].take_judgement(judged)
        progress(cases + count, cases + len(raids))
    book = prover.book
    return Report(list(results.values()), book.ranges, cases, book.unknowns)


def _results(prover: Prover, request: Request) -> Iterator[Result]:
    for one in prover.book.properties:
        if not request.only or one.name in request.only:
            result = Result(one.name, one.text, request.vehicles, prover.enough.get(one.name))
            if one.name in prover.refused:
                result.status, result.reason = "unknown", prover.refused[one.name]
            yield result


class _Agenda:
    """Hands out one case after another, with the properties that are still open, and takes the findings."""

    def __init__(self, request: Request, results: dict[str, Result], prover: Prover) -> None:
        self._request = request
        self._results = {name: result for name, result in results.items() if name not in prover.refused}
        self._refuted: set[str] = set()

    def tasks(self) -> Iterator[Task]:
        """Yield the tasks."""
        for case in self._request.cases:
            names = tuple(
                name for name, one in self._results.items() if _is_open(one) and name not in self._refuted
            )
            if not names:
                return
            yield Task(case, names, self._request.vehicles, self._request.time_limit)

    def note(self, findings: Iterable[Finding]) -> None:
        """Have properties that are refuted in a case not be examined in later ones."""
        self._refuted.update(one.property for one in findings if one.status == "refuted")

    def take(self, findings: Iterable[Finding]) -> None:
        """Add the findings in the next case; those about a property that is closed do not count."""
        for finding in findings:
            result = self._results[finding.property]
            if _is_open(result):
                result.take(finding)


def _is_open(result: Result) -> bool:
    """Return whether a property is to be examined in further cases."""
    return result.status != "refuted" and result.unknown < _MOST_UNKNOWN


@dataclass(frozen=True, slots=True)
class Raid:
    """A proved property, to be judged in floats and attacked; without orders, only judged."""

    property: str
    vehicles: int
    orders: Orders | None


@dataclass(frozen=True, slots=True)
class Judgement:
    """The consequences of a proof for floats, and the result of the attack."""

    property: str
    floats: Floats
    attack: Attack | None
    seconds: float


def _raid(result: Result, request: Request) -> Raid | None:
    """Return how to attack a proof; one for any number of vehicles with more than are sufficient."""
    if result.status != "proved" or not request.cases:
        return None
    vehicles = request.vehicles
    if not request.attack:
        return Raid(result.name, vehicles, None)
    if result.for_any_number and result.enough is not None:
        vehicles = max(vehicles, result.enough + 1)
    orders = Orders(request.cases, vehicles, request.attack, request.seed)
    return Raid(result.name, request.vehicles, orders)


Work: TypeAlias = "Task | Raid"


def _maker(prover: Prover, request: Request) -> Make:
    """Return what makes the function that performs a piece of work."""
    if request.crew == ALONE:
        return partial(_performing, prover)
    return partial(_prepare, request.rules, request.properties, request.only, request.solver, request.kept)


def _prepare(
    rules: Sequence[Path],
    properties: Sequence[Path],
    only: Sequence[str],
    solver: SolverChoice,
    kept: Path | None,
) -> Function[Work, Any]:
    return _performing(Prover.of(rules, properties, only, solver, kept))


def _performing(prover: Prover) -> Function[Work, Any]:
    return lambda work, _stop: _do(prover, work)


def _do(prover: Prover, work: Work) -> list[Finding] | Judgement:
    if isinstance(work, Task):
        return prover.run(work)
    started = time.perf_counter()
    name = work.property
    floats = prover.floats(name, work.vehicles)
    attacked = None
    if work.orders is not None:
        begun = time.perf_counter()
        attacked = attack(prover.book, prover.property(name), work.orders, prover.replay(name))
        attacked.seconds = time.perf_counter() - begun
    return Judgement(name, floats, attacked, time.perf_counter() - started)
