"""Conditional compilation: the directives if/1, elif/1, else/0 and endif/0 of one file.

Source: SWI-Prolog manual, 4.3.1 (conditional compilation).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from drlsl.logic.errors import PrologSyntaxError, syntax_error
from drlsl.logic.syntax import ReadTerm
from drlsl.logic.terms import Atom, Struct, Term, deref

_ARITIES: Final = {"if": 1, "elif": 1, "else": 0, "endif": 0}


class _Condition:
    """An open if/1: whether this branch is kept, whether a later one may be, whether else/0 was read."""

    __slots__ = ("at_else", "kept", "opened", "waiting")

    def __init__(self, opened: ReadTerm, *, kept: bool, waiting: bool) -> None:
        self.opened = opened
        self.kept = kept
        self.waiting = waiting
        self.at_else = False


class Conditions:
    """The conditions that are open at one place of a file."""

    def __init__(self, holds: Callable[[Term, ReadTerm], bool]) -> None:
        self._holds = holds
        self._open: list[_Condition] = []

    @property
    def skipping(self) -> bool:
        """True if the following text belongs to a branch that is not taken."""
        return bool(self._open) and not self._open[-1].kept

    def take(self, read: ReadTerm) -> bool:
        """Obey a term that is one of the four directives; return False for any other.

        Raises:
            PrologSyntaxError: Its if/1 is missing, or else/0 came before it.
        """
        directive = _directive(read.term)
        if directive is None:
            return False
        name, args = directive
        if name == "if":
            outside = self.skipping
            kept = not outside and self._holds(args[0], read)
            self._open.append(_Condition(read, kept=kept, waiting=not outside and not kept))
            return True
        if not self._open:
            raise _misplaced(read, f":- {name} without :- if")
        condition = self._open[-1]
        if name == "endif":
            self._open.pop()
            return True
        if condition.at_else:
            raise _misplaced(read, f":- {name} after :- else")
        condition.kept = condition.waiting and (name == "else" or self._holds(args[0], read))
        condition.waiting = condition.waiting and not condition.kept
        condition.at_else = name == "else"
        return True

    def unclosed(self) -> list[PrologSyntaxError]:
        """Return an error for each condition that is still open at the end of the file."""
        return [_misplaced(condition.opened, ":- if without :- endif") for condition in self._open]


def _directive(term: Term) -> tuple[str, tuple[Term, ...]] | None:
    """Return the name and the arguments of a directive of this kind."""
    if type(term) is not Struct or term.name != ":-" or len(term.args) != 1:
        return None
    goal = deref(term.args[0])
    args = goal.args if type(goal) is Struct else ()
    name = goal.name if isinstance(goal, Struct | Atom) else ""
    return (name, args) if _ARITIES.get(name) == len(args) else None


def _misplaced(read: ReadTerm, message: str) -> PrologSyntaxError:
    error = syntax_error(message)
    error.clause = str(read.span)
    return error
