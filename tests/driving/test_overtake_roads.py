"""The bundled overtake roads are worth driving on: who changes lanes gets there sooner, and safely."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
import pytest

from drlsl.driving import EnvConfig
from drlsl.driving.scene import Action
from drlsl.driving.shield import Shield
from drlsl.driving.simulation import World, in_direction, playbacks_of
from drlsl.traffic import load_recording

EPISODES = 60

Choice: TypeAlias = Callable[[World], npt.NDArray[np.int64]]


def keep(world: World) -> npt.NDArray[np.int64]:
    return np.full(world.count, Action.LANE_KEEPING)


def change(world: World) -> npt.NDArray[np.int64]:
    """A lane change wherever one is offered, to the left rather than to the right."""
    left, right = (
        world.decisions.action_mask[:, action]
        for action in (Action.LEFT_LANE_CHANGE, Action.RIGHT_LANE_CHANGE)
    )
    return np.where(left, Action.LEFT_LANE_CHANGE, np.where(right, Action.RIGHT_LANE_CHANGE, keep(world)))


def times(name: str, choose: Choice) -> tuple[npt.NDArray[np.float64], int]:
    """Seconds of each episode, NaN where it ended early, and how many were ended by the ego's fault."""
    config = EnvConfig(recording=name)
    recording = load_recording(name)
    playbacks = in_direction(playbacks_of([recording], config.radar_range), config)
    world = World(config, [playbacks] * EPISODES, Shield.default(tier="auto"))
    world.reset(list(range(EPISODES)), [np.random.default_rng([1, seed]) for seed in range(EPISODES)])
    steps, faults = np.zeros(EPISODES), 0
    running, done = np.ones(EPISODES, dtype=np.bool_), np.zeros(EPISODES, dtype=np.bool_)
    while running.any():
        result = world.step(choose(world))
        steps += running
        faults += sum(contact.at_fault for ego, contact in result.contacts.items() if running[ego])
        faults += int((result.off_road & running).sum())
        done |= running & result.truncated
        running &= ~(result.terminated | result.truncated)
    return np.where(done, steps * recording.dt, np.nan), faults


@pytest.mark.parametrize("name", ["overtake-train", "overtake-test", "overtake-dense-test"])
def test_changing_lanes_saves_time_on_an_overtake_road(name: str) -> None:
    kept, faults = times(name, keep)
    changed, more = times(name, change)
    both = np.isfinite(kept) & np.isfinite(changed)
    assert (faults, more) == (0, 0)
    assert both.sum() >= 0.9 * EPISODES
    assert 1 - changed[both].sum() / kept[both].sum() > 0.01
