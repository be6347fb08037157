"""The bundled overtake roads are worth driving on: who changes lanes gets there sooner, and safely."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from drlsl.driving import EnvConfig
from drlsl.driving.drivers import Driver, Situations, make_driver, most_wanted
from drlsl.driving.shield import Shield
from drlsl.driving.simulation import World, drive_decision, in_direction, playbacks_of
from drlsl.traffic import load_recording

EPISODES = 60

PERIOD = 1.0
"""Time between two decisions [s]."""


def times(name: str, driver: Driver) -> tuple[npt.NDArray[np.float64], int]:
    """Decisions of each episode, NaN where it ended early, and how many were ended by the ego's fault."""
    config = EnvConfig(recording=name)
    recording = load_recording(name)
    playbacks = in_direction(playbacks_of([recording], config.radar_range), config)
    world = World(config, [playbacks] * EPISODES, Shield.default(tier="auto"))
    world.reset(list(range(EPISODES)), [np.random.default_rng([1, seed]) for seed in range(EPISODES)])
    steps, faults = np.zeros(EPISODES), 0
    running, done = np.ones(EPISODES, dtype=np.bool_), np.zeros(EPISODES, dtype=np.bool_)
    while running.any():
        decisions = world.decisions
        seen = Situations(decisions.observation.astype(np.float32), decisions.action_mask, world.seen)
        actions = most_wanted(driver.preferences(seen), decisions.action_mask).actions
        result = drive_decision(world, actions, frames=round(PERIOD / recording.dt))
        steps += running
        faults += sum(contact.at_fault for ego, contact in result.contacts.items() if running[ego])
        faults += int((result.off_road & running).sum())
        done |= running & result.truncated
        running &= ~(result.terminated | result.truncated)
    return np.where(done, steps, np.nan), faults


@pytest.mark.parametrize("name", ["overtake-train", "overtake-test", "overtake-dense-test"])
def test_changing_lanes_saves_time_on_an_overtake_road(name: str) -> None:
    kept, faults = times(name, make_driver("keep"))
    changed, more = times(name, make_driver("mobil"))
    both = np.isfinite(kept) & np.isfinite(changed)
    assert (faults, more) == (0, 0)
    assert both.sum() >= 0.9 * EPISODES
    assert 1 - changed[both].sum() / kept[both].sum() > 0.04
