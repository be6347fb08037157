"""Highways as a parallel environment of PettingZoo, one agent each, with the mask in its observation."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from pettingzoo import ParallelEnv

from tests.interop.taken import ID, SETTINGS, VECTOR

LIBRARY = "pettingzoo"


class Highways(ParallelEnv):  # type: ignore[misc]  # not typed here
    """One agent on each highway, until its episode ends."""

    metadata = {"name": "highways"}  # noqa: RUF012  (PettingZoo declares it so)

    def __init__(self, count: int) -> None:
        self._count = count
        self.envs: Any = gymnasium.make_vec(
            ID, num_envs=count, mask_format="pettingzoo", autoreset_mode="Disabled", **SETTINGS
        )
        self.possible_agents = [f"ego_{index}" for index in range(count)]
        self.agents: list[str] = []

    def observation_space(self, agent: str) -> Any:
        return self.envs.single_observation_space

    def action_space(self, agent: str) -> Any:
        return self.envs.single_action_space

    def reset(self, seed: int | None = None, options: Any = None) -> Any:
        self.agents = list(self.possible_agents)
        observations, _ = self.envs.reset(seed=seed)
        return self._each(observations), {agent: {} for agent in self.agents}

    def step(self, actions: dict[str, int]) -> Any:
        places = [self.possible_agents.index(agent) for agent in self.agents]
        asked = np.zeros(self._count, dtype=np.int64)
        asked[places] = [actions[agent] for agent in self.agents]
        observations, rewards, terminated, truncated, _ = self.envs.step(asked)
        told = self._each(observations), self._pick(rewards), self._pick(terminated), self._pick(truncated)
        infos: dict[str, Any] = {agent: {} for agent in self.agents}
        over = terminated | truncated
        self.agents = [agent for agent, place in zip(self.agents, places, strict=True) if not over[place]]
        if over.any():
            self.envs.reset(options={"reset_mask": over})
        return *told, infos

    def _each(self, observations: dict[str, Any]) -> dict[str, Any]:
        return {
            agent: {key: column[place] for key, column in observations.items()}
            for place, agent in enumerate(self.possible_agents)
            if agent in self.agents
        }

    def _pick(self, column: Any) -> dict[str, Any]:
        return {agent: column[self.possible_agents.index(agent)].item() for agent in self.agents}


def train(seed: int, steps: int, *, vector: bool) -> None:
    """Learn a linear function of values, as PettingZoo's loops ask each agent for its action."""
    rng = np.random.default_rng(seed)
    env = Highways(VECTOR if vector else 1)
    env.action_space("ego_0").seed(seed)
    weights = np.zeros((21, 3))
    observations, _ = env.reset(seed=seed)
    done = 0
    while done < steps:
        actions = {}
        for agent in env.agents:
            told = observations[agent]
            actions[agent] = int(
                env.action_space(agent).sample(mask=told["action_mask"])
                if rng.random() < 0.5
                else np.where(told["action_mask"], told["observation"] @ weights, -np.inf).argmax()
            )
        following, rewards, terminated, _, _ = env.step(actions)
        for agent, action in actions.items():
            here, there = observations[agent]["observation"], following[agent]
            best = np.where(there["action_mask"], there["observation"] @ weights, -np.inf).max()
            error = rewards[agent] + 0.9 * (not terminated[agent]) * best - here @ weights[:, action]
            weights[:, action] += 1e-4 * error * here
        done += len(actions)
        observations = following
        if not env.agents:
            observations, _ = env.reset()


def check() -> None:
    """Check the environment as PettingZoo does, with actions that it samples by the mask."""
    from pettingzoo.test import parallel_api_test

    parallel_api_test(Highways(VECTOR), num_cycles=100)


def bypass_sample() -> None:
    """Sample without the mask."""
    env = Highways(1)
    env.action_space("ego_0").seed(0)
    env.reset(seed=0)
    for _ in range(200):
        env.step({agent: int(env.action_space(agent).sample()) for agent in env.agents})
        if not env.agents:
            env.reset()


BYPASSES = {"action_space(agent).sample() without mask": bypass_sample}
