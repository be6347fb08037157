"""The names and bounds of the numbers that the agent observes, as the rules declare them."""

from __future__ import annotations

import math
import struct
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

from drlsl.driving.shield.questions import BOUNDS, NAMES, Question
from drlsl.errors import UserError
from drlsl.logic import Compound, Engine, LimitExceeded, Limits, PrologError, String

PAPER_NAMES: Final = (
    *("front", "front_right", "right", "back_right", "back", "back_left", "left", "front_left"),
    *("lane", "speed"),
)
"""The names of the observation of a program that declares none. Source: paper, State Space."""

LIMITS: Final = Limits(inferences=100_000)
"""The limits of one question about the observation."""


@dataclass(frozen=True, slots=True)
class ObservationSpace:
    """The names of the numbers of an observation, and for each the bounds `low` and `high`, inclusive."""

    names: tuple[str, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]

    @classmethod
    def of(
        cls, names: Sequence[str], bounds: Sequence[tuple[float, float]] | None = None
    ) -> ObservationSpace:
        """Return the space of these names; without `bounds`, of numbers from 0 to 1."""
        given = [(0.0, 1.0)] * len(names) if bounds is None else bounds
        return cls(tuple(names), tuple(low for low, _ in given), tuple(high for _, high in given))

    def __len__(self) -> int:
        """Return the number of numbers."""
        return len(self.names)

    @property
    def zero(self) -> tuple[float, ...]:
        """0, put within the bounds, for each number: what is observed where the rules fail."""
        return tuple(min(max(0.0, low), high) for low, high in zip(self.low, self.high, strict=True))

    def outside(self, numbers: Sequence[float]) -> int | None:
        """Return the place of the first number beyond its bounds, as NaN is; None if there is none."""
        for place, (number, low, high) in enumerate(zip(numbers, self.low, self.high, strict=True)):
            if not low <= number <= high:
                return place
        return None


PAPER_OBSERVATION: Final = ObservationSpace.of(PAPER_NAMES)
"""The paper's ten numbers, each from 0 to 1."""


def declared_observation(engine: Engine) -> ObservationSpace:
    """Return the observation that a program declares; the paper's, if it has no state_names/1.

    Raises:
        UserError: the names or the bounds are not usable.
    """
    if not engine.defines(NAMES.name, NAMES.arity):
        if engine.defines(BOUNDS.name, BOUNDS.arity):
            raise UserError(f"{_place(engine, BOUNDS)}: bounds need names: the program has no {NAMES}")
        return PAPER_OBSERVATION
    names = _checked_names(engine)
    if not engine.defines(BOUNDS.name, BOUNDS.arity):
        return ObservationSpace.of(names)
    return ObservationSpace.of(names, _checked_bounds(engine, names))


def _checked_names(engine: Engine) -> list[str]:
    place, names = f"{_place(engine, NAMES)}: {NAMES}", _only_answer(engine, NAMES)
    for number, name in enumerate(names, start=1):
        if isinstance(name, String) or not isinstance(name, str) or not name:
            raise UserError(f"{place}: name {number} is {_shown(name)}; expected an atom")
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise UserError(f"{place}: the name {twice[0]} is given more than once")
    return names


def _checked_bounds(engine: Engine, names: Sequence[str]) -> list[tuple[float, float]]:
    place, pairs = f"{_place(engine, BOUNDS)}: {BOUNDS}", _only_answer(engine, BOUNDS)
    if len(pairs) != len(names):
        raise UserError(f"{place}: there are {len(pairs)} bounds for the {len(names)} names of {NAMES}")
    bounds = []
    for name, pair in zip(names, pairs, strict=True):
        if not isinstance(pair, Compound) or (pair.name, len(pair.args)) != ("-", 2):
            raise UserError(f"{place}: the bounds of {name} are {_shown(pair)}; expected Low-High")
        low, high = map(_finite, pair.args)
        if low is None or high is None:
            raise UserError(f"{place}: the bounds of {name} are {_shown(pair)}; expected two finite numbers")
        if not low < high:
            raise UserError(f"{place}: the bounds of {name} are {_shown(pair)}; the first must be less")
        bounds.append((low, high))
    return bounds


def _only_answer(engine: Engine, question: Question) -> list[Any]:
    """Return the list that is the only answer to a question about the observation, asked without a scene."""
    place = f"{_place(engine, question)}: {question}"
    try:
        answers = [one[question.variable] for one in engine.query(question.goal, limits=LIMITS)]
    except (PrologError, LimitExceeded) as error:
        raise UserError(f"{place}: {str(error).splitlines()[0]}") from error
    if not answers:
        raise UserError(f"{place} has no solution; it is asked before there is any scene")
    if len(answers) > 1:
        raise UserError(f"{place} has {len(answers)} solutions; expected one list")
    (answer,) = answers
    if not isinstance(answer, list) or not answer:
        raise UserError(f"{place} gave {_shown(answer)}; expected a list of one or more")
    return answer


def _finite(value: object) -> float | None:
    """Return a number that is finite in single precision, as networks see it; None for all else."""
    if not isinstance(value, int | float):
        return None
    try:
        number = float(value)
        struct.pack("<f", number)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def _place(engine: Engine, question: Question) -> str:
    """Return the place of a predicate's first clause."""
    clauses = engine.clauses(question.name, question.arity)
    return str(clauses[0].span or "asserted") if clauses else "asserted"


def _shown(value: Any) -> str:
    """Return a value as it is written in the rules."""
    if isinstance(value, Compound) and value.name == "-" and len(value.args) == 2:
        return "-".join(map(_shown, value.args))
    if isinstance(value, list):
        return f"[{', '.join(map(_shown, value))}]"
    return str(value)
