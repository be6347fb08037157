"""Episodes that a driver drives while they are recorded."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from drlsl.driving import HighwayVectorEnv
from drlsl.driving.drivers import Driver, Situations, make_driver, most_wanted
from drlsl.driving.episodes import Episode, EpisodeRecorder, Origin

ORIGIN = Origin("mobil", "overtake-test", True, "rules", 0, 0, (), {"highway.pl": "0" * 64}, "preferences")


def drive(driver: Driver | None = None, *, seeds: tuple[int, ...] = (3, 4), **settings: Any) -> list[Episode]:
    """Return the episodes that a driver drives, MOBIL if none is given."""
    driver = driver or make_driver("mobil")
    given: dict[str, Any] = {"recording": "overtake-test", "track_length": 300.0} | settings
    env = HighwayVectorEnv(num_envs=len(seeds), autoreset_mode=AutoresetMode.DISABLED, **given)
    done: dict[int, Episode] = {}
    recorder = EpisodeRecorder(
        env.world, ORIGIN, lambda episode: done.update({episode.origin.number: episode})
    )
    env.watch = recorder.watch
    observations, info = env.reset(seed=list(seeds))
    recorder.begin({ego: ego + 1 for ego in range(len(seeds))})
    over = np.zeros(len(seeds), dtype=np.bool_)
    while len(done) < len(seeds):
        if over.any():
            env.reset(options={"reset_mask": over})
        offered = info["action_mask"].astype(np.bool_)
        preferences = driver.preferences(Situations(observations, offered, env.scenes(), env.branch))
        actions = most_wanted(preferences, offered).actions
        recorder.choose(actions, preferences)
        observations, _, terminated, truncated, info = env.step(actions)
        over = terminated | truncated
    return [done[number] for number in sorted(done)]
