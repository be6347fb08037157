"""Offers: the actions that rules offer in one state, and in many."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np
import numpy.typing as npt

NOT_OFFERED: Final = "the rules do not offer it"
"""The reason for an action against which the rules say nothing."""

MOST_REASONS: Final = 100
"""The number of reasons that are counted each."""


@dataclass(frozen=True, slots=True)
class Offer:
    """The actions offered in one state, in the order of `ActionRules.actions`, never none.

    Where the rules gave no usable answer, `failure` is the reason, and the fallback alone is offered.
    """

    actions: tuple[str, ...]
    failure: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Offers:
    """The actions offered in N states.

    `mask` (N, A) bool, by the order of `ActionRules.actions`, at least one in each row; `failures`: by state,
    the reason why the fallback alone is offered.
    """

    mask: npt.NDArray[np.bool_]
    failures: Mapping[int, str]


@dataclass(slots=True)
class Counts:
    """The counts of a shield since it was made.

    `decisions`; `fail_safes`: those for which the rules gave no usable answer; `interpreted`: those that a
    faster tier left to the interpreter; `not_offered`: actions asked for that were not offered; `replaced`:
    those of them in whose place another was taken.
    """

    decisions: int = 0
    fail_safes: int = 0
    interpreted: int = 0
    not_offered: int = 0
    replaced: int = 0
    failures: dict[str, int] = field(default_factory=dict)
    """How often each reason for the fallback was given; of the first hundred reasons."""

    def fail(self, reason: str) -> None:
        """Count a decision for which the rules gave no usable answer."""
        self.fail_safes += 1
        if reason in self.failures or len(self.failures) < MOST_REASONS:
            self.failures[reason] = self.failures.get(reason, 0) + 1
