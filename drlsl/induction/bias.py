"""The language of learnt rules: what `learn/2` and `learn/3` declare, and its numbers in many scenes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal, TypeAlias

import numpy as np

from drlsl.driving.scene import SCHEMA, SceneBatch, facts_of
from drlsl.driving.shield import LIMITS, SceneProgram
from drlsl.errors import UserError
from drlsl.logic import Engine, Solution
from drlsl.lowering.backends import compile_numpy
from drlsl.lowering.frontend import Query, lower
from drlsl.lowering.ir import NotLowerable
from drlsl.shield import consult_rules
from drlsl.traffic import Floats, Integers

Side: TypeAlias = Literal["left", "right"]

SIDES: Final[tuple[Side, ...]] = ("left", "right")

OPENINGS: Final = "learning.pl"
"""The program that declares quantities where no other is named."""

STEP: Final = 1.0
"""What the limits of a quantity declared by `learn/2` are multiples of."""

_SIDE, _NUMBER = "drlsl_side", "drlsl_number"

_DECLARATIONS: Final = {2: "learn(Quantity, Direction), Step = none", 3: "learn(Quantity, Direction, Step)"}
"""The goals by which quantities are declared, by arity."""

_DECLARED: Final = f"""
    Quantity =.. Parts, append(Parts, [{_NUMBER}], Longer),
    Goal =.. Longer, term_variables(Goal, Sides), maplist(=({_SIDE}), Sides),
    with_output_to(atom(Text), write_term(Goal, [quoted(true), spacing(next_argument)]))
"""

OBJECTIONS: Final = """\
:- abolish(objection/2).

% objection(Action, Reason): Reason speaks against a lane change: one is under way, or no lane is open.
objection(Action, changing_lanes) :- lane_change(Action, _), \\+ settled.
objection(Action, no_lane) :- lane_change(Action, Side), \\+ side_lane(Side, _).
objection(Action, no_opening) :- lane_change(Action, Side), \\+ opening(Side).
"""
"""The objections of a learnt program; `opening(Side)` is what is learnt."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number of the vehicles in the way of a lane change, of which more or less is never less safe.

    `goal`: the text of a goal in which {side} and {number} stand for the side and the number; limits are
    multiples of `step`: the first 10, then only every second, above 20 every fifth, and so on by decades.
    """

    goal: str
    more: bool
    step: float = STEP

    def __str__(self) -> str:
        return self.goal.format(side="Side", number="_")

    @property
    def round_limits(self) -> Integers:
        """The eases that a limit may have, in hundredths, in ascending order."""
        decade = np.concatenate([np.arange(*each) for each in ((10, 20, 2), (20, 50, 5), (50, 100, 10))])
        multiples = np.concatenate([np.arange(1, 10), *(decade * 10**more for more in range(8))])
        positive = multiples * round(self.step * 100)
        positive = positive[positive < EASIEST]
        return np.concatenate([-positive[::-1], [0], positive])

    def literal(self, ease: int, variable: str) -> str:
        """Return the condition that this quantity is as easy as `ease`, in hundredths, for every vehicle."""
        comparison, limit = (">=", ease / 100) if self.more else ("=<", -ease / 100)
        goal = self.goal.format(side="Side", number=variable)
        return f"forall({goal}, {variable} {comparison} {limit + 0.0!r})"

    def words(self, ease: float) -> str:
        """Return a value for people, given as its ease in hundredths; nothing is in the way at infinity."""
        if ease >= EASIEST:
            return "-"
        return f"{(ease if self.more else -ease) / 100 + 0.0:.2f}"


EASIEST: Final = 2**31 - 1
"""The ease of a quantity without a solution: no vehicle is concerned. clingo has integers of 32 bits."""


class Bias:
    """A rule program, and the quantities that it declares for learning."""

    def __init__(self, path: str | Path) -> None:
        """Load the program.

        Raises:
            UserError: the file cannot be read, or does not declare quantities as it should.
            PrologError: it is not a valid program.
        """
        self.path = Path(path)
        self.engine = Engine()
        consult_rules(self.engine, path)
        self.quantities: Final = declared_quantities(self.engine, self.path.name)
        names = [f"drlsl_number_{side}_{n}" for side in SIDES for n in range(len(self.quantities))]
        self._names = names
        self.engine.consult_text("\n".join(self._clauses()), "the quantities to learn from")
        self._program = self._lowered()

    def _clauses(self) -> list[str]:
        """Return a clause for the hardest value of each quantity on each side."""
        goals = [(one, side) for side in SIDES for one in self.quantities]
        return [
            f"{name}(V) :- aggregate_all({'min' if one.more else 'max'}(X), "
            f"{one.goal.format(side=side, number='X')}, V)."
            for name, (one, side) in zip(self._names, goals, strict=True)
        ]

    def _lowered(self) -> SceneProgram | None:
        """Return the array program of the quantities; None if only the interpreter can run it."""
        try:
            queries = [Query(name, 1, "first") for name in self._names]
            return SceneProgram(compile_numpy(lower(self.engine, SCHEMA, queries)))
        except NotLowerable:
            return None

    def values(self, scenes: SceneBatch) -> Floats:
        """Return the hardest value of each quantity on each side, shape (N, 2, Q); NaN without a solution.

        Raises:
            UserError: a quantity has a solution that is no finite number.
        """
        count = len(self.quantities)
        result = np.full((len(scenes), len(self._names)), np.nan)
        undecided = np.ones(len(scenes), dtype=np.bool_)
        if self._program is not None and len(scenes):
            answers, undecided = self._program(scenes)
            for column, answer in enumerate(answers):
                result[:, column] = np.where(answer.fails, np.nan, np.asarray(answer.value, np.float64))
        for index in undecided.nonzero()[0].tolist():
            result[index] = self._asked(scenes, index)
        return result.reshape(len(scenes), len(SIDES), count)

    def _asked(self, scenes: SceneBatch, index: int) -> list[float]:
        """Return what the interpreter says of one scene."""
        for (name, arity), rows in facts_of(scenes.scene(index)).items():
            self.engine.replace_facts(name, arity, rows)
        found = []
        for name in self._names:
            solution = self.engine.once(f"{name}(V)", limits=LIMITS)
            value = math.nan if solution is None else solution["V"]
            if not isinstance(value, int | float):
                raise UserError(f"{self.path}: a quantity to learn from is {value}, and no number")
            found.append(float(value))
        return found

    def eases(self, values: Floats) -> Any:
        """Return values, shape (…, Q), as whole hundredths of which more is never less safe.

        They are rounded to the harder side, so that a limit in hundredths holds of the value exactly if it
        holds of its ease.

        Raises:
            UserError: a value is beyond 32 bits.
        """
        signed = values * np.array([1.0 if one.more else -1.0 for one in self.quantities])
        beyond = np.abs(signed) * 100 >= EASIEST
        if beyond.any():
            worst = self.quantities[int(np.argwhere(beyond)[0][-1])]
            raise UserError(
                f"{worst}: {np.nanmax(np.abs(values[..., self.quantities.index(worst)])):g} in hundredths is "
                "beyond the 32 bits of clingo's integers; declare a quantity of another unit"
            )
        with np.errstate(invalid="ignore"):
            whole = np.floor(signed * 100)
            whole = np.where(whole / 100 > signed, whole - 1, whole)
            whole = np.where((whole + 1) / 100 <= signed, whole + 1, whole)
        return np.where(np.isnan(signed), EASIEST, whole).astype(np.int64)


def declared_quantities(engine: Engine, file: str) -> tuple[Quantity, ...]:
    """Return what the clauses of `learn/2` and `learn/3` declare, in their order.

    Raises:
        UserError: there is none, or one is not of the form learn(gap(Side, ahead), more).
    """
    found: list[Quantity] = []
    for solution in _declarations(engine):
        text, direction, step = str(solution["Text"]), solution["Direction"], solution["Step"]
        text = text.replace("{", "{{").replace("}", "}}")
        goal = text.replace(_SIDE, "{side}").replace(_NUMBER, "{number}")
        shown = goal.format(side="Side", number="_")
        if direction not in ("more", "less"):
            raise UserError(
                f"{file}: learn({shown}, {direction}): expected more or less as the safer direction"
            )
        width = STEP if step == "none" else step
        if not isinstance(width, int | float) or not 0.01 <= width < math.inf:
            raise UserError(f"{file}: learn({shown}, {direction}, {step}): expected a step of 0.01 or more")
        one = Quantity(goal, direction == "more", float(width))
        if any(known.goal == one.goal for known in found):
            raise UserError(f"{file}: {shown} is declared twice by learn/2 or learn/3")
        found.append(one)
    if not found:
        raise UserError(
            f"{file} declares nothing to learn from; expected facts such as learn(gap(_, ahead), more)"
        )
    return tuple(found)


def _declarations(engine: Engine) -> Iterator[Solution]:
    """Yield the solutions of `learn/2` and `learn/3`, as far as they are defined."""
    for arity, goal in _DECLARATIONS.items():
        if engine.defines("learn", arity):
            yield from engine.query(f"{goal}, {_DECLARED}", limits=LIMITS)
