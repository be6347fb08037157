"""Count the vehicles that the ego overtakes on the right, from positions alone and not from the rules.

python scripts/overtakings.py --recording highway-train --policy always-change
python scripts/overtakings.py --rules rules/overtake_left.pl --policy runs/left
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from drlsl.driving import POLICIES, EnvConfig
from drlsl.driving.scene import Action, SceneBatch
from drlsl.driving.shield import Shield
from drlsl.driving.simulation import World, in_direction, playbacks_of
from drlsl.traffic import load_recording

Mask: TypeAlias = npt.NDArray[np.bool_]
Choice: TypeAlias = Callable[[World, npt.NDArray[np.float64]], npt.NDArray[np.int64]]

EGOS: Final = 100
"""Episodes that run at once."""

SOON: Final = 20.0
"""Seconds within which an overtaking counts as the purpose of the lane change before it."""

QUEUE_SPEED: Final = 60 / 3.6
QUEUE_EXCESS: Final = 20 / 3.6
"""Vehicles up to QUEUE_SPEED may be passed on the right, up to QUEUE_EXCESS faster [m/s].

Source: BGH, 4 StR 242/67.
"""


@dataclass
class Counts:
    """Numbers of vehicles that the ego passed in a lane to their right."""

    episodes: int = 0
    kilometres: float = 0.0
    steps: int = 0
    changes_to_the_left: int = 0
    changes_to_the_right: int = 0
    contacts_at_fault: int = 0
    passed_on_the_right: int = 0
    """However it came to be in that lane."""
    after_a_lane_change: int = 0
    """Of these, those that were ahead in the lane that it last left, to the right, or further left."""
    within_20_s: int = 0
    """Of these, those passed within `SOON` after that."""
    and_not_allowed: int = 0
    """Of these, those that were too fast, or passed too fast, to be allowed."""


class Overtakings:
    """Counter that follows N egos from scene to scene."""

    def __init__(self, counts: Counts) -> None:
        self.counts = counts
        self._before: SceneBatch | None = None
        self._behind: Mask = np.zeros((0, 0), dtype=np.bool_)
        self._since = np.zeros(0)

    def step(self, scenes: SceneBatch, actions: npt.NDArray[np.int64], changed: Mask, placed: Mask) -> None:
        """Count in `scenes`, to which `actions` led.

        `changed`: egos that began a lane change; `placed`: egos that did not drive to where they are.
        """
        before = self._before
        self._before = scenes
        if before is None:
            self._behind = np.zeros(scenes.valid.shape, dtype=np.bool_)
            self._since = np.zeros(len(scenes))
            return
        self._begin(before, changed & (actions == Action.RIGHT_LANE_CHANGE))
        self._behind[placed | (changed & (actions == Action.LEFT_LANE_CHANGE))] = False
        same = before.valid & scenes.valid & (before.id == scenes.id) & ~placed[:, None]
        passed = same & (_ahead(before) > 0.0) & (_ahead(scenes) <= 0.0) & _left(scenes, own_lane=False)
        begun = passed & self._behind
        soon = begun & (self._since < SOON)[:, None]
        speed = np.abs(scenes.vx)
        slowly = (speed <= QUEUE_SPEED) & (speed[:, :1] - speed <= QUEUE_EXCESS)
        self.counts.passed_on_the_right += int(passed.sum())
        self.counts.after_a_lane_change += int(begun.sum())
        self.counts.within_20_s += int(soon.sum())
        self.counts.and_not_allowed += int((soon & ~slowly).sum())
        self._behind &= same & ~passed
        self._since += [scenes.roads[road].time_step for road in scenes.road.tolist()]

    def _begin(self, scenes: SceneBatch, changes: Mask) -> None:
        """Record which vehicles are ahead on the left when a lane change to the right begins."""
        ahead = scenes.valid & (_ahead(scenes) > 0.0) & _left(scenes, own_lane=True)
        self._behind = np.where(changes[:, None], ahead, self._behind)
        self._since[changes] = 0.0


def _signs(scenes: SceneBatch) -> npt.NDArray[np.int64]:
    """Return the direction of each vehicle's lane, 1 or -1; 0 outside any lane. Shape: (N, K + 1)."""
    most = max(lane.id for road in scenes.roads for lane in road.lanes)
    table = np.zeros((len(scenes.roads), most + 1), dtype=np.int64)
    for number, road in enumerate(scenes.roads):
        for lane in road.lanes:
            table[number, lane.id] = lane.direction.sign
    known = (scenes.lane >= 0) & (scenes.lane <= most)
    return np.where(known, table[scenes.road[:, None], np.where(known, scenes.lane, 0)], 0)


def _ahead(scenes: SceneBatch) -> npt.NDArray[np.float64]:
    """Return how far each vehicle's centre is ahead of the ego's [m]. Shape: (N, K + 1)."""
    return np.asarray(_signs(scenes)[:, :1] * (scenes.x - scenes.x[:, :1]))


def _left(scenes: SceneBatch, *, own_lane: bool) -> Mask:
    """Return which vehicles are in a lane of the ego's direction to its left, or in its own if `own_lane`."""
    signs = _signs(scenes)
    own = scenes.lane == scenes.lane[:, :1]
    further = ~own & (signs[:, :1] * (scenes.y[:, :1] - scenes.y) > 0.0)
    return np.asarray((signs == signs[:, :1]) & (further | (own if own_lane else False)))


def drive(config: EnvConfig, choose: Choice, *, episodes: int, seed: int) -> Counts:
    """Drive episodes with a policy that chooses among the offered actions, and count."""
    counts = Counts()
    recordings = [load_recording(name) for name in config.recordings]
    playbacks = in_direction(playbacks_of(recordings, config.radar_range, config.lane_limits), config)
    world = World(
        config, [playbacks] * min(EGOS, episodes), Shield.from_files(config.rules, tier=config.tier)
    )
    seeds = iter(np.random.SeedSequence(seed).spawn(episodes + 1))
    drawn = np.random.default_rng(next(seeds))
    following = Overtakings(counts)
    everyone = list(range(world.count))
    world.reset(everyone, [np.random.default_rng(next(seeds)) for _ in everyone])
    nobody = np.zeros(world.count, dtype=np.bool_)
    following.step(world.seen, np.zeros(world.count, dtype=np.int64), nobody, nobody)
    running, restarts = ~nobody, dict[int, np.random.Generator]()
    while running.any():
        actions = choose(world, drawn.random((world.count, len(Action))))
        result = world.step(actions, restarts)
        begun = np.isin(everyone, list(restarts))
        moved = running & ~begun
        changed = result.changed & moved
        following.step(result.scenes, actions, changed, result.entered | begun | ~running)
        counts.steps += int(moved.sum())
        counts.changes_to_the_left += int((changed & (actions == Action.LEFT_LANE_CHANGE)).sum())
        counts.changes_to_the_right += int((changed & (actions == Action.RIGHT_LANE_CHANGE)).sum())
        ended = moved & (result.terminated | result.truncated)
        counts.episodes += int(ended.sum())
        counts.kilometres += float(result.distance[ended].sum()) / 1000
        contacts = [contact for ego, contact in result.contacts.items() if moved[ego]]
        counts.contacts_at_fault += sum(contact.verdict.value == "at_fault" for contact in contacts)
        restarts = {ego: np.random.default_rng(one) for ego, one in zip(_places(ended), seeds, strict=False)}
        running &= ~ended
        running[list(restarts)] = True
    return counts


def _places(mask: Mask) -> Iterator[int]:
    yield from np.flatnonzero(mask).tolist()


def trained(run: Path, config: EnvConfig) -> Choice:
    """Return the policy of a run folder, greedy among the offered actions."""
    from drlsl.learning import RunFolder, greedy_choice, load_policy, make_evaluation_env

    policy = load_policy(RunFolder.open(run), make_evaluation_env(config))

    def choose(world: World, _drawn: npt.NDArray[np.float64]) -> npt.NDArray[np.int64]:
        observed = world.decisions.observation.astype(np.float32)
        return np.asarray(greedy_choice(policy.values(observed), world.decisions.action_mask).actions)

    return choose


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the counts."""
    parser = argparse.ArgumentParser(description="Count the vehicles that the ego overtakes on the right.")
    parser.add_argument("--recording", nargs="+", default=["highway-train"])
    parser.add_argument("--rules", nargs="+", default=[])
    parser.add_argument("--policy", default="random", help=f"{', '.join(POLICIES)}, or a run folder")
    parser.add_argument("--traffic", choices=["auto", "recorded", "reactive"], default="auto")
    parser.add_argument("--episodes", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(arguments)
    settings: dict[str, Any] = {"recording": given.recording, "rules": given.rules, "traffic": given.traffic}
    config = EnvConfig(**settings)
    choose = POLICIES.get(given.policy) or trained(Path(given.policy), config)
    counts = drive(config, choose, episodes=given.episodes, seed=given.seed)
    for field in fields(counts):
        value = getattr(counts, field.name)
        print(f"{field.name.replace('_', ' '):<22} {value:,.0f}")


if __name__ == "__main__":
    main()
