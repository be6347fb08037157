"""The run loop: episodes of acting, storing and learning, as a stream of events."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from time import perf_counter
from typing import Any, NamedTuple

import gymnasium
import numpy as np
import torch

from drlsl.config import Device, TrainConfig
from drlsl.errors import UserError
from drlsl.learning.dqn import DqnAgent
from drlsl.learning.episode import (
    ACTION_FILTERS,
    TRAINING_STREAM,
    EpisodeSummary,
    EpisodeTally,
    Highway,
    episode_seed,
)
from drlsl.learning.replay import Replay
from drlsl.learning.schedule import epsilon_schedule, learning_rate_schedule


class StepEvent(NamedTuple):
    """One step has been taken and learnt from."""

    total_steps: int
    reward: float
    loss: float | None
    """None while the replay memory fills up."""


@dataclass(frozen=True, slots=True)
class EpisodeEvent:
    """One episode is over: a row of the metrics."""

    episode: int
    """Number of the episode, from 1."""
    total_steps: int
    summary: EpisodeSummary
    epsilon: float
    learning_rate: float
    loss: float | None
    """Mean over the episode's updates."""
    wall_s: float


class Trainer:
    """Trains an agent in an environment; each episode is a function of the run's seed and its number."""

    def __init__(self, env: Highway, config: TrainConfig) -> None:
        self._env = env
        self._config = config
        self._offered = ACTION_FILTERS[config.method]
        self._learning_rate = learning_rate_schedule(config)
        self._epsilon = epsilon_schedule(config)
        self.agent, self._replay = make_learner(env, config)
        self.episode = 0
        self.total_steps = 0

    def run(self) -> Iterator[StepEvent | EpisodeEvent]:
        """Train until the configured number of episodes is done.

        Raises:
            DivergedError: a Q-value or a loss is not finite.
            ValueError: the environment gave an observation that is not finite, or offered no action.
        """
        while self.episode < self._config.episodes:
            yield from self._run_episode()

    def _run_episode(self) -> Iterator[StepEvent | EpisodeEvent]:
        """Play one episode, learning at each step.

        Source: Algorithm 1, lines 6 to 17.
        """
        started = perf_counter()
        index, env, agent, replay = self.episode, self._env, self.agent, self._replay
        agent.learning_rate = self._learning_rate(index)
        epsilon = self._epsilon(index)
        losses: list[float] = []
        tally = EpisodeTally()
        observation, info = env.reset(seed=episode_seed(self._config.seed, TRAINING_STREAM, index))
        offered = self._offered(env, info)
        over = False
        while not over:
            action, preferred = agent.act(observation, offered, epsilon)
            intervened = not info["action_mask"][preferred]
            next_observation, reward, terminated, truncated, info = env.step(np.int64(action))
            next_offered = self._offered(env, info)
            replay.add(observation, action, float(reward), next_observation, terminated, next_offered)
            loss = self._learn()
            if loss is not None:
                losses.append(loss)
            tally.add(float(reward), info, offered, intervened)
            observation, offered, over = next_observation, next_offered, terminated or truncated
            self.total_steps += 1
            yield StepEvent(self.total_steps, float(reward), loss)
        self.episode += 1
        yield EpisodeEvent(
            episode=self.episode,
            total_steps=self.total_steps,
            summary=tally.summary(info),
            epsilon=epsilon,
            learning_rate=agent.learning_rate,
            loss=float(np.mean(losses)) if losses else None,
            wall_s=perf_counter() - started,
        )

    def _learn(self) -> float | None:
        learning = self._config.learning
        if len(self._replay) < learning.learning_starts:
            return None
        return self.agent.update(self._replay.sample(learning.batch_size))

    def get_state(self) -> dict[str, Any]:
        """Everything the next episode depends on; only meaningful between two episodes."""
        return {
            "episode": self.episode,
            "total_steps": self.total_steps,
            "agent": self.agent.get_state(),
            "replay": self._replay.get_state(),
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Take over what `get_state` gave."""
        self.agent.set_state(state["agent"])
        self._replay.set_state(state["replay"])
        self.episode = state["episode"]
        self.total_steps = state["total_steps"]


def make_learner(env: Highway, config: TrainConfig) -> tuple[DqnAgent, Replay]:
    """An untrained agent and an empty replay memory, with their own random streams from the run's seed.

    Sets PyTorch's number of threads for the process.

    Raises:
        TypeError: the environment's spaces are not a vector of observed values and discrete actions.
        UserError: the configured device is not there.
    """
    observations, actions = env.observation_space, env.action_space
    if not (isinstance(observations, gymnasium.spaces.Box) and len(observations.shape) == 1):
        raise TypeError(f"expected a vector of observed values, got {observations}")
    if not isinstance(actions, gymnasium.spaces.Discrete):
        raise TypeError(f"expected discrete actions, got {actions}")
    torch.set_num_threads(config.threads)
    size, count = observations.shape[0], int(actions.n)
    weights, exploration, minibatches = np.random.SeedSequence(config.seed).spawn(3)
    agent = DqnAgent(
        size,
        count,
        config.network,
        config.learning,
        rng=np.random.default_rng(exploration),
        generator=torch.Generator().manual_seed(int(weights.generate_state(1)[0])),
        device=resolve_device(config.device),
    )
    replay = Replay(config.learning.replay_capacity, size, count, np.random.default_rng(minibatches))
    return agent, replay


def resolve_device(device: Device) -> torch.device:
    """The device a configuration means.

    Raises:
        UserError: CUDA is asked for and PyTorch has none.
    """
    if device == "auto":
        return torch.device("cuda" if torch.cuda.is_available() else "cpu")
    if device == "cuda" and not torch.cuda.is_available():
        raise UserError("device 'cuda': PyTorch finds no CUDA device here; use --device cpu")
    return torch.device(device)
