"""A small road with standing cars: the environment's contract without recordings and rules."""

from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

LANES = 3
SPEED = 25.0
SIGHT = 60.0


class FakeHighway(gymnasium.Env[NDArray[np.float32], int]):
    """The ego drives 25 m a step past cars that stand still; a change takes one step."""

    observation_space = gymnasium.spaces.Box(0.0, 1.0, (10,), np.float32)
    action_space = gymnasium.spaces.Discrete(3)

    def __init__(self, track_length: float = 840.0) -> None:
        self._length = track_length

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        super().reset(seed=seed)
        self._x = 0.0
        self._lane = int(self.np_random.integers(LANES))
        self._cars = [
            (int(self.np_random.integers(LANES)), float(x)) for x in np.arange(150.0, self._length, 120.0)
        ]
        return self._observation(), self._info({}, changed=False, contact=False, off_road=False)

    def step(self, action: int) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        if not self.action_space.contains(action):
            raise ValueError(f"no action {action}")
        self._lane += (0, -1, 1)[action]
        off_road = not 0 <= self._lane < LANES
        contact = not off_road and self._gap(self._lane) < SPEED
        self._x += SPEED
        late = 1.0 - 0.8 * min(self._x / self._length, 1.0)
        rewards = {
            "lane_change": -5.0 * (action != 0),
            "velocity": 0.01 * SPEED,
            "collision": -100.0 * late * contact,
            "off_road": -100.0 * late * off_road,
        }
        terminated = contact or off_road
        truncated = not terminated and self._x >= self._length
        info = self._info(rewards, changed=action != 0, contact=contact, off_road=off_road)
        return self._observation(), sum(rewards.values()), terminated, truncated, info

    def _gap(self, lane: int) -> float:
        ahead = [x - self._x for car_lane, x in self._cars if car_lane == lane and x >= self._x]
        return min(ahead, default=np.inf)

    def _mask(self) -> NDArray[np.int8]:
        sides = [self._lane - 1, self._lane + 1]
        safe = [0 <= lane < LANES and self._gap(lane) > SIGHT for lane in sides]
        return np.array([True, *safe], np.int8)

    def _observation(self) -> NDArray[np.float32]:
        gaps = [min(self._gap(lane) / 100.0, 1.0) for lane in range(self._lane - 1, self._lane + 2)]
        lane = np.clip(self._lane / (LANES - 1), 0.0, 1.0)
        return np.array([*gaps, 1, 1, 1, 1, 1, lane, 0.7], np.float32)

    def _info(
        self, rewards: dict[str, float], *, changed: bool, contact: bool, off_road: bool
    ) -> dict[str, Any]:
        info = {
            "action_mask": self._mask(),
            "rewards": rewards,
            "lane_change": changed,
            "contact": contact,
            "at_fault": contact and self._lane == 0,
            "off_road": off_road,
            "speed": SPEED,
            "distance": self._x,
            "target_speed": SPEED,
            "fail_safe": False,
        }
        return info | ({"contact_reason": "ran into a standing car"} if contact else {})
