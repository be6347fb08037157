"""highway-env itself behind the rules; pip install highway-env==1.12.1 runs these tests."""

from __future__ import annotations

import subprocess
import sys
from copy import deepcopy
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from drlsl.errors import UserError
from drlsl.logic import Engine
from drlsl.shield import consult_rules
from drlsl.shield.environments import shield_crossing, shield_straight_road, straight_road_facts
from drlsl.shield.environments.straight_road import RULES
from tests.shield.environments.oracle import World

highway_env = pytest.importorskip("highway_env", reason="highway-env is not installed")

EXAMPLE = Path(__file__).parents[3] / "examples" / "shield_highway_env.py"


@pytest.mark.parametrize("name", ["highway-fast-v0", "merge-v0"])
def test_a_random_policy_does_not_crash(name: str) -> None:
    env = shield_straight_road(gymnasium.make(name), mode="raise")
    rng = np.random.default_rng(0)
    for episode in range(3):
        _, info = env.reset(seed=episode)
        over = False
        while not over:
            offered = World(straight_road_facts(env.unwrapped)).offered()
            assert set(info["shield"]["offered"]) == offered
            *_, terminated, truncated, info = env.step(int(rng.choice(np.flatnonzero(info["action_mask"]))))
            over = terminated or truncated
        assert not env.unwrapped.vehicle.crashed  # type: ignore[attr-defined]  # highway-env's own
    assert env.rules.tier == "scalar"
    assert env.counts.fail_safes == env.counts.interpreted == 0


def test_a_random_policy_goes_round_a_roundabout() -> None:
    env = shield_crossing(gymnasium.make("roundabout-v0"), mode="raise")
    rng = np.random.default_rng(0)
    for episode in range(3):
        _, info = env.reset(seed=episode)
        over = False
        while not over:
            *_, terminated, truncated, info = env.step(int(rng.choice(np.flatnonzero(info["action_mask"]))))
            over = terminated or truncated
        assert not env.unwrapped.vehicle.crashed  # type: ignore[attr-defined]  # highway-env's own
    assert env.rules.tier == "scalar"
    assert env.counts.fail_safes == env.counts.interpreted == 0


@pytest.mark.parametrize("name", ["highway-fast-v0", "merge-v0", "roundabout-v0", "intersection-v0"])
def test_the_example_runs(name: str) -> None:
    """In a process of its own: intersection-v0 changes the drivers of every later environment."""
    done = subprocess.run(
        [sys.executable, EXAMPLE, "--env", name, "--episodes", "2"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.startswith("crashes in 2 episodes: ")
    # one of the four crashes that are left in 200 episodes is the first
    left = 1 if name == "intersection-v0" else 0
    assert done.stdout.endswith(f" {left} with them\n")


def test_the_lag_of_the_rules_is_that_of_highway_env() -> None:
    from highway_env.vehicle.controller import ControlledVehicle

    engine = Engine()
    consult_rules(engine, RULES)
    assert [solution["T"] for solution in engine.query("lag(T)")] == [ControlledVehicle.TAU_ACC]


@pytest.mark.parametrize("name", ["highway-fast-v0", "merge-v0"])
def test_each_action_steers_for_what_the_facts_say(name: str) -> None:
    env, rng = gymnasium.make(name), np.random.default_rng(0)
    for episode in range(6):
        env.reset(seed=episode)
        over = False
        while not over:
            world: Any = env.unwrapped
            world.vehicle.speed = rng.uniform(10.0, 40.0)
            aims = {row[0]: row[1:] for row in straight_road_facts(world)["aim", 3]}
            before = world.vehicle.target_lane_index, world.vehicle.target_speed
            for action in ("idle", "slower", "faster", "lane_left", "lane_right"):
                ego = deepcopy(world.vehicle)
                ego.act(action.upper())
                lane = ego.road.network.get_lane(ego.target_lane_index)
                centre = lane.position(lane.local_coordinates(ego.position)[0], 0.0)[1]
                if action in aims:
                    assert aims[action] == (centre, ego.target_speed)
                elif action == "faster":
                    assert ego.target_speed == max(ego.target_speeds)
                else:
                    assert (ego.target_lane_index, ego.target_speed) == before
            *_, terminated, truncated, _ = env.step(int(rng.integers(5)))
            over = terminated or truncated


def test_an_environment_without_lane_changes_is_refused() -> None:
    env = gymnasium.make(
        "highway-fast-v0", config={"action": {"type": "DiscreteMetaAction", "lateral": False}}
    )
    with pytest.raises(UserError, match=r"no action lane_left; expected .* longitudinal and lateral"):
        shield_straight_road(env)
