"""Reasons against actions as tables write them: `no_lane`, `too_close a`, `lava(2, 1)`, `gap(_, 3)`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

from drlsl.logic import Compound, PrologError
from drlsl.logic.syntax import Flags, read_term
from drlsl.logic.terms import Atom, Operators, Struct, Term, Var, deref

_OPERATORS: Final = Operators()


@dataclass(frozen=True)
class ReasonPattern:
    """A reason as it is written; numbers may differ by `tolerance`.

    Without brackets it is a name, or a name and the first argument, whatever the others are. With brackets
    it is a term, in which `_` stands for anything.
    """

    text: str
    tolerance: float

    @property
    def is_open(self) -> bool:
        """True if it may stand for several reasons."""
        return "(" in self.text and "_" in self.text and _holds_variable(self._term())

    def check(self) -> None:
        """Check that it can be read.

        Raises:
            ValueError: it is no term.
        """
        if "(" in self.text:
            self._term()

    def matches(self, reason: Any) -> bool:
        """Return whether a reason that the rules gave is such a one."""
        if "(" in self.text:
            return self._agrees(self._term(), reason)
        return self.text == short(reason)

    def _term(self) -> Term:
        try:
            return read_term(self.text, _OPERATORS, Flags(), "reason").term
        except PrologError as error:
            raise ValueError(f"{self.text!r} is no reason: {str(error).splitlines()[0]}") from error

    def _agrees(self, wanted: Term, given: Any) -> bool:
        wanted = deref(wanted)
        if isinstance(wanted, Var):
            return True
        if isinstance(wanted, Struct):
            return (
                isinstance(given, Compound)
                and (given.name, len(given.args)) == (wanted.name, len(wanted.args))
                and all(map(self._agrees, wanted.args, given.args))
            )
        if isinstance(wanted, Atom):
            return bool(given == wanted.name)
        if isinstance(given, float) and isinstance(wanted, int | float):
            return abs(given - wanted) <= self.tolerance
        return type(given) is type(wanted) and bool(given == wanted)


def short(reason: Any) -> str:
    """Return a reason as its name and its first argument."""
    return f"{reason.name} {reason.args[0]}" if isinstance(reason, Compound) else str(reason)


def all_explained(patterns: Sequence[ReasonPattern], reasons: Sequence[Any]) -> bool:
    """Return whether reasons are those of the patterns, in any order.

    A pattern with `_` stands for one or more of the reasons, any other one for exactly one.
    """
    left = list(reasons)
    several = [pattern for pattern in patterns if pattern.is_open]
    for pattern in patterns:
        if pattern.is_open:
            continue
        place = next((place for place, reason in enumerate(left) if pattern.matches(reason)), None)
        if place is None:
            return False
        del left[place]
    return all(any(pattern.matches(reason) for pattern in several) for reason in left) and all(
        any(map(pattern.matches, left)) for pattern in several
    )


def _holds_variable(term: Term) -> bool:
    term = deref(term)
    if isinstance(term, Struct):
        return any(map(_holds_variable, term.args))
    return isinstance(term, Var)
