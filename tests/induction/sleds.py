"""A sled that must stop before the end of the ice, in kinds that can be copied, replayed, or neither."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from drlsl.induction.environments import LearningDomain

END = 20
"""Beyond it the sled falls."""

BIAS = Path(__file__).with_name("sled_learning.pl")

_ELSEWHERE = itertools.count()


class Sled(gymnasium.Env[Any, Any]):
    """A sled at `x` with a speed of 0 to 3: it brakes, coasts or pushes, and then moves by its speed."""

    action_space = gymnasium.spaces.Discrete(3)
    observation_space = gymnasium.spaces.Box(0, 99, (2,), dtype=np.int64)

    def __init__(self, *, wind: int = 0, copied: bool = True, replayed: bool = True) -> None:
        self.wind, self._copied, self._replayed = wind, copied, replayed

    def __deepcopy__(self, memo: dict[int, Any]) -> Sled:
        if not self._copied:
            raise TypeError("a sled of C++ cannot be copied")
        other = Sled(wind=self.wind, replayed=self._replayed)
        other.x, other.speed, other.steps = self.x, self.speed, self.steps
        other.np_random.bit_generator.state = self.np_random.bit_generator.state
        return other

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, Any]:
        super().reset(seed=seed)
        self.x = int(self.np_random.integers(0, 12)) if self._replayed else next(_ELSEWHERE)
        self.speed, self.steps = int(self.np_random.integers(0, 4)), 0
        return np.array([self.x, self.speed]), {}

    def step(self, action: int) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.speed = min(3, max(0, self.speed + action - 1))
        self.x += self.speed + (int(self.np_random.integers(0, self.wind + 1)) if self.speed else 0)
        self.steps += 1
        fallen = self.x > END
        return np.array([self.x, self.speed]), 0.0, fallen, self.steps >= 15, {}


def margin(x: int, speed: int, action: int, wind: int = 0) -> int:
    """How far from the end the sled stops that takes an action and then brakes, whatever the wind."""
    speeds = range(min(3, max(0, speed + action - 1)), 0, -1)
    return END - x - sum(speeds) - wind * len(speeds)


def facts(sled: Any) -> Any:
    return {("at", 1): [(sled.x,)], ("speed", 1): [(sled.speed,)]}


def broken_facts(sled: Any) -> Any:
    return {("at", 1): [(sled.nowhere,)], ("speed", 1): [(sled.speed,)]}


sled = LearningDomain(
    make=lambda seed: Sled(),
    actions={"brake": 0, "coast": 1, "push": 2},
    facts=facts,
    failed=lambda step: step.env.x > END,
    bias=BIAS,
    fallback="brake",
    horizon=4,
    examples=300,
    episodes=40,
    trials=40,
)
replayed = replace(sled, make=lambda seed: Sled(copied=False))
lost = replace(sled, make=lambda seed: Sled(copied=False, replayed=False))
windy = replace(sled, make=lambda seed: Sled(wind=1), draws=6, horizon=3)
unseen_wind = replace(windy, draws=1)
never_fails = replace(sled, failed=lambda step: False)
always_fails = replace(sled, failed=lambda step: True)
wrong_facts = replace(sled, facts=broken_facts)
wrong_failed = replace(sled, failed=lambda step: step.env.fallen)
unknown_quantity = replace(sled, bias=BIAS.with_name("sled_wrong_learning.pl"))
no_environment = replace(sled, make=lambda seed: None)  # type: ignore[arg-type,return-value]
no_domain = {"make": Sled}
