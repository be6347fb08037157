"""Evaluation of a policy: episodes of greedy driving, with the shield or without it."""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from gymnasium.vector import AutoresetMode

from drlsl import driving
from drlsl.driving import EnvConfig
from drlsl.learning.dqn import greedy_choice
from drlsl.learning.episode import EVALUATION_STREAM, EpisodeSummary, all_actions, rule_safe_actions
from drlsl.learning.fleet import Fleet, VectorHighway
from drlsl.learning.network import Policy

ShieldState = Literal["on", "off"]


SIDE_BY_SIDE: Final = 25
"""Episodes of an evaluation that are driven in step."""


def make_evaluation_env(config: EnvConfig) -> VectorHighway:
    """Return the environments to evaluate policies in.

    Raises:
        UserError: the recording or the rules cannot be used.
    """
    return driving.make_vec(config, SIDE_BY_SIDE, AutoresetMode.DISABLED)


def drive(
    env: VectorHighway, policy: Policy, *, shield: ShieldState, episodes: int, seed: int
) -> Iterator[EpisodeSummary]:
    """Drive greedily, one summary per episode; the same seed gives the same episodes, shield on or off.

    The action of highest value is taken: with the shield on, among those the rules derive to be safe.

    Raises:
        DivergedError: a Q-value is not finite.
        ValueError: the environment gave an observation that is not finite, or offered no action.
    """
    offer = rule_safe_actions if shield == "on" else all_actions
    fleet = Fleet(env, episodes=episodes, seed=seed, stream=EVALUATION_STREAM, window=policy.window)
    everyone = np.arange(env.num_envs)
    ahead: dict[int, EpisodeSummary] = {}
    following = 1
    while following <= episodes:
        fleet.begin()
        offered = offer(fleet.safe)
        choice = greedy_choice(policy.values(fleet.observations), offered)
        intervened = ~fleet.safe[everyone, choice.preferred]
        for ended in fleet.count(fleet.step(choice.actions), offered, intervened, ()):
            ahead[ended.episode] = ended.summary
        while following in ahead:
            yield ahead.pop(following)
            following += 1


@dataclass(frozen=True, slots=True)
class Totals:
    """Totals over the episodes of one evaluation.

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
    """Mean over the completed episodes only, because a contact shortens an episode, too; None without any."""
    mean_speed: float
    """Mean over all steps, m/s."""
    mean_return: float
    interventions: float
    """Share of steps in which the action of highest value was not one the rules derive to be safe."""
    fail_safe: int
    """Steps in which the shield fell back to its fail-safe."""


def totals(summaries: Sequence[EpisodeSummary]) -> Totals:
    """Add up episodes.

    Raises:
        ValueError: there are none.
    """
    if not summaries:
        raise ValueError("no episodes to add up")
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
"""Keys that identify an evaluation of a policy."""


def as_record(
    summaries: Sequence[EpisodeSummary], *, env: Mapping[str, Any], shield: ShieldState, seed: int
) -> dict[str, Any]:
    """Return an evaluation as plain values for evaluation.json; `env` is the environment's configuration."""
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
