"""The quantities and conditions of learnt clauses, as `learn/2` and `learn/3` declare them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal, TypeAlias

import numpy as np

from drlsl.errors import UserError
from drlsl.logic import Engine, Limits, Solution
from drlsl.lowering import Schema, find_mistakes
from drlsl.shield import consult_rules
from drlsl.traffic import Floats, Integers

Direction: TypeAlias = Literal["more", "less", "holds", "fails"]
"""Of a number, whether more or less of it is safer; of a condition, whether it is safer where it holds."""

STEP: Final = 1.0
"""What the limits of a quantity declared by `learn/2` are multiples of."""

EASIEST: Final = 2**31 - 1
"""The ease of a quantity without a solution: nothing is concerned. clingo has integers of 32 bits."""

LIMITS: Final = Limits(inferences=2_000_000)
"""The limits of a question to the program by the interpreter."""

_CHOICE, _NUMBER = "drlsl_choice", "drlsl_number"

_DECLARATIONS: Final = {2: "learn(Quantity, Direction), Step = none", 3: "learn(Quantity, Direction, Step)"}
"""The goals by which quantities are declared, by arity."""

_QUESTIONS: Final = "the quantities to learn from"
"""The place of the clauses that ask for quantities."""

_DECLARED: Final = f"""
    Quantity =.. Parts,
    ( memberchk(Direction, [holds, fails, either]) -> Longer = Parts ; append(Parts, [{_NUMBER}], Longer) ),
    Goal =.. Longer, term_variables(Goal, Choices), maplist(=({_CHOICE}), Choices),
    with_output_to(atom(Text), write_term(Goal, [quoted(true), spacing(next_argument)]))
"""


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number of which more or less is never less safe, or a condition that a clause may ask for.

    `goal`: the text of a goal in which {choice} and {number} stand for what is chosen, a side or an action,
    and for the number; `variable` is the name of the former in clauses. Limits are multiples of `step`: the
    first 10, then only every second, above 20 every fifth, and so on by decades.
    """

    goal: str
    direction: Direction
    step: float = STEP
    variable: str = "Side"

    def __str__(self) -> str:
        return self.goal.format(choice=self.variable, number="_")

    @property
    def more(self) -> bool:
        """True if more of the number is never less safe."""
        return self.direction == "more"

    @property
    def is_condition(self) -> bool:
        """True if it is a condition and has no number."""
        return self.direction in ("holds", "fails")

    @property
    def round_limits(self) -> Integers:
        """The eases that a limit may have, in hundredths, in ascending order."""
        if self.is_condition:
            return np.array([1])
        decade = np.concatenate([np.arange(*each) for each in ((10, 20, 2), (20, 50, 5), (50, 100, 10))])
        multiples = np.concatenate([np.arange(1, 10), *(decade * 10**more for more in range(8))])
        positive = multiples * round(self.step * 100)
        positive = positive[positive < EASIEST]
        return np.concatenate([-positive[::-1], [0], positive])

    def clause(self, name: str, choice: str) -> str:
        """Return the clause of `name(V)` for the hardest number of a choice; it fails if there is none.

        Of a condition the number is 0 where it is not as asked.
        """
        goal = self.goal.format(choice=choice, number="X")
        if self.is_condition:
            return f"{name}(0) :- {goal}." if self.direction == "fails" else f"{name}(0) :- \\+ {goal}."
        return f"{name}(V) :- aggregate_all({'min' if self.more else 'max'}(X), {goal}, V)."

    def literal(self, ease: int, variable: str) -> str:
        """Return the condition that this is as easy as `ease`, in hundredths, in every solution."""
        goal = self.goal.format(choice=self.variable, number=variable)
        if self.is_condition:
            return goal if self.direction == "holds" else f"\\+ {goal}"
        comparison, limit = (">=", ease / 100) if self.more else ("=<", -ease / 100)
        return f"forall({goal}, {variable} {comparison} {limit + 0.0!r})"

    def words(self, ease: float) -> str:
        """Return a value for people, given as its ease in hundredths; nothing is concerned at infinity."""
        if self.is_condition:
            return "yes" if (ease >= EASIEST) == (self.direction == "holds") else "no"
        if ease >= EASIEST:
            return "-"
        return f"{(ease if self.more else -ease) / 100 + 0.0:.2f}"

    def bound(self, ease: int) -> str:
        """Return the condition that this is as easy as `ease`, in hundredths, for people."""
        if self.is_condition:
            return f"{self}{'' if self.direction == 'holds' else ' not'}"
        return f"{self} {'at least' if self.more else 'at most'} {self.words(ease)}"


class Bias:
    """A rule program, what it declares for learning, and the choices of which that is asked.

    `values` of a scene or state are the hardest number of each quantity for each choice; NaN without one.
    """

    noun: str = "example"
    """The word for an example."""

    def __init__(self, path: str | Path, choices: Sequence[str], variable: str, schema: Schema) -> None:
        """Load the program; `variable` is the name that clauses have for a choice.

        The facts are those of `schema`, and those that the program declares dynamic.

        Raises:
            UserError: the file cannot be read, or does not declare quantities as it should.
            PrologError: it is not a valid program.
        """
        self.path = Path(path)
        self.choices = tuple(choices)
        self.engine = Engine()
        consult_rules(self.engine, path)
        self.quantities: Final = declared_quantities(self.engine, self.path.name, variable)
        self.names: Final = [
            f"drlsl_number_{choice}_{n}" for choice in self.choices for n in range(len(self.quantities))
        ]
        """The predicates of the hardest numbers, by choice and quantity."""
        goals = [(one, choice) for choice in self.choices for one in self.quantities]
        clauses = [one.clause(name, choice) for name, (one, choice) in zip(self.names, goals, strict=True)]
        self.engine.consult_text("\n".join(clauses), _QUESTIONS)
        for finding in find_mistakes(self.engine, schema):
            if finding.error and finding.place.startswith(_QUESTIONS):
                raise UserError(
                    f"{self.path.name}: what learn/2 or learn/3 declares: {finding.message}; a number is the "
                    "last argument of its predicate, and not written in the declaration"
                )

    def choice_words(self, choice: int) -> str:
        """Return a choice for people."""
        return self.choices[choice]

    def eases(self, values: Floats) -> Any:
        """Return values, shape (…, Q), as whole hundredths of which more is never less safe.

        They are rounded to the harder side, so that a limit in hundredths holds of the value exactly if it
        holds of its ease.

        Raises:
            UserError: a value is beyond 32 bits.
        """
        signed = values * np.array([-1.0 if one.direction == "less" else 1.0 for one in self.quantities])
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

    def number(self, value: Any) -> float:
        """Return the hardest number that the program gave; NaN for None, which is no solution.

        Raises:
            UserError: it is no number.
        """
        if value is None:
            return math.nan
        if not isinstance(value, int | float):
            raise UserError(f"{self.path}: a quantity to learn from is {value}, and no number")
        return float(value)


def declared_quantities(engine: Engine, file: str, variable: str) -> tuple[Quantity, ...]:
    """Return what the clauses of `learn/2` and `learn/3` declare, in their order.

    Raises:
        UserError: there is none, or one is not of the form learn(gap(Side, ahead), more).
    """
    found: list[Quantity] = []
    for solution in _declarations(engine):
        text, direction, step = str(solution["Text"]), str(solution["Direction"]), solution["Step"]
        text = text.replace("{", "{{").replace("}", "}}")
        goal = text.replace(_CHOICE, "{choice}").replace(_NUMBER, "{number}")
        shown = goal.format(choice=variable, number="_")
        if direction not in ("more", "less", "holds", "fails", "either"):
            raise UserError(
                f"{file}: learn({shown}, {direction}): expected more or less of a number, or holds, fails or "
                "either of a condition, as the safer direction"
            )
        width = STEP if step == "none" else step
        if not isinstance(width, int | float) or not 0.01 <= width < math.inf:
            raise UserError(f"{file}: learn({shown}, {direction}, {step}): expected a step of 0.01 or more")
        if any(known.goal == goal for known in found):
            raise UserError(f"{file}: {shown} is declared twice by learn/2 or learn/3")
        directions: tuple[Any, ...] = ("holds", "fails") if direction == "either" else (direction,)
        found += [Quantity(goal, one, float(width), variable) for one in directions]
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
