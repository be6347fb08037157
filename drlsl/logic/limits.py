"""How much one query may use."""

from __future__ import annotations

from dataclasses import dataclass

from drlsl.logic.errors import ResourceError, resource_error


class LimitExceeded(ResourceError):
    """A query went beyond its `Limits`. The program cannot catch it; the engine stays usable."""


@dataclass(frozen=True)
class Limits:
    """How much one query may use; None means no bound.

    Attributes:
        inferences: calls of predicates.
        seconds: wall-clock time spent searching [s], checked every few thousand inferences.
        depth: calls waiting for an inner one to end, checked about as often.
        trail: bindings that backtracking would have to undo and choice points it could go back to, together.
    """

    inferences: int | None = None
    seconds: float | None = None
    depth: int | None = 5_000_000
    trail: int | None = 20_000_000


def exceeded(resource: str, bound: str) -> LimitExceeded:
    """The error of a query that went beyond one of its limits."""
    error = LimitExceeded(resource_error(resource).term)
    error.add_note(f"The query went beyond its limit of {bound}.")
    return error
