"""The questions of driving to a rule program."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

from drlsl.logic import Engine


@dataclass(frozen=True, slots=True)
class Question:
    """A predicate to query, and the variable of its answer; none: whether it holds.

    `many`: every answer counts, not only the first; `required`: a program must define it.
    """

    name: str
    variable: str = ""
    many: bool = False
    required: bool = True

    @property
    def arity(self) -> int:
        """The number of arguments."""
        return 1 if self.variable else 0

    @property
    def goal(self) -> str:
        """The goal of the query, as text."""
        return f"{self.name}({self.variable})" if self.variable else self.name

    @property
    def mode(self) -> Literal["holds", "first", "all"]:
        """The answers that count."""
        if not self.variable:
            return "holds"
        return "all" if self.many else "first"

    def __str__(self) -> str:
        return f"{self.name}/{self.arity}"


ACTIONS: Final = Question("safe_actions", "Action", many=True)
SPEED: Final = Question("longitudinal_velocity", "Speed")
STATE: Final = Question("state", "Observation")
FREE: Final = Question("front_is_free")
LANE: Final = Question("lane_to_keep", "Lane", required=False)
COMFORT: Final = Question("comfortable_acceleration", "Acceleration", required=False)
ENTRY: Final = Question("entry_is_safe")

NAMES: Final = Question("state_names", "Names", required=False)
BOUNDS: Final = Question("state_bounds", "Bounds", required=False)


def questions_of_a_decision(engine: Engine) -> list[Question]:
    """Return the questions whose answers make a decision of a program."""
    optional = (one for one in (LANE, COMFORT) if engine.defines(one.name, one.arity))
    return [ACTIONS, SPEED, STATE, FREE, *optional]


QUESTIONS: Final = (ACTIONS, FREE, SPEED, STATE, ENTRY, LANE, COMFORT)
"""The questions about a scene; `NAMES` and `BOUNDS` are asked once, before there is any."""
