"""A whole verification: every property in every case, on several processes, and what comes of it."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from drlsl.verify.prove import Finding, Prover, Status, Task
from drlsl.verify.ranges import Case, Range, all_cases
from drlsl.verify.replay import Counterexample
from drlsl.verify.workers import Workers

_MOST_UNKNOWN: Final = 3
"""A property that stays unknown in so many cases is not tried in more."""


@dataclass(frozen=True, slots=True)
class Request:
    """What is to be verified; no rules and no properties stand for the default ones.

    `only` names properties, none for all; `time_limit` [s] is for one property in one case.
    """

    rules: tuple[Path, ...] = ()
    properties: tuple[Path, ...] = ()
    vehicles: int = 6
    only: tuple[str, ...] = ()
    time_limit: float = 60.0
    jobs: int = 1
    cases: tuple[Case, ...] = field(default_factory=lambda: tuple(all_cases()))


@dataclass(slots=True)
class Result:
    """What is known of one property.

    `enough`: with so many vehicles a proof holds for any number; None where that is not known. `seconds` of
    all processes together.
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

    @property
    def for_any_number(self) -> bool:
        """Whether it is proved for any number of vehicles."""
        return self.status == "proved" and self.enough is not None and self.enough <= self.vehicles

    def take(self, finding: Finding) -> None:
        """Add what was found in one case."""
        self.seconds += finding.seconds
        if finding.status == "refuted" and self.status != "refuted":
            self.status, self.case, self.reason = "refuted", finding.case, ""
            self.counterexample = finding.counterexample
        elif finding.status == "unknown":
            self.unknown += 1
            if self.status == "proved":
                self.status, self.case = "unknown", finding.case
                self.reason = f"{finding.reason} ({finding.case})"

    def as_json(self) -> dict[str, Any]:
        """The result as `--json` prints it."""
        return {
            "property": self.name,
            "status": self.status,
            "vehicles": self.vehicles,
            "any_number": self.for_any_number,
            "seconds": round(self.seconds, 3),
            "reason": self.reason or None,
            "counterexample": None if self.counterexample is None else self.counterexample.as_json(),
        }


@dataclass(frozen=True, slots=True)
class Report:
    """What is known of all properties, and the scenes that it is about.

    `ranges` has those of the `unknowns` too, numbers besides the scene, by name with what they are.
    """

    results: list[Result]
    ranges: dict[str, Range]
    cases: int
    unknowns: dict[str, str] = field(default_factory=dict)


def verify(request: Request, progress: Callable[[int, int], None] = lambda _done, _all: None) -> Report:
    """Prove or refute every property; `progress` is told how many of how many cases are done.

    Raises:
        UserError: a file cannot be read, or there is no such property.
        PrologError: a file is not a valid program.
    """
    prover = Prover.of(request.rules, request.properties, request.only)
    results = {one.name: one for one in _results(prover, request)}
    agenda = _Agenda(request, results, prover)
    for done, findings in enumerate(_findings(prover, request, agenda.next), start=1):
        for finding in findings:
            results[finding.property].take(finding)
        progress(done, len(request.cases))
    book = prover.book
    return Report(list(results.values()), book.ranges, len(request.cases), book.unknowns)


def _results(prover: Prover, request: Request) -> Iterator[Result]:
    for one in prover.book.properties:
        if not request.only or one.name in request.only:
            result = Result(one.name, one.text, request.vehicles, prover.enough.get(one.name))
            if one.name in prover.refused:
                result.status, result.reason = "unknown", prover.refused[one.name]
            yield result


class _Agenda:
    """Hands out one case after another, with the properties that are still open."""

    def __init__(self, request: Request, results: dict[str, Result], prover: Prover) -> None:
        self._request = request
        self._results = [result for name, result in results.items() if name not in prover.refused]
        self._cases = iter(request.cases)

    def next(self) -> Task | None:
        """The next task; None when nothing is left to do."""
        open_ = tuple(
            result.name
            for result in self._results
            if result.status != "refuted" and result.unknown < _MOST_UNKNOWN
        )
        case = next(self._cases, None)
        if case is None or not open_:
            return None
        return Task(case, open_, self._request.vehicles, self._request.time_limit)


def _findings(
    prover: Prover, request: Request, next_task: Callable[[], Task | None]
) -> Iterator[list[Finding]]:
    """The findings of every task."""
    if request.jobs == 1:
        while (task := next_task()) is not None:
            yield prover.run(task)
        return
    with Workers(request.jobs, _prepare, request.rules, request.properties, request.only) as workers:
        yield from workers.results(next_task)


def _prepare(
    rules: Sequence[Path], properties: Sequence[Path], only: Sequence[str]
) -> Callable[[Task], list[Finding]]:
    """What a worker does with a task."""
    return functools.partial(Prover.run, Prover.of(rules, properties, only))
