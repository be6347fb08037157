"""Search a scene that would notice a surviving mutant, by small changes of the tables' scenes."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, TypeVar

from drlsl.assurance.answers import WRONG, Asker, first_line
from drlsl.assurance.case_rows import BoxRow, EgoRow, Staging, VehicleRow
from drlsl.assurance.checks import Question, alike, shown

SCENES: Final = 60
SEED: Final = 0
TOLERANCE: Final = 1e-6

_Box = TypeVar("_Box", bound=BoxRow)


@dataclass(frozen=True)
class Witness:
    """A row for a table, the question in it, and the answers of the rules and of the mutant."""

    row: str
    goal: str
    rules: str
    mutant: str


class Search:
    """Asks the same questions about the same scenes twice, and compares."""

    def __init__(self, asker: Asker, questions: Sequence[Question], stagings: Sequence[Staging]) -> None:
        self._asker = asker
        self._asked = [
            (staging, scene, question)
            for staging in stagings
            for scene in (staging.scene(),)
            for question in questions
        ]
        self._noted: list[Any] = []

    def note(self) -> None:
        """Record the answers of the present program."""
        self._noted = [self._answer(scene, question) for _, scene, question in self._asked]

    def difference(self) -> Witness | None:
        """Return the first scene in which the present program's answer differs from the recorded one."""
        for (staging, scene, question), noted in zip(self._asked, self._noted, strict=True):
            answer = self._answer(scene, question)
            if not alike(noted, answer, TOLERANCE):
                return Witness(staging.row(), question.goal, _words(answer), _words(noted))
        return None

    def _answer(self, scene: Any, question: Question) -> list[Any]:
        """Return the solutions as lists, so that they can be compared; an error as its message."""
        try:
            found = self._asker.ask(scene, question)
        except WRONG as error:
            return [first_line(error)]
        return [_plain(row) for row in found]


def _plain(row: Mapping[str, Any]) -> list[Any]:
    return [value if isinstance(value, float | list) else str(value) for value in row.values()] or ["true"]


def _words(answer: Sequence[Any]) -> str:
    parts = [", ".join(map(shown, row)) if isinstance(row, list) else str(row) for row in answer]
    return " | ".join(parts) or "no solution"


def changed(stagings: Sequence[Staging]) -> list[Staging]:
    """Return scenes like these with other speeds, gaps and places, of two decimals; the same in every run."""
    chance = random.Random(SEED)
    return [_changed(chance, chance.choice(stagings)) for _ in range(SCENES)] if stagings else []


def _changed(chance: random.Random, staging: Staging) -> Staging:
    vehicles = {name: _moved(chance, row) for name, row in staging.vehicles.items()}
    for number in range(1, chance.choice((1, 1, 2, 3))):
        vehicles[f"more{number}"] = _other(chance, staging)
    return replace(staging, ego=_moved(chance, staging.ego), vehicles=vehicles)


def _other(chance: random.Random, staging: Staging) -> VehicleRow:
    """Return one more vehicle."""
    lanes = staging.road.lanes
    return VehicleRow(
        lane=chance.randint(1, lanes if isinstance(lanes, int) else len(lanes)),
        offset=round(chance.gauss(0.0, 25.0), 2),
        speed=round(max(0.0, staging.ego.speed + chance.gauss(0.0, 5.0)), 2),
        drift=chance.choice((0.0, 0.0, round(chance.gauss(0.0, 1.0), 2))),
    )


def _moved(chance: random.Random, row: _Box) -> _Box:
    """Return a box with some of its numbers changed, most of them slightly."""
    spreads = {"speed": 5.0, "shift": 0.5, "drift": 0.5, "ahead": 10.0, "behind": 10.0, "offset": 2.0}
    update = {}
    for name, spread in spreads.items():
        value = getattr(row, name, None)
        if value is not None and chance.random() < 0.5:
            update[name] = round(value + chance.gauss(0.0, spread * chance.choice((0.02, 1.0))), 2)
    if isinstance(row, EgoRow | VehicleRow) and update.get("speed", 0.0) < 0.0:
        update["speed"] = 0.0
    return row.model_copy(update=update)
