"""One episode: how it is seeded, which actions it offers, and what is counted."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from drlsl.config import Method
from drlsl.driving.reward import TERMS

Observation = NDArray[np.float32]
Mask = NDArray[np.bool_]
Highway = gymnasium.Env[Observation, np.int64]
ActionFilter = Callable[[Highway, Mapping[str, Any]], Mask]
"""Gives the actions offered in the state that `reset` or `step` described by its info. Shape: (A,), bool."""

TRAINING_STREAM, EVALUATION_STREAM = 1, 2
"""Which family of episodes a seed belongs to, so that no training episode is met again in an evaluation."""


def all_actions(env: Highway, info: Mapping[str, Any]) -> Mask:
    """Offer every action: the shield is off."""
    return np.ones(len(info["action_mask"]), np.bool_)


def rule_safe_actions(env: Highway, info: Mapping[str, Any]) -> Mask:
    """Offer what the rules derive to be safe: the shield is on.

    Source: Algorithm 1, line 8.
    """
    return np.asarray(info["action_mask"]).astype(np.bool_)


ACTION_FILTERS: Mapping[Method, ActionFilter] = {"dqn": all_actions, "dqnsl": rule_safe_actions}


def episode_seed(seed: int, stream: int, index: int) -> int:
    """The seed for an environment's reset, a function of the run's seed and the episode's number alone."""
    sequence = np.random.SeedSequence(seed, spawn_key=(stream, index))
    return int(sequence.generate_state(1)[0])


@dataclass(frozen=True, slots=True)
class EpisodeSummary:
    """What happened in one episode; reward terms are weighted and sum to the return."""

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


@dataclass(slots=True)
class EpisodeTally:
    """Adds up an episode step by step."""

    steps: int = 0
    total_return: float = 0.0
    terms: dict[str, float] = field(default_factory=lambda: dict.fromkeys(TERMS, 0.0))
    lane_changes: int = 0
    speed_sum: float = 0.0
    offered_sum: int = 0
    interventions: int = 0
    fail_safe: int = 0

    def add(self, reward: float, info: Mapping[str, Any], offered: Mask, intervened: bool) -> None:
        """Count one step: what was offered before it, and the reward and info it led to."""
        self.steps += 1
        self.total_return += reward
        for term, value in info["rewards"].items():
            self.terms[term] += float(value)
        self.lane_changes += bool(info["lane_change"])
        self.speed_sum += float(info["speed"])
        self.offered_sum += int(np.count_nonzero(offered))
        self.interventions += intervened
        self.fail_safe += bool(info["fail_safe"])

    def summary(self, info: Mapping[str, Any]) -> EpisodeSummary:
        """Close the episode with the info of its last step."""
        return EpisodeSummary(
            steps=self.steps,
            total_return=self.total_return,
            **{f"reward_{term}": self.terms[term] for term in TERMS},
            lane_changes=self.lane_changes,
            contact=bool(info["contact"]),
            at_fault=bool(info["at_fault"]),
            contact_reason=str(info["contact_reason"]) if info["contact"] else "",
            off_road=bool(info["off_road"]),
            mean_speed=self.speed_sum / self.steps,
            distance=float(info["distance"]),
            mask_size=self.offered_sum / self.steps,
            interventions=self.interventions,
            fail_safe=self.fail_safe,
        )
