"""The names of actions in a rule program, looked at before it drives."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from drlsl.driving.scene import action_of_atom
from drlsl.driving.shield.questions import ACTIONS
from drlsl.errors import UserError
from drlsl.logic import Engine
from drlsl.logic.terms import Atom, Struct, Var, deref, format_term

_NAME_ACTIONS: Final = ((ACTIONS.name, ACTIONS.arity), ("objection", 2))
"""Predicates whose first argument is an action."""


def unknown_actions(engine: Engine) -> Iterator[tuple[str, str]]:
    """Yield the place of each clause that is about an unknown action, and what is wrong with it.

    Nothing else would tell: a misspelt action is never offered, and an objection to it takes none away.
    """
    for name, arity in _NAME_ACTIONS:
        for clause in engine.clauses(name, arity):
            head = deref(clause.head)
            assert isinstance(head, Struct)
            action = deref(head.args[0])
            if isinstance(action, Var):
                continue
            try:
                action_of_atom(
                    action.name if isinstance(action, Atom) else format_term(action, engine.operators)
                )
            except UserError as error:
                yield str(clause.span or "asserted"), f"{name}/{arity}: {error}"
