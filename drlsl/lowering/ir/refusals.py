"""Reasons why generated code cannot answer for a program, or for one scene."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from drlsl.logic.syntax import Span


class NotLowerable(Exception):
    """A rule that only the interpreter can run: the predicate, the place and the reason.

    `predicate` is written name/arity; `span` is where the clause was read, None if unknown.
    """

    def __init__(self, predicate: str, span: Span | None, reason: str) -> None:
        place = f"{span}: " if span is not None else ""
        super().__init__(f"{place}{predicate} cannot be lowered: {reason}")
        self.predicate = predicate
        self.span = span
        self.reason = reason

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.predicate, self.span, self.reason)


class Undecided(Exception):
    """Generated code cannot answer for this scene: query the interpreter, which may raise an error.

    Reasons: a fact of another kind than in the schema, a number out of bounds, an arithmetic error on the
    way.
    """


@dataclass(frozen=True, slots=True)
class Doubt:
    """A reason why generated code can be undecided, and its clause (None if unknown)."""

    span: Span | None
    reason: str

    def __str__(self) -> str:
        return f"{self.span}: {self.reason}" if self.span is not None else self.reason
