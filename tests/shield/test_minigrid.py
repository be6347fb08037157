"""The rules for MiniGrid: a table of what lies ahead, and walks in which each action is tried on a copy."""

from __future__ import annotations

import copy
import subprocess
import sys
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from drlsl.errors import UserError
from drlsl.shield import ActionRules, Facts
from drlsl.shield.environments import shield_minigrid
from drlsl.shield.environments.minigrid import ACTIONS

EXAMPLE = Path(__file__).parents[2] / "examples" / "shield_minigrid.py"
AROUND = {0: (4, 2), 1: (3, 3), 2: (2, 2), 3: (3, 1)}
"""The cell ahead of an agent at (3, 2), by its direction."""


@pytest.mark.parametrize("tier", ["interpreter", "scalar", "numpy"])
@pytest.mark.parametrize("kind", ["lava", "wall", "goal", "door"])
def test_lava_ahead_is_not_stepped_into(tier: str, kind: str) -> None:
    rules = ActionRules("envs/minigrid.pl", tuple(ACTIONS), fallback="left", tier=tier)
    for direction in AROUND:
        for there, (x, y) in AROUND.items():
            facts: Facts = {("agent", 3): [(3, 2, direction)], ("thing", 3): [(x, y, kind), (0, 0, "lava")]}
            burns = kind == "lava" and there == direction
            assert set(rules.offer(facts).actions) == set(ACTIONS) - ({"forward"} if burns else set())
            assert rules.objections(facts, "forward") == ((f"lava({x},{y})",) if burns else ())


def burns_up(env: gymnasium.Env[Any, Any], action: int) -> bool:
    """Whether an action ends in lava, tried on a copy."""
    tried: Any = copy.deepcopy(env.unwrapped)
    *_, terminated, _, _ = tried.step(action)
    under = tried.grid.get(*tried.agent_pos)
    return terminated and under is not None and under.type == "lava"


@pytest.mark.parametrize("name", ["LavaGapS5", "LavaCrossingS9N2", "DistShift2", "Empty-5x5", "DoorKey-5x5"])
def test_offered_is_what_does_not_end_in_lava(name: str) -> None:
    pytest.importorskip("minigrid", reason="MiniGrid is not installed")
    env = shield_minigrid(gymnasium.make(f"minigrid:MiniGrid-{name}-v0"))
    rng = np.random.default_rng(0)
    for seed in range(4):
        _, info = env.reset(seed=seed)
        for _ in range(60):
            allowed = [not burns_up(env, action) for action in ACTIONS.values()]
            assert info["action_mask"].tolist() == allowed
            *_, terminated, truncated, info = env.step(int(rng.choice(np.flatnonzero(allowed))))
            if terminated or truncated:
                break
    assert env.counts.fail_safes == env.counts.not_offered == 0


def test_the_example_burns_nobody_behind_the_rules() -> None:
    pytest.importorskip("minigrid", reason="MiniGrid is not installed")
    done = subprocess.run([sys.executable, EXAMPLE], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    without, _, held = (int(word) for word in done.stdout.split() if word.isdigit())
    assert without > 5
    assert held == 0


def test_another_environment_is_refused() -> None:
    with pytest.raises(UserError, match=r"has no agent_pos; expected an environment of MiniGrid; "):
        shield_minigrid(gymnasium.make("FrozenLake-v1"))
