"""The agent's three actions and their atoms in rule programs."""

from __future__ import annotations

from enum import IntEnum
from typing import Final

from drlsl.errors import UserError


class Action(IntEnum):
    """An action of the agent; the value is its index in Q-values and masks.

    Source: paper, Action Space.
    """

    LANE_KEEPING = 0
    LEFT_LANE_CHANGE = 1
    RIGHT_LANE_CHANGE = 2

    @property
    def atom(self) -> str:
        """The atom of the rules that stands for this action."""
        return self.name.lower()


ATOMS: Final[tuple[str, ...]] = tuple(action.atom for action in Action)
"""Atoms by action index."""

_BY_ATOM: Final = {action.atom: action for action in Action}


def action_of_atom(atom: object) -> Action:
    """Return the action that `atom` names.

    Raises:
        UserError: the atom names no action; an unknown one must never pass for another.
    """
    action = _BY_ATOM.get(atom) if isinstance(atom, str) else None
    if action is None:
        known = ", ".join(ATOMS)
        raise UserError(
            f"the rules name the action {atom!r}, which the agent does not know; it knows {known}"
        )
    return action
