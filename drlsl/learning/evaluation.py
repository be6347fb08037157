"""Evaluation of a policy: episodes of greedy driving, with the shield or without it."""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, Literal

import numpy as np
from gymnasium.vector import AutoresetMode

from drlsl import driving
from drlsl.driving import EnvConfig, HighwayVectorEnv
from drlsl.driving.drivers import Driver, most_wanted
from drlsl.driving.episodes import EpisodeRecorder
from drlsl.learning.episode import EVALUATION_STREAM, EpisodeSummary, all_actions, rule_safe_actions
from drlsl.learning.fleet import Fleet, VectorHighway
from drlsl.learning.totals import time_saved, times_of, totals

ShieldState = Literal["on", "off"]


SIDE_BY_SIDE: Final = 25
"""Episodes of an evaluation that are driven in step."""


def make_evaluation_env(config: EnvConfig) -> HighwayVectorEnv:
    """Return the environments to evaluate policies in.

    Raises:
        UserError: the recording or the rules cannot be used.
    """
    return driving.make_vec(config, SIDE_BY_SIDE, AutoresetMode.DISABLED, measured=True)


def drive(
    env: VectorHighway,
    driver: Driver,
    *,
    shield: ShieldState,
    episodes: int,
    seed: int,
    recorder: EpisodeRecorder | None = None,
    only: Sequence[int] | None = None,
) -> Iterator[EpisodeSummary]:
    """Drive, one summary per episode; the same seed gives the same episodes, shield on or off.

    The action that the driver wants most is taken: with the shield on, among those the rules derive to be
    safe. A `recorder`, which watches the environment, is told what the driver chooses. `only`:
    the numbers of the episodes to drive, in order, instead of all.

    Raises:
        DivergedError: a Q-value of a policy is not finite.
        ValueError: the environment gave an observation that is not finite, or offered no action.
    """
    offer = rule_safe_actions if shield == "on" else all_actions
    left = list(range(1, episodes + 1) if only is None else only)
    fleet = Fleet(
        env, episodes=episodes, seed=seed, stream=EVALUATION_STREAM, window=driver.window, only=only
    )
    everyone = np.arange(env.num_envs)
    ahead: dict[int, EpisodeSummary] = {}
    while left:
        began = fleet.begin()
        offered = offer(fleet.safe)
        preferences = driver.preferences(fleet.situations(offered))
        choice = most_wanted(preferences, offered)
        if recorder is not None:
            recorder.begin(began)
            recorder.choose(choice.actions, preferences)
        intervened = ~fleet.safe[everyone, choice.preferred]
        for ended in fleet.count(fleet.step(choice.actions), offered, intervened, ()):
            ahead[ended.episode] = ended.summary
        while left and left[0] in ahead:
            yield ahead.pop(left.pop(0))


EVALUATION_KEY = ("env", "shield", "seed", "episodes")
"""Keys that identify an evaluation of a policy."""


def as_record(
    summaries: Sequence[EpisodeSummary],
    *,
    env: Mapping[str, Any],
    shield: ShieldState,
    seed: int,
    kept: Sequence[float | None] | None = None,
) -> dict[str, Any]:
    """Return an evaluation as plain values for evaluation.json; `env` is the environment's configuration.

    `kept`: the durations of the same episodes if the lane is kept behind the shield, for `time_saved`.
    """
    together = dataclasses.asdict(totals(summaries))
    together["time_saved"] = None if kept is None else time_saved(times_of(summaries), kept)
    count = together.pop("episodes")
    episodes = [dataclasses.asdict(item) for item in summaries]
    for episode in episodes:
        episode["measures"] = None if episode["measures"] is None else _without_headways(episode["measures"])
    return {
        "env": dict(env),
        "shield": shield,
        "seed": seed,
        "episodes": count,
        "totals": together,
        "per_episode": episodes,
    }


def _without_headways(measures: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in measures.items() if name != "headways"}
