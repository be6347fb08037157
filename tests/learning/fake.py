"""A small road with standing cars: the environment's contract without recordings and rules."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from numpy.typing import NDArray

from drlsl.driving.scene import EGO, Scene, SceneBatch, Vehicle
from drlsl.driving.shield import PAPER_OBSERVATION
from drlsl.driving.simulation import World
from tests.scenes import road

LANES = 3
SPEED = 25.0
SIGHT = 60.0
EMPTY = Scene(road(0, LANES), Vehicle(EGO, 2, 0.0, 7.25, SPEED, 0.0, 4.6, 1.9), (), 2)


class FakeHighway(gymnasium.Env[NDArray[np.float32], int]):
    """The ego drives 25 m a step past cars that stand still; a change takes one step."""

    observation_space = gymnasium.spaces.Box(0.0, 1.0, (10,), np.float32)
    action_space: gymnasium.spaces.Space[Any] = gymnasium.spaces.Discrete(3)

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
        offered = bool(self._mask()[action])
        self._lane += (0, -1, 1)[action]
        off_road = not 0 <= self._lane < LANES
        contact = not off_road and self._gap(self._lane) < SPEED
        self._x += SPEED
        late = 1.0 - 0.8 * min(self._x / self._length, 1.0)
        rewards = {
            "lane_change": -5.0 * int(action != 0),
            "velocity": 0.01 * SPEED,
            "collision": -100.0 * late * contact,
            "off_road": -100.0 * late * off_road,
        }
        terminated = contact or off_road
        truncated = not terminated and self._x >= self._length
        info = self._info(rewards, changed=action != 0, contact=contact, off_road=off_road, offered=offered)
        return self._observation(), sum(rewards.values()), terminated, truncated, info

    def action_masks(self) -> NDArray[np.bool_]:
        return self._mask().astype(np.bool_)

    def get_state(self) -> dict[str, Any]:
        return {
            "x": self._x,
            "lane": self._lane,
            "cars": self._cars,
            "rng": self.np_random.bit_generator.state,
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        self._x, self._lane, self._cars = state["x"], state["lane"], state["cars"]
        self.np_random.bit_generator.state = state["rng"]

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
        self,
        rewards: dict[str, float],
        *,
        changed: bool,
        contact: bool,
        off_road: bool,
        offered: bool = True,
    ) -> dict[str, Any]:
        info = {
            "action_mask": self._mask(),
            "rewards": rewards,
            "lane_change": bool(changed),
            "contact": bool(contact),
            "at_fault": bool(contact and self._lane == 0),
            "off_road": off_road,
            "speed": SPEED,
            "distance": self._x,
            "target_speed": SPEED,
            "fail_safe": False,
            "offered": offered,
        }
        return info | ({"contact_reason": "ran into a standing car"} if contact else {})


class FakeVector(SyncVectorEnv):
    """Environments driven in step by Gymnasium's own class, with a state to go on from."""

    def __init__(self, *envs: gymnasium.Env[Any, Any]) -> None:
        makers: list[Callable[[], gymnasium.Env[Any, Any]]] = [lambda env=env: env for env in envs]  # type: ignore[misc]
        super().__init__(makers, autoreset_mode=AutoresetMode.DISABLED)

    def reset(self, *, seed: Any = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        return super().reset(seed=seed, options=options)

    def get_state(self) -> dict[str, Any]:
        states = [env.get_state() for env in self._inner()]
        return {"envs": states, "over": self._autoreset_envs.copy(), "seen": self._observations.copy()}

    def set_state(self, state: Mapping[str, Any]) -> None:
        for env, one in zip(self._inner(), state["envs"], strict=True):
            env.set_state(one)
        self._autoreset_envs = state["over"].copy()
        self._env_obs = list(state["seen"])

    def rule_files(self) -> list[Path]:
        return []

    @property
    def observation_names(self) -> tuple[str, ...]:
        return PAPER_OBSERVATION.names

    def action_masks(self) -> NDArray[np.bool_]:
        return np.array([env.action_masks() for env in self._inner()])

    def scenes(self) -> SceneBatch:
        """A road without vehicles: the drivers of these tests do not look at it."""
        return SceneBatch.of([EMPTY] * self.num_envs)

    def branch(self, egos: NDArray[np.int64]) -> World:
        raise NotImplementedError("this road has no World")

    def _inner(self) -> list[Any]:
        return [env.unwrapped for env in self.envs]


def fakes(count: int, track_length: float = 840.0) -> FakeVector:
    return FakeVector(*(FakeHighway(track_length) for _ in range(count)))
