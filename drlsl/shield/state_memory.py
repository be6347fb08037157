"""A memory of what the rules said about states."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Final, Generic, TypeVar

from drlsl.errors import UserError
from drlsl.shield.fact_forms import Facts

T = TypeVar("T")


class StateMemory(Generic[T]):
    """A memory of what was found for states, by their facts; the oldest give way to new ones."""

    def __init__(self, most: int) -> None:
        """Make room for `most` states.

        Raises:
            UserError: `most` is no integer from 0 on.
        """
        if isinstance(most, bool) or not isinstance(most, int) or most < 0:
            raise UserError(f"remember is {most!r}; expected a number of states, 0 for none")
        self.most: Final = most
        self._found: dict[Hashable, T] = {}

    def key(self, facts: Facts) -> Hashable | None:
        """Return what tells a state from others; None if nothing is kept for it."""
        if not self.most or not isinstance(facts, Mapping):
            return None
        try:
            key = tuple((relation, tuple(map(tuple, rows))) for relation, rows in facts.items())
            hash(key)
        except TypeError:  # no rows, or no kind that facts have: refused where the facts are stated
            return None
        return key

    def get(self, key: Hashable | None) -> T | None:
        """Return what was found for a state; None if nothing is kept."""
        return None if key is None else self._found.get(key)

    def keep(self, key: Hashable | None, found: T) -> None:
        """Keep what was found for a state."""
        if key is None:
            return
        if len(self._found) >= self.most:
            del self._found[next(iter(self._found))]
        self._found[key] = found
