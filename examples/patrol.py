"""Rules are learnt here: drlsl rules learn --domain examples/patrol.py:patrol --out patrol.pl."""

from typing import Any

import gymnasium
import numpy as np

from drlsl.induction.environments import LearningDomain

MOVES = np.array([(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)])


class Patrol(gymnasium.Env[Any, Any]):
    """Eight by eight cells; after each step of the robot a guard takes one, by chance; they must not meet."""

    action_space = gymnasium.spaces.Discrete(5)
    observation_space = gymnasium.spaces.Box(0, 7, (4,), dtype=np.int64)

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, Any]:
        super().reset(seed=seed)
        self.robot, self.guard, self.steps = np.array([0, 0]), self.np_random.integers(3, 7, size=2), 0
        return np.concatenate([self.robot, self.guard]), {}

    def step(self, action: int) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.robot = np.clip(self.robot + MOVES[action], 0, 7)
        self.guard = np.clip(self.guard + MOVES[self.np_random.integers(5)], 0, 7)
        self.steps, met = self.steps + 1, bool((self.robot == self.guard).all())
        return np.concatenate([self.robot, self.guard]), -float(met), met, self.steps >= 40, {}


patrol = LearningDomain(
    make=lambda seed: Patrol(),
    actions={"wait": 0, "right": 1, "left": 2, "down": 3, "up": 4},
    facts=lambda world: {("robot", 2): [tuple(world.robot)], ("guard", 2): [tuple(world.guard)]},
    failed=lambda step: step.terminated,
    bias="patrol_learning.pl",
    fallback="wait",
    horizon=2,
    draws=16,
)
