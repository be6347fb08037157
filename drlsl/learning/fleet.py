"""N environments that are stepped together, each in an episode of its own."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple, Protocol

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from drlsl.driving.drivers import Situations
from drlsl.driving.scene import SceneBatch
from drlsl.driving.simulation import World
from drlsl.errors import UserError
from drlsl.learning.checkpoint import as_arrays, as_tensors
from drlsl.learning.episode import TRAINING_STREAM, EpisodeSummary, EpisodeTally, episode_seed
from drlsl.traffic import Integers, Mask

Observations = NDArray[np.float32]
Actions = NDArray[np.int64]


class HasSpaces(Protocol):
    """The spaces of environments: what a policy is made for."""

    @property
    def single_observation_space(self) -> gymnasium.Space[Any]:
        """Space of one environment's observations."""

    @property
    def single_action_space(self) -> gymnasium.Space[Any]:
        """Space of one environment's actions."""

    @property
    def observation_names(self) -> tuple[str, ...]:
        """The names of the numbers of an observation."""


class VectorHighway(Protocol):
    """The interface of environments to train in: Gymnasium's VectorEnv, with a state to resume from."""

    num_envs: int
    metadata: dict[str, Any]
    single_observation_space: gymnasium.Space[Any]
    single_action_space: gymnasium.Space[Any]

    @property
    def observation_names(self) -> tuple[str, ...]:
        """The names of the numbers of an observation."""

    def rule_files(self) -> list[Path]:
        """Return the files of the rules that offer actions."""

    def reset(
        self, *, seed: Sequence[int | None], options: dict[str, Any]
    ) -> tuple[Observations, dict[str, Any]]:
        """Begin an episode in every environment that `options["reset_mask"]` marks."""

    def step(self, actions: Actions) -> tuple[Observations, NDArray[np.float64], Mask, Mask, dict[str, Any]]:
        """Drive a step; the returned arrays are new ones."""

    def get_state(self) -> dict[str, Any]:
        """Return all that the next steps depend on, in arrays and plain types."""

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Take over what `get_state` gave."""

    def action_masks(self) -> Mask:
        """Return the actions that the rules derive to be safe now. Shape: (N, A)."""

    def scenes(self) -> SceneBatch:
        """Return the scenes that the rules see now."""

    def branch(self, egos: Integers) -> World:
        """Return a world in which the egos of some environments drive on (`World.branch`)."""


class Outcome(NamedTuple):
    """The results of a step. Shapes: (N,); only rows of environments in an episode are meaningful."""

    rewards: NDArray[np.float64]
    terminated: Mask
    over: Mask
    info: dict[str, Any]


class Ended(NamedTuple):
    """A finished episode."""

    episode: int
    """Its number, from 1, in the order of beginning."""
    summary: EpisodeSummary
    loss: float | None
    wall_s: float


class _Learnt(NamedTuple):
    """The number of all updates so far, and the sum of their losses."""

    updates: int
    loss: float

    def mean_since(self, before: "_Learnt") -> float | None:
        """Return the mean loss of the updates since; None without one."""
        updates = self.updates - before.updates
        return (self.loss - before.loss) / updates if updates else None


class Fleet:
    """N environments, each in an episode of its own, until a number of episodes is driven.

    An agent may see a window of observations, the latest last; an episode's first one stands for those before
    it. Episodes are numbered as they begin, and each is a function of the run's seed, the `stream` that it
    belongs to, its number and the actions taken. When no episode is left to begin, an environment keeps
    driving, uncounted, until the others are done.
    """

    def __init__(
        self,
        env: VectorHighway,
        *,
        episodes: int,
        seed: int,
        stream: int = TRAINING_STREAM,
        window: int = 1,
        only: Sequence[int] | None = None,
    ) -> None:
        """Begin with no episode; `only`: the numbers of those to drive, in order, instead of `episodes`."""
        if env.metadata.get("autoreset_mode") is not AutoresetMode.DISABLED:
            raise TypeError(f"expected an environment without autoreset, got {env.metadata}")
        size, count = space_sizes(env.single_observation_space, env.single_action_space)
        self._env = env
        self._only = only
        self._episodes = episodes if only is None else len(only)
        self._seed = seed
        self._stream = stream
        self._window = window
        self.observations = np.zeros((env.num_envs, window * size), np.float32)
        """The window of observations of each environment. Shape: (N, window · S)."""
        self.safe = np.zeros((env.num_envs, count), np.bool_)
        """The actions that the rules derive to be safe now. Shape: (N, A)."""
        self._counted = np.zeros(env.num_envs, np.bool_)
        self._over = np.ones(env.num_envs, np.bool_)
        self._numbers = np.zeros(env.num_envs, np.int64)
        self._started = np.zeros(env.num_envs)
        self._tally = EpisodeTally(env.num_envs)
        self._learnt = _Learnt(0, 0.0)
        self._learnt_before = [self._learnt] * env.num_envs
        self._begun = 0
        self.finished = 0

    def begin(self) -> dict[int, int]:
        """Begin the next episode in each environment whose episode is over.

        Returns:
            By environment, the numbers of the episodes that began and count.
        """
        if not self._over.any():
            return {}
        began = {}
        seeds: list[int | None] = [None] * len(self._over)
        for index in np.flatnonzero(self._over).tolist():
            self._counted[index] = self._begun < self._episodes
            number = self._begun + 1
            if self._only is not None and self._counted[index]:
                number = self._only[self._begun]
            seeds[index] = episode_seed(self._seed, self._stream, number - 1)
            self._begun += int(self._counted[index])
            self._numbers[index] = number if self._counted[index] else self._begun
            if self._counted[index]:
                began[index] = number
            self._started[index] = perf_counter()
            self._tally.clear(index)
            self._learnt_before[index] = self._learnt
        observations, info = self._env.reset(seed=seeds, options={"reset_mask": self._over})
        first = np.tile(observations, self._window)
        self.observations = np.where(self._over[:, None], first, self.observations)
        self.safe = np.where(self._over[:, None], info["action_mask"].astype(np.bool_), self.safe)
        self._over = np.zeros_like(self._over)
        return began

    def done(self) -> set[int]:
        """Return the numbers of the episodes that are over."""
        return set(range(1, self._begun + 1)) - set(self._numbers[self._counted].tolist())

    def situations(self, offered: Mask) -> Situations:
        """Return what the agents see, of whose actions those are `offered`. Shape: (N, A)."""
        return Situations(self.observations, offered, self._env.scenes(), self._env.branch)

    def rows(self) -> slice | NDArray[np.int64]:
        """Return the environments that are in an episode."""
        return slice(None) if self._counted.all() else np.flatnonzero(self._counted)

    def step(self, actions: Actions) -> Outcome:
        """Drive every environment one step. Shape: (N,)."""
        shown, rewards, terminated, truncated, info = self._env.step(actions)
        if self._window > 1:
            shown = np.concatenate([self.observations[:, shown.shape[1] :], shown], axis=1)
        self.observations = shown
        self.safe = info["action_mask"].astype(np.bool_)
        self._over = terminated | truncated
        return Outcome(rewards, terminated, self._over, info)

    def count(
        self, outcome: Outcome, offered: Mask, intervened: Mask, losses: Sequence[float]
    ) -> list[Ended]:
        """Add a step, and its updates, to the episodes; return those that ended with it."""
        self._tally.add(outcome.rewards, outcome.info, offered, intervened)
        self._learnt = _Learnt(self._learnt.updates + len(losses), self._learnt.loss + sum(losses))
        if not outcome.over.any():
            return []
        ended = []
        for index in np.flatnonzero(outcome.over & self._counted).tolist():
            ended.append(
                Ended(
                    episode=int(self._numbers[index]),
                    summary=self._tally.summary(index, outcome.info),
                    loss=self._learnt.mean_since(self._learnt_before[index]),
                    wall_s=perf_counter() - float(self._started[index]),
                )
            )
            self._counted[index] = False
        self.finished += len(ended)
        return ended

    def get_state(self) -> dict[str, Any]:
        """Return all that the next steps depend on, in plain types and tensors."""
        state: dict[str, Any] = as_tensors(
            {
                "begun": self._begun,
                "finished": self.finished,
                "observations": self.observations,
                "safe": self.safe,
                "counted": self._counted,
                "over": self._over,
                "numbers": self._numbers,
                "tally": self._tally.sums,
                "learnt": tuple(self._learnt),
                "learnt_before": [tuple(one) for one in self._learnt_before],
                "elapsed_s": perf_counter() - self._started,
                # Before the first episodes begin there is no state to resume from.
                "env": self._env.get_state() if self._begun else None,
            }
        )
        return state

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Take over what `get_state` gave.

        Raises:
            UserError: the rules or the recording are not what they were.
        """
        held = as_arrays(state)
        self._begun, self.finished = held["begun"], held["finished"]
        self.observations, self.safe = held["observations"], held["safe"]
        self._counted, self._over, self._numbers = held["counted"], held["over"], held["numbers"]
        self._tally.restore(held["tally"])
        self._learnt = _Learnt(*held["learnt"])
        self._learnt_before = [_Learnt(*one) for one in held["learnt_before"]]
        self._started = perf_counter() - held["elapsed_s"]
        if held["env"] is None:
            return
        self._env.set_state(held["env"])
        if not np.array_equal(self._env.action_masks()[~self._over], self.safe[~self._over]):
            raise UserError(
                "the rules find other actions safe than they did when the checkpoint was written: "
                "put the rules and the recording back as they were, or use --force"
            )


def space_sizes(observations: gymnasium.Space[Any], actions: gymnasium.Space[Any]) -> tuple[int, int]:
    """Return the number of observed values, and the number of actions.

    Raises:
        TypeError: the spaces are not a vector of observed values and discrete actions.
    """
    if not (isinstance(observations, gymnasium.spaces.Box) and len(observations.shape) == 1):
        raise TypeError(f"expected a vector of observed values, got {observations}")
    if not isinstance(actions, gymnasium.spaces.Discrete):
        raise TypeError(f"expected discrete actions, got {actions}")
    return observations.shape[0], int(actions.n)
