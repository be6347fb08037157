"""Search a state that would notice a surviving mutant, by small changes of the tables' states."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from drlsl.assurance.answers import WRONG, Asker, first_line
from drlsl.assurance.checks import alike, shown
from drlsl.assurance.tested_rules import Question, Staged, State

STATES: Final = 60
SEED: Final = 0
TOLERANCE: Final = 1e-6


@dataclass(frozen=True)
class Witness:
    """A row for a table, the question in it, and the answers of the rules and of the mutant."""

    row: str
    goal: str
    rules: str
    mutant: str


class Search:
    """Asks the same questions about the same states twice, and compares."""

    def __init__(self, asker: Asker, questions: Sequence[Question], stagings: Sequence[Staged]) -> None:
        self._asker = asker
        self._asked = [
            (staging, state, question)
            for staging in stagings
            for state in (staging.state(),)
            for question in questions
        ]
        self._noted: list[Any] = []

    def note(self) -> None:
        """Record the answers of the present program."""
        self._noted = [self._answer(state, question) for _, state, question in self._asked]

    def difference(self) -> Witness | None:
        """Return the first state in which the present program's answer differs from the recorded one."""
        for (staging, state, question), noted in zip(self._asked, self._noted, strict=True):
            answer = self._answer(state, question)
            if not alike(noted, answer, TOLERANCE):
                return Witness(staging.row(), question.goal, _words(answer), _words(noted))
        return None

    def _answer(self, state: State, question: Question) -> list[Any]:
        """Return the solutions as lists, so that they can be compared; an error as its message."""
        try:
            found = self._asker.ask(state, question)
        except WRONG as error:
            return [first_line(error)]
        return [_plain(row) for row in found]


def _plain(row: Mapping[str, Any]) -> list[Any]:
    return [value if isinstance(value, float | list) else str(value) for value in row.values()] or ["true"]


def _words(answer: Sequence[Any]) -> str:
    parts = [", ".join(map(shown, row)) if isinstance(row, list) else str(row) for row in answer]
    return " | ".join(parts) or "no solution"


def changed(stagings: Sequence[Staged]) -> list[Staged]:
    """Return states like these with other numbers; the same in every run."""
    chance = random.Random(SEED)
    return [chance.choice(stagings).changed(chance) for _ in range(STATES)] if stagings else []
