"""An environment for shields to be tried on: a walk on a line, with a cliff at either end."""

from __future__ import annotations

from typing import Any, Final

import gymnasium
import numpy as np

LEFT, STAY, RIGHT = 2, 3, 4
ACTIONS: Final = {"left": LEFT, "stay": STAY, "right": RIGHT}
"""The number 5 is an action of the environment, too, and has no name."""

RULES: Final = """
:- dynamic at/1, cliff/2.
step(left, -1). step(stay, 0). step(right, 1).
offered(Action) :- step(Action, _), \\+ objection(Action, _).
objection(Action, falls(Name)) :- step(Action, By), at(X), Next is X + By, cliff(Name, Next).
"""


class Walk(gymnasium.Env[np.int64, np.int64]):
    """A walk that begins anywhere from 1 to `length` - 1; 0 and `length` are cliffs, which end it."""

    def __init__(self, length: int = 4, most: int = 12) -> None:
        self.observation_space = gymnasium.spaces.Discrete(length + 1)
        self.action_space = gymnasium.spaces.Discrete(4, start=2)
        self.length = length
        self.most = most
        self.at = 0
        self.steps = 0
        self.taken: list[int] = []

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.int64, dict[str, Any]]:
        super().reset(seed=seed)
        self.at = int(self.np_random.integers(1, self.length))
        self.steps = 0
        self.taken = []
        return np.int64(self.at), {"place": self.at}

    def step(self, action: np.int64) -> tuple[np.int64, float, bool, bool, dict[str, Any]]:
        self.taken.append(int(action))
        self.steps += 1
        self.at += {LEFT: -1, RIGHT: 1}.get(int(action), 0)
        fell = self.at in (0, self.length)
        return np.int64(self.at), 1.0, fell, self.steps >= self.most and not fell, {"place": self.at}


def facts(env: Any) -> dict[tuple[str, int], list[tuple[Any, ...]]]:
    """The place, and the cliffs."""
    return {("at", 1): [(env.at,)], ("cliff", 2): [("west", 0), ("east", env.length)]}
