"""One expected answer: the goal to query, and its expected solutions."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from drlsl.assurance.reason_patterns import ReasonPattern, all_explained, short
from drlsl.assurance.tested_rules import Question, Solutions, Staged, State
from drlsl.logic import Compound


@dataclass(frozen=True)
class Check(ABC):
    """An expectation about one goal; `what` is its word in reports."""

    what: str
    question: Question

    def problem(self, found: Solutions) -> str | None:
        """Return the error of the solutions, as `expected ..., got ...`; None if they are right."""
        return None if self.agrees(found) else f"expected {self.expected()}, got {self.given(found)}"

    @abstractmethod
    def agrees(self, found: Solutions) -> bool:
        """Return whether the solutions are as expected."""

    @abstractmethod
    def expected(self) -> str:
        """Return the expectation in words."""

    @abstractmethod
    def given(self, found: Solutions) -> str:
        """Return the answer in the same words as the expectation."""


@dataclass(frozen=True)
class Holds(Check):
    """Expects that the goal has a solution, or that it has none."""

    wanted: bool

    def agrees(self, found: Solutions) -> bool:
        return bool(found) == self.wanted

    def expected(self) -> str:
        return str(self.wanted).lower()

    def given(self, found: Solutions) -> str:
        return str(bool(found)).lower()


@dataclass(frozen=True)
class Offered(Check):
    """The values of the goal's only variable, in any order."""

    wanted: tuple[str, ...]

    def agrees(self, found: Solutions) -> bool:
        return sorted(self._words(found)) == sorted(self.wanted)

    def expected(self) -> str:
        return ", ".join(self.wanted) or "none"

    def given(self, found: Solutions) -> str:
        return ", ".join(self._words(found)) or "none"

    def _words(self, found: Solutions) -> list[str]:
        return [str(value) for value in _values(found)]


@dataclass(frozen=True)
class Equals(Check):
    """The value of the goal's only variable in its first solution; a float may differ by `tolerance`."""

    wanted: float
    tolerance: float

    def agrees(self, found: Solutions) -> bool:
        return bool(found) and alike(self.wanted, _values(found)[0], self.tolerance)

    def expected(self) -> str:
        return shown(self.wanted)

    def given(self, found: Solutions) -> str:
        return shown(_values(found)[0]) if found else "no solution"


@dataclass(frozen=True)
class Observed(Check):
    """Some of the numbers of an observation, each by its place among the `names`."""

    names: tuple[str, ...]
    wanted: tuple[tuple[str, float], ...]
    tolerance: float

    def agrees(self, found: Solutions) -> bool:
        numbers = self._numbers(found)
        return len(numbers) == len(self.names) and all(
            alike(value, numbers[self.names.index(name)], self.tolerance) for name, value in self.wanted
        )

    def expected(self) -> str:
        return ", ".join(f"{name} {shown(value)}" for name, value in self.wanted)

    def given(self, found: Solutions) -> str:
        numbers = self._numbers(found)
        if len(numbers) != len(self.names):
            return shown(numbers) if found else "no solution"
        return ", ".join(f"{name} {shown(numbers[self.names.index(name)])}" for name, _ in self.wanted)

    @staticmethod
    def _numbers(found: Solutions) -> list[Any]:
        value = _values(found)[0] if found else []
        return value if isinstance(value, list) else [value]


@dataclass(frozen=True)
class Nearest(Check):
    """The nearest vehicle of a section; None if it is free. The solutions give Section, Car and Gap."""

    wanted: tuple[tuple[str, str | None], ...]

    def agrees(self, found: Solutions) -> bool:
        return all(self._nearest(found, section) == car for section, car in self.wanted)

    def expected(self) -> str:
        return ", ".join(f"{section} {car or 'free'}" for section, car in self.wanted)

    def given(self, found: Solutions) -> str:
        return ", ".join(f"{section} {self._nearest(found, section) or 'free'}" for section, _ in self.wanted)

    @staticmethod
    def _nearest(found: Solutions, section: str) -> str | None:
        inside = [row for row in found if row["Section"] == section]
        if not all(isinstance(row["Gap"], int | float) for row in inside):
            return "a gap that is not a number"
        return str(min(inside, key=lambda row: float(row["Gap"]))["Car"]) if inside else None


@dataclass(frozen=True)
class Opposed(Check):
    """The reasons against an action, in any order; the solutions give the Reason alone."""

    wanted: tuple[ReasonPattern, ...]

    def agrees(self, found: Solutions) -> bool:
        return all_explained(self.wanted, _values(found))

    def expected(self) -> str:
        return ", ".join(pattern.text for pattern in self.wanted) or "none"

    def given(self, found: Solutions) -> str:
        in_full = any("(" in pattern.text for pattern in self.wanted)
        return ", ".join(shown(one) if in_full else short(one) for one in _values(found)) or "none"


@dataclass(frozen=True)
class Solves(Check):
    """All solutions of a goal, in order; floats may differ by `tolerance`."""

    wanted: tuple[Mapping[str, Any], ...]
    tolerance: float

    def agrees(self, found: Solutions) -> bool:
        return len(found) == len(self.wanted) and all(
            row.keys() >= wanted.keys()
            and all(alike(value, row[name], self.tolerance) for name, value in wanted.items())
            for wanted, row in zip(self.wanted, found, strict=True)
        )

    def expected(self) -> str:
        return _rows(self.wanted)

    def given(self, found: Solutions) -> str:
        return _rows(found)


def _rows(solutions: Solutions) -> str:
    rows = ["; ".join(f"{name} = {shown(value)}" for name, value in row.items()) for row in solutions]
    return " | ".join(row or "true" for row in rows) or "no solution"


def _values(found: Solutions) -> list[Any]:
    """Return the values of the only variable."""
    return [next(iter(row.values())) for row in found]


def alike(wanted: Any, given: Any, tolerance: float) -> bool:
    """Return whether values are equal; numbers within the tolerance, the rules' integers only to integers."""
    if isinstance(wanted, list):
        return (
            isinstance(given, list)
            and len(wanted) == len(given)
            and all(alike(one, other, tolerance) for one, other in zip(wanted, given, strict=True))
        )
    if isinstance(given, float) and isinstance(wanted, int | float):
        return math.isfinite(given) and abs(given - wanted) <= tolerance
    return bool(wanted == (str(given) if isinstance(given, Compound) else given))


def shown(value: Any) -> str:
    """Return a value of a solution as text; floats to six places."""
    if isinstance(value, Compound):
        return f"{value.name}({', '.join(map(shown, value.args))})"
    if isinstance(value, float):
        return f"{value:.6f}".rstrip("0").rstrip(".") if abs(value) >= 1e-6 or value == 0 else repr(value)
    if isinstance(value, list):
        return f"[{', '.join(map(shown, value))}]"
    return str(value)


@dataclass(frozen=True)
class Case:
    """A state with the expectations about the rules in it.

    `place` is file and line, `name` its subject. `fails` is a part of the message with which the rules are
    expected to fail instead of deciding; None if a usable decision is expected. `staging` is the state in the
    words of a table, if it comes from one.
    """

    place: str
    name: str
    state: State
    checks: tuple[Check, ...]
    fails: str | None = None
    staging: Staged | None = None
