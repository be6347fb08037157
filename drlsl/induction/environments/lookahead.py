"""A search over all chances, and all that may be done, for a way in which no failure follows an action."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from enum import IntEnum
from typing import Any

from drlsl.induction.environments.futures import Futures


class Verdict(IntEnum):
    """The verdict on an action, the worst first.

    `UNSAFE`: some chance leads to a failure within the horizon, whatever is done; `CUT`: the episode is cut
    short before one knows; `SAFE`: neither.
    """

    UNSAFE = 0
    CUT = 1
    SAFE = 2


class Lookahead:
    """Verdicts on the actions in states of an episode."""

    def __init__(self, futures: Futures, actions: Sequence[int], horizon: int) -> None:
        """Take the actions, those to be tried first in front, and the number of decisions to look ahead."""
        self._futures, self._actions, self._horizon = futures, tuple(actions), horizon
        self._known: dict[tuple[Hashable, int, int], Verdict] = {}

    def verdict(self, state: Any, action: int) -> Verdict:
        """Return the verdict on an action in a state."""
        return self._after(state, action, self._horizon - 1)

    def _after(self, state: Any, action: int, left: int) -> Verdict:
        """Return the worst of an action's outcomes, with so many decisions left."""
        key = (state, action, left)
        if self._futures.exact and key in self._known:
            return self._known[key]
        worst = Verdict.SAFE
        for outcome in self._futures.outcomes(state, action):
            if outcome.end == "failed":
                worst = Verdict.UNSAFE
            elif outcome.end == "truncated" and left:
                worst = min(worst, Verdict.CUT)
            elif outcome.end == "goes_on" and left:
                worst = min(worst, self._best(outcome.state, left))
            if worst == Verdict.UNSAFE:
                break
        if self._futures.exact:
            self._known[key] = worst
        return worst

    def _best(self, state: Any, left: int) -> Verdict:
        """Return the best that can be done in a state, with so many decisions left."""
        best = Verdict.UNSAFE
        for action in self._actions:
            best = max(best, self._after(state, action, left - 1))
            if best == Verdict.SAFE:
                break
        return best
