"""Print how drivers fare in drlsl/Merge-v0: offered everything, or what highway.pl or merge.pl offers.

    python scripts/merges.py [--episodes 200] [--recording merge-test] [DRIVER ...]

A driver is `random` or the name of a driver of the package. Whoever drives, the speed is that of the rules:
those of merge.pl also where everything is offered. The table is that of docs/shielded-environments.md.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from drlsl.driving.drivers import DrivenBy, make_driver
from drlsl.driving.envs import MergeVectorEnv

RANDOM = "random"
TOGETHER = 50


OFFERS: Final[Mapping[str, Mapping[str, Any]]] = {
    "everything": {"offers": "all"},
    "by highway.pl": {"rules": ("highway.pl",)},
    "by merge.pl": {},
}
"""The settings for what is offered, in words."""


def drive(name: str, settings: Mapping[str, Any], episodes: int, recording: str) -> Counter[str]:
    """Return how often what happened in some episodes; of each environment equally many count.

    Who is in a lane that goes on when an episode ends has merged.
    """
    env = MergeVectorEnv(recording=recording, num_envs=TOGETHER, autoreset_mode="SameStep", **settings)
    _, info = env.reset(seed=1)
    rng, driver = np.random.default_rng(0), None if name == RANDOM else DrivenBy(make_driver(name))
    left = np.full(TOGETHER, episodes // TOGETHER)
    found: Counter[str] = Counter()
    while left.any():
        draws = rng.random((TOGETHER, 3)) * info["action_mask"]
        actions = draws.argmax(axis=1) if driver is None else driver.actions(env.world)
        ramp = [lane.id for lane in env.world.playback_of(0).entry_lanes]
        on_ramp = np.isin(env.scenes().lane[:, 0], ramp)
        *_, terminated, truncated, info = env.step(actions)
        playing = left > 0
        last = info.get("final_info", info)
        found["seconds"] += int(playing.sum())
        found["standing"] += int((playing & (info["speed"] < 0.5)).sum())
        for event in ("off_road", "contact", "at_fault", "fail_safe"):
            found[event] += int((playing & last[event].astype(np.bool_)).sum())
        found["merges"] += int((playing & truncated & ~on_ramp).sum())
        left -= playing & (terminated | truncated)
    return found


def main() -> None:
    """Print a row of the table for each driver and offer."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--episodes", type=int, default=200)
    parser.add_argument("--recording", default="merge-test")
    parser.add_argument("drivers", nargs="*", default=[RANDOM, "keep", "always-change", "mobil"])
    asked = parser.parse_args()
    if asked.episodes < TOGETHER or asked.episodes % TOGETHER:
        parser.error(f"--episodes is a multiple of {TOGETHER}")
    columns = "merges", "off the road", "contacts", "at fault", "fail-safe", "seconds each", "standing"
    print(f"| {asked.episodes} episodes | offered | {' | '.join(columns)} |")
    print(f"|---|---|{'--:|' * len(columns)}")
    for name in asked.drivers:
        for words, settings in OFFERS.items():
            found = drive(name, settings, asked.episodes, asked.recording)
            counts = [found[key] for key in ("merges", "off_road", "contact", "at_fault", "fail_safe")]
            shares = [f"{found['seconds'] / 10 / asked.episodes:.1f}"]
            shares.append(f"{100 * found['standing'] / found['seconds']:.0f} %")
            print(f"| {name} | {words} | {' | '.join([*map(str, counts), *shares])} |", flush=True)


if __name__ == "__main__":
    main()
