"""The clauses that speak against actions, and which of them gives a reason."""

from __future__ import annotations

import copy
from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final, NamedTuple

from drlsl.driving.explain.reasons import Objection, objection_of, objections_to
from drlsl.driving.scene import Action, Scene, action_of_atom
from drlsl.driving.shield import LIMITS, Shield
from drlsl.logic import Engine
from drlsl.logic.core import Clause, Indicator
from drlsl.logic.syntax import ReadTerm
from drlsl.logic.terms import Struct

OBJECTION: Final[Indicator] = ("objection", 2)


@dataclass(frozen=True, slots=True)
class RuleClause:
    """A clause as its file has it: the file's name, the number of its first line, and its lines."""

    file: str
    line: int
    text: str


class Reason(NamedTuple):
    """An objection to an action, and the number of its clause, from 0; None if none is known."""

    action: Action
    objection: Objection
    clause: int | None


class ReasonClauses:
    """The clauses of `objection/2` of a shield's program; they are asked in a copy of its engine."""

    def __init__(self, shield: Shield) -> None:
        self._shield = copy.copy(shield)
        self._names = split_objections(self._shield.engine)
        self._queries = [self._shield.engine.prepare(f"'{name}'(Action, Reason)") for name in self._names]

    @cached_property
    def texts(self) -> tuple[RuleClause, ...]:
        """The clauses in the order of their numbers."""
        return tuple(map(clause_text, self._shield.engine.clauses(*OBJECTION) if self._names else ()))

    def reasons(self, scene: Scene, actions: Collection[Action]) -> list[Reason]:
        """Return what the rules say against some actions in a scene, the most urgent of each action first.

        Raises:
            RuleFailure, PrologError, UserError: see `Shield.state_facts` and `objections_to`.
        """
        self._shield.state_facts(scene)
        found = objections_to(self._shield, actions)
        if not any(found.values()):
            return []
        given: dict[tuple[Action, Objection], int] = {}
        for number, query in enumerate(self._queries):
            for solution in query.solutions(LIMITS):
                action = action_of_atom(solution["Action"])
                given.setdefault((action, objection_of(action, solution["Reason"])), number)
        return [Reason(action, one, given.get((action, one))) for action in found for one in found[action]]


def split_objections(engine: Engine) -> list[str]:
    """Define for each clause of `objection/2` a predicate of its own, and return their names."""
    if not engine.defines(*OBJECTION):
        return []
    names = []
    for number, clause in enumerate(engine.clauses(*OBJECTION)):
        name = f"{OBJECTION[0]}, clause {number + 1}"
        head = Struct(name, clause.args)
        alone = Clause(head, clause.body, clause.span, clause.names, clause.source, clause.origin)
        engine.define(name, OBJECTION[1], [alone])
        names.append(name)
    return names


def clause_text(clause: Clause) -> RuleClause:
    """Return a clause as its file has it, or as it is written out if it comes from no text."""
    read, span = clause.origin, clause.span
    if not isinstance(read, ReadTerm) or span is None:
        return RuleClause("", 0, repr(clause.head))
    lines = read.source.text.splitlines()[span.line - 1 : span.end_line]
    return RuleClause(Path(span.name).name, span.line, "\n".join(lines))
