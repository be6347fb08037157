"""A rule program that is about to leave Python: what is asked of it, lowered, and where it comes from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from drlsl.driving.explain import split_objections
from drlsl.driving.scene import SCHEMA, action_of_atom
from drlsl.driving.shield import (
    ACTIONS,
    Question,
    Shield,
    check_state,
    query_of,
    questions_of_a_decision,
)
from drlsl.errors import UserError
from drlsl.files import digest
from drlsl.logic.core import NODES
from drlsl.logic.terms import NIL, Atom, Struct
from drlsl.lowering.backends import tree_nodes
from drlsl.lowering.frontend import Lowered, Query, lower
from drlsl.lowering.ir import Node, NotLowerable, Sym, emitted, reach, resolve
from drlsl.version import __version__

OBJECTION: Final = Query("objection", 2, "all")

_INEXACT: Final = frozenset(
    name for name, row in NODES.items() if row.library and row.kind in ("real", "power")
)


@dataclass(frozen=True)
class RuleProgram:
    """The program of `shield`; `files` has the SHA-256 of each of its files."""

    shield: Shield
    files: dict[str, str]

    @classmethod
    def of(cls, paths: Sequence[Path]) -> RuleProgram:
        """Load the program in some files; none: highway.pl.

        Raises:
            UserError: a file cannot be read, or the program lacks a required predicate.
            PrologError: a file is not a valid program.
        """
        shield = Shield.from_files(paths)
        check_state(shield.engine, shield.observation)
        return cls(shield, {path.name: digest([path]) for path in shield.files()})

    @property
    def questions(self) -> list[Question]:
        """The questions whose answers make a decision."""
        return questions_of_a_decision(self.shield.engine)

    @property
    def has_reasons(self) -> bool:
        """Return whether the program says what speaks against an action."""
        return self.shield.engine.defines(OBJECTION.name, OBJECTION.arity)

    def defines(self, question: Question) -> bool:
        """Return whether the program answers a question."""
        return self.shield.engine.defines(question.name, question.arity)

    @property
    def knows_lane_ends(self) -> bool:
        """Return whether the program declares the fact that a lane ends, or has been told it."""
        return self.shield.engine.is_dynamic("lane_end", 2)

    def head(self, comment: str) -> str:
        """Return the first lines of an exported file: what it was made from, and by what."""
        lines = [
            f"Made by drlsl {__version__} from these rule files (SHA-256); to change it, export them again."
        ]
        lines += [f"  {name}  {seal}" for name, seal in self.files.items()]
        return "\n".join(f"{comment} {line}" for line in lines)

    def decision(self, *, ordered: bool) -> Lowered:
        """Return the questions of a decision lowered; with `ordered`, actions come in the order derived.

        Raises:
            NotLowerable: a rule that only the interpreter can run, with its place and the reason.
            UserError: the rules can offer an action that the agent does not know.
        """
        lowered = self._lowered([query_of(one, ordered=ordered) for one in self.questions])
        answer = lowered.answers[0]
        if answer.choices is None:
            raise NotLowerable(str(ACTIONS), None, "the actions that it gives are not among a few constants")
        for value, _ in answer.choices:
            action_of_atom(value.name if isinstance(value, Atom) else value)
        return lowered

    def reasons(self) -> Lowered:
        """Return the objections to actions, lowered.

        Raises:
            NotLowerable: a rule that only the interpreter can run, with its place and the reason.
            UserError: an objection is to an action that the agent does not know, or its reason has no name.
        """
        lowered = self._lowered([OBJECTION])
        for leaf in emitted(lowered.answers[0].tree):
            action, reason = map(resolve, leaf.terms)
            if not isinstance(action, Atom):
                raise NotLowerable(str(OBJECTION), None, "the action is not a constant")
            action_of_atom(action.name)
            _check_reason(action.name, reason)
        return lowered

    def clause_reasons(self) -> Lowered:
        """Return the objections of each clause of `objection/2` lowered, in the order of the clauses.

        Raises:
            NotLowerable: see `reasons`.
        """
        return self._lowered([Query(name, 2, "all") for name in split_objections(self.shield.engine)])

    @staticmethod
    def is_exact(lowered: Lowered) -> bool:
        """Return whether a program only calls functions that every language rounds alike."""
        pool = lowered.pool
        used = [node for one in lowered.answers for node, _ in tree_nodes(pool, one.tree, pool.true)]
        undecided = [one.undecided for one in lowered.answers]
        return not any(node.op in _INEXACT for node in reach([*used, *undecided]))

    def _lowered(self, queries: Sequence[Query]) -> Lowered:
        return lower(self.shield.engine, SCHEMA, queries)


def _check_reason(action: str, reason: Sym) -> None:
    is_name = isinstance(reason, Atom) and reason is not NIL
    if not is_name and not (isinstance(reason, Struct) and reason.name != "."):
        raise UserError(f"{OBJECTION}: a reason against {action} has no name; expected one such as no_lane")
    for detail in map(resolve, reason.args if isinstance(reason, Struct) else ()):
        if not isinstance(detail, Atom | int | float | Node):
            raise NotLowerable(str(OBJECTION), None, f"a detail of {reason.name} is a compound term")
