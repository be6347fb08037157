"""Domains that are shipped: Gymnasium's FrozenLake on slippery ice, and highway-env's straight highway."""

from __future__ import annotations

from functools import lru_cache, partial
from typing import Any, Final

import gymnasium
from gymnasium.envs.toy_text.frozen_lake import generate_random_map

from drlsl.errors import UserError
from drlsl.induction.environments.learning_domain import LearningDomain
from drlsl.shield.environments import (
    ROAD_SCHEMA,
    frozen_lake_facts,
    shield_frozen_lake,
    shield_straight_road,
    straight_road_facts,
)

_NOTHING: Final = {"type": "AttributesObservation", "attributes": []}
"""An observation of highway-env without anything in it."""


def _random_lake(seed: int) -> gymnasium.Env[Any, Any]:
    """Return a slippery lake of 8 by 8 cells with a map of its own for each seed."""
    return gymnasium.make("FrozenLake-v1", desc=generate_random_map(size=8, seed=seed), is_slippery=True)


def _lake(name: str, seed: int) -> gymnasium.Env[Any, Any]:
    """Return a slippery lake with one of Gymnasium's own maps."""
    return gymnasium.make("FrozenLake-v1", map_name=name, is_slippery=True)


@lru_cache(maxsize=1)
def _highway(name: str) -> gymnasium.Env[Any, Any]:
    """Return an environment of highway-env, once made, since each episode has traffic of its own.

    It observes nothing: facts are read from the environment, and observations take a quarter of its time.

    Raises:
        UserError: highway-env is not installed.
    """
    try:
        return gymnasium.make(
            f"highway_env:{name}", config={"observation": _NOTHING}, disable_env_checker=True
        )
    except ModuleNotFoundError as error:
        raise UserError("highway_env needs a package of its own: pip install highway-env") from error


def _fast_highway(seed: int) -> gymnasium.Env[Any, Any]:
    return _highway("highway-fast-v0")


frozen_lake: Final = LearningDomain(
    make=_random_lake,
    actions={"left": 0, "down": 1, "right": 2, "up": 3},
    facts=frozen_lake_facts,
    failed=lambda step: bool(step.env.desc.flat[step.env.s] == b"H"),
    bias="envs/frozen_lake_learning.pl",
    fallback="left",
    tier="interpreter",
    horizon=3,
    held_out={"other random maps": _random_lake, "4x4": partial(_lake, "4x4"), "8x8": partial(_lake, "8x8")},
    shield=shield_frozen_lake,
    examples=10_000,
    episodes=500,
    trials=100,
)
"""FrozenLake on slippery ice: a fall through a hole, on random maps."""

highway_env: Final = LearningDomain(
    make=_fast_highway,
    actions={"lane_left": 0, "idle": 1, "lane_right": 2, "faster": 3, "slower": 4},
    facts=straight_road_facts,
    failed=lambda step: bool(step.env.vehicle.crashed),
    bias="envs/straight_road_learning.pl",
    fallback="slower",
    horizon=4,
    schema=ROAD_SCHEMA,
    shield=shield_straight_road,
    examples=2000,
    episodes=200,
)
"""highway-fast-v0 of highway-env: a crash."""
