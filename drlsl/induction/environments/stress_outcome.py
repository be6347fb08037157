"""The outcome of episodes behind learnt rules."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field

from drlsl.induction.environments.plain_facts import PlainFacts


@dataclass(frozen=True, slots=True)
class BadAction:
    """An action that must not be offered: the facts of the state, its name, and where it was found."""

    facts: PlainFacts
    action: str
    origin: str


@dataclass(slots=True)
class StressCounts:
    """The counts of episodes behind learnt rules.

    `failures` of the episodes; `unexplained`: those of them before which nothing that was learnt to be safe
    was unsafe; `not_learnt`: decisions in which nothing was learnt to be safe; `fail_safes`: decisions in
    which the rules gave no usable answer.
    """

    episodes: int = 0
    decisions: int = 0
    failures: int = 0
    unexplained: int = 0
    not_learnt: int = 0
    fail_safes: int = 0

    def add(self, other: StressCounts) -> None:
        """Add the counts of other episodes."""
        for name, count in asdict(other).items():
            setattr(self, name, getattr(self, name) + count)


@dataclass(slots=True)
class RuleStress:
    """The counts of some episodes, and the bad actions found in them."""

    counts: StressCounts = field(default_factory=StressCounts)
    bad: list[BadAction] = field(default_factory=list)

    def add(self, other: RuleStress) -> None:
        """Add what happened in other episodes."""
        self.counts.add(other.counts)
        self.bad += other.bad
