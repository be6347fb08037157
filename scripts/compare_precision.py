"""Print how far the answers in float32 are from those in float64 on random scenes.

On a processor Torch in float32 gives bit for bit the results of NumPy in float32, so NumPy stands for both.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from drlsl.benchmarks import array_facts, random_scenes
from drlsl.driving.scene import SCHEMA, SceneBatch
from drlsl.driving.shield import ACTIONS, FREE, SPEED, STATE, query_of
from drlsl.logic import Engine
from drlsl.lowering.backends import ArrayProgram, compile_numpy
from drlsl.lowering.frontend import lower

RULES = Path(__file__).parents[1] / "rules"
VEHICLES = 40
AT_ONCE = 2000
SPEED_TOLERANCE = 1e-3  # m/s
OBSERVATION_TOLERANCE = 1e-5


def programs(rules: str) -> tuple[ArrayProgram, ArrayProgram]:
    """Return a rule file compiled in float64 and in float32."""
    engine = Engine()
    engine.consult(RULES / rules)
    lowered = lower(engine, SCHEMA, [query_of(one) for one in (ACTIONS, FREE, SPEED, STATE)])
    return compile_numpy(lowered), compile_numpy(lowered, "float32")


def differences(rules: str, rounds: int) -> str:
    """Return a line about one rule file."""
    exact, near = programs(rules)
    decisions, jumps, speed, observation = 0, 0, 0.0, 0.0
    for seed in range(rounds):
        scenes = SceneBatch.of(random_scenes(AT_ONCE, VEHICLES, seed))
        right, found = exact(array_facts(scenes, exact)), near(array_facts(scenes, near))
        values = [(one.value, other.value) for one, other in zip(right.answers, found.answers, strict=True)]
        (actions, actions_32), (free, free_32), *numbers = values
        differs = (actions != actions_32).any(axis=1) | (free != free_32)
        decisions += int((differs | (right.undecided != found.undecided)).sum())
        speeds, observations = (
            np.abs(one - other).reshape(AT_ONCE, -1).max(axis=1) for one, other in numbers
        )
        close = (speeds <= SPEED_TOLERANCE) & (observations <= OBSERVATION_TOLERANCE)
        jumps += int((~close).sum())
        speed = max(speed, float(speeds[close].max()))
        observation = max(observation, float(observations[close].max()))
    return (
        f"{rules}: of {rounds * AT_ONCE} scenes {decisions} are decided differently, {jumps} have numbers "
        f"beyond the tolerance; in all others within {speed:.1e} m/s and {observation:.1e}"
    )


if __name__ == "__main__":
    for name in ("highway.pl", "paper.pl"):
        print(differences(name, int(sys.argv[1]) if len(sys.argv) > 1 else 100))
