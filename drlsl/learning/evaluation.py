"""A policy judged: episodes of greedy driving, with the shield or without it."""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from drlsl.learning.dqn import greedy_choice
from drlsl.learning.episode import (
    EVALUATION_STREAM,
    EpisodeSummary,
    EpisodeTally,
    Highway,
    all_actions,
    episode_seed,
    rule_safe_actions,
)
from drlsl.learning.network import Policy

ShieldState = Literal["on", "off"]


def drive(
    env: Highway, policy: Policy, *, shield: ShieldState, episodes: int, seed: int
) -> Iterator[EpisodeSummary]:
    """Drive greedily, one summary per episode; the same seed gives the same episodes, shield on or off.

    The action of highest value is taken: with the shield on, among those the rules derive to be safe.

    Raises:
        DivergedError: a Q-value is not finite.
        ValueError: the environment gave an observation that is not finite, or offered no action.
    """
    for index in range(episodes):
        yield _drive_episode(env, policy, shield, episode_seed(seed, EVALUATION_STREAM, index))


def _drive_episode(env: Highway, policy: Policy, shield: ShieldState, seed: int) -> EpisodeSummary:
    offer = rule_safe_actions if shield == "on" else all_actions
    observation, info = env.reset(seed=seed)
    tally = EpisodeTally(1)
    over = False
    while not over:
        safe = info["action_mask"][None].astype(np.bool_)
        offered = offer(safe)
        choice = greedy_choice(policy.values(observation[None]), offered)
        observation, reward, terminated, truncated, info = env.step(choice.actions[0])
        tally.add(np.array([reward], np.float64), info, offered, ~safe[:, choice.preferred[0]])
        over = terminated or truncated
    return tally.summary(0, info)


@dataclass(frozen=True, slots=True)
class Totals:
    """Episodes of one evaluation taken together.

    Source: Table 1 (lane changes, collisions, off-road, time steps).
    """

    episodes: int
    lane_changes: int
    contacts_at_fault: int
    contacts_not_at_fault: int
    off_road: int
    completed: int
    """Episodes that reached the end of the track."""
    mean_steps: float
    mean_steps_completed: float | None
    """Mean over the completed episodes alone, for a contact makes an episode short too; None without one."""
    mean_speed: float
    """Mean over all steps, m/s."""
    mean_return: float
    interventions: float
    """Share of steps in which the action of highest value was not one the rules derive to be safe."""
    fail_safe: int
    """Steps in which the shield fell back to its fail-safe."""


def totals(summaries: Sequence[EpisodeSummary]) -> Totals:
    """Take episodes together.

    Raises:
        ValueError: there are none.
    """
    if not summaries:
        raise ValueError("no episode to take together")
    steps = sum(item.steps for item in summaries)
    completed = [item.steps for item in summaries if not (item.contact or item.off_road)]
    return Totals(
        episodes=len(summaries),
        lane_changes=sum(item.lane_changes for item in summaries),
        contacts_at_fault=sum(item.contact and item.at_fault for item in summaries),
        contacts_not_at_fault=sum(item.contact and not item.at_fault for item in summaries),
        off_road=sum(item.off_road for item in summaries),
        completed=len(completed),
        mean_steps=steps / len(summaries),
        mean_steps_completed=float(np.mean(completed)) if completed else None,
        mean_speed=sum(item.mean_speed * item.steps for item in summaries) / steps,
        mean_return=float(np.mean([item.total_return for item in summaries])),
        interventions=sum(item.interventions for item in summaries) / steps,
        fail_safe=sum(item.fail_safe for item in summaries),
    )


EVALUATION_KEY = ("env", "shield", "seed", "episodes")
"""What tells one evaluation of a policy from another."""


def as_record(
    summaries: Sequence[EpisodeSummary], *, env: Mapping[str, Any], shield: ShieldState, seed: int
) -> dict[str, Any]:
    """An evaluation as plain values for evaluation.json; `env` is the environment's configuration."""
    together = dataclasses.asdict(totals(summaries))
    count = together.pop("episodes")
    return {
        "env": dict(env),
        "shield": shield,
        "seed": seed,
        "episodes": count,
        "totals": together,
        "per_episode": [dataclasses.asdict(item) for item in summaries],
    }
