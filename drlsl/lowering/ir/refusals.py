"""Why a program, or one scene, cannot be answered by generated code."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from drlsl.logic.syntax import Span


class NotLowerable(Exception):
    """A rule that only the interpreter can run: which predicate, where, and why.

    `predicate` is written name/arity; `span` is where the clause was read, None where that is not known.
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
    """Generated code cannot answer for this scene: ask the interpreter, which may raise an error of its own.

    A fact of another kind than the schema says, a number out of bounds, an arithmetic error on the way.
    """


@dataclass(frozen=True, slots=True)
class Doubt:
    """Why generated code can be undecided: in which clause (None where it is not known) what happens."""

    span: Span | None
    reason: str

    def __str__(self) -> str:
        return f"{self.span}: {self.reason}" if self.span is not None else self.reason
