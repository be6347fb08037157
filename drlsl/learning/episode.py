"""One episode: its seed, the actions that it offers, and its counts."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drlsl.driving.simulation import TERMS, EpisodeMeasures, measures_of
from drlsl.learning.config import Method
from drlsl.traffic import Mask

ActionFilter = Callable[[Mask], Mask]
"""From the actions that the rules derive to be safe, the offered ones. Shape: (N, A) to (N, A)."""

TRAINING_STREAM, EVALUATION_STREAM = 1, 2
"""The family of episodes that a seed belongs to, so that no evaluation repeats a training episode."""


def all_actions(safe: Mask) -> Mask:
    """Offer every action: the shield is off."""
    return np.ones_like(safe)


def rule_safe_actions(safe: Mask) -> Mask:
    """Offer the actions that the rules (or the prediction, if configured) find safe: the shield is on.

    Source: Algorithm 1, line 8.
    """
    return safe


ACTION_FILTERS: Mapping[Method, ActionFilter] = {
    "dqn": all_actions,
    "mpsdqn": rule_safe_actions,
    "dqnsl": rule_safe_actions,
}


def episode_seed(seed: int, stream: int, index: int) -> int:
    """Return the seed of an environment's reset, a function of the run's seed and the episode's number."""
    sequence = np.random.SeedSequence(seed, spawn_key=(stream, index))
    return int(sequence.generate_state(1)[0])


def evaluation_seed(seed: int, index: int) -> int:
    """Return the seed of the reset that begins an episode of an evaluation, numbered from 0."""
    return episode_seed(seed, EVALUATION_STREAM, index)


@dataclass(frozen=True, slots=True)
class EpisodeSummary:
    """Totals of one episode; reward terms are weighted and sum to the return."""

    steps: int
    total_return: float
    reward_lane_change: float
    reward_velocity: float
    reward_collision: float
    reward_off_road: float
    lane_changes: int
    contact: bool
    at_fault: bool
    contact_reason: str
    off_road: bool
    mean_speed: float
    """Mean over the steps, m/s."""
    distance: float
    """Driven in the episode, m."""
    mask_size: float
    """Mean number of actions that were offered."""
    interventions: int
    """Steps in which the action of highest value was not one the rules derive to be safe."""
    fail_safe: int
    """Steps in which the shield fell back to its fail-safe."""
    reward_lost_speed: float = 0.0
    reward_comfort: float = 0.0
    reward_jerk: float = 0.0
    not_offered: int = 0
    """Steps in which an action was asked for that was not offered, as the environment tells."""
    measures: EpisodeMeasures | None = None
    """None if the environment takes none."""

    @property
    def completed(self) -> bool:
        """True if the episode reached the end of the track."""
        return not (self.contact or self.off_road)


_PAPER_TERMS, _OTHER_TERMS = TERMS[:4], TERMS[4:]
_COUNTED = (
    "steps",
    "total_return",
    *_PAPER_TERMS,
    "lane_changes",
    "speed",
    "offered",
    "interventions",
    "fail_safe",
    *_OTHER_TERMS,
    "not_offered",
)
"""Quantities that a tally adds up in every episode; an older state lacks the last of them."""


class EpisodeTally:
    """Adds up N episodes step by step; `clear` restarts one that is over."""

    def __init__(self, count: int) -> None:
        self.sums = np.zeros((len(_COUNTED), count))
        """One row for each thing counted. Shape: (K, N)."""
        self._rows = dict(zip(_COUNTED, self.sums, strict=True))

    def add(
        self, rewards: NDArray[np.float64], info: Mapping[str, Any], offered: Mask, intervened: Mask
    ) -> None:
        """Count a step of every episode: the actions offered before it, and its rewards and info."""
        rows = self._rows
        rows["steps"] += 1
        rows["total_return"] += rewards
        for term, reward in info["rewards"].items():
            if term in rows:
                rows[term] += reward
        rows["lane_changes"] += info["lane_change"]
        rows["speed"] += info["speed"]
        rows["offered"] += offered.sum(axis=1)
        rows["interventions"] += intervened
        rows["fail_safe"] += info["fail_safe"]
        rows["not_offered"] += np.logical_not(info["offered"])

    def summary(self, index: int, info: Mapping[str, Any]) -> EpisodeSummary:
        """Close an episode with the info of its last step."""
        sums = {name: float(row[index]) for name, row in self._rows.items()}
        last = {key: np.ravel(info[key])[index] for key in ("contact", "at_fault", "off_road", "distance")}
        return EpisodeSummary(
            steps=int(sums["steps"]),
            total_return=sums["total_return"],
            **{f"reward_{term}": sums[term] for term in TERMS},
            lane_changes=int(sums["lane_changes"]),
            contact=bool(last["contact"]),
            at_fault=bool(last["at_fault"]),
            contact_reason=str(np.ravel(info["contact_reason"])[index]) if last["contact"] else "",
            off_road=bool(last["off_road"]),
            mean_speed=sums["speed"] / sums["steps"],
            distance=float(last["distance"]),
            mask_size=sums["offered"] / sums["steps"],
            interventions=int(sums["interventions"]),
            fail_safe=int(sums["fail_safe"]),
            not_offered=int(sums["not_offered"]),
            measures=measures_of(info["measures"], index) if "measures" in info else None,
        )

    def restore(self, sums: NDArray[np.float64]) -> None:
        """Take over the sums of a state."""
        self.sums[:] = 0.0
        self.sums[: len(sums)] = sums

    def clear(self, index: int) -> None:
        """Begin an episode anew."""
        self.sums[:, index] = 0.0
