"""Facts in a form that can be compared and kept: tuples of Python's own numbers and texts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import gymnasium
import numpy as np

from drlsl.errors import UserError
from drlsl.shield import Facts, told_facts

PlainFacts: TypeAlias = tuple[tuple[str, int, tuple[tuple[Any, ...], ...]], ...]
"""Name, arity and rows of every relation, in the order of the facts."""


def facts_in(facts: Callable[[Any], Facts], env: gymnasium.Env[Any, Any]) -> PlainFacts:
    """Return the facts of an environment's present state.

    Raises:
        UserError: `facts` raised an error, or returned something else than facts.
    """
    told = told_facts(facts, env.unwrapped)
    try:
        return tuple(
            (str(name), int(arity), tuple(tuple(_plain(value) for value in row) for row in rows))
            for (name, arity), rows in told.items()
        )
    except (TypeError, ValueError, AttributeError) as error:
        raise UserError(
            f"facts are {told!r:.80}; expected a mapping of (name, arity) to a list of tuples"
        ) from error


def as_facts(plain: PlainFacts) -> Facts:
    """Return facts as rules are told them."""
    return {(name, arity): list(rows) for name, arity, rows in plain}


def of_json(values: list[Any]) -> PlainFacts:
    """Return the facts that a file has."""
    return tuple((name, arity, tuple(tuple(row) for row in rows)) for name, arity, rows in values)


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value
