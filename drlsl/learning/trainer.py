"""The run loop: acting, storing and learning, as a stream of events."""

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, NamedTuple

import gymnasium
import numpy as np
import torch

from drlsl.driving.drivers import Choice
from drlsl.errors import UserError
from drlsl.files import digests
from drlsl.learning.config import Device, TrainConfig
from drlsl.learning.dqn import DqnAgent, Sight
from drlsl.learning.episode import ACTION_FILTERS, EpisodeSummary
from drlsl.learning.fleet import Actions, Fleet, Outcome, VectorHighway, space_sizes
from drlsl.learning.replay import Replay
from drlsl.learning.schedule import epsilon_schedule, learning_rate_schedule
from drlsl.traffic import Mask


@dataclass(frozen=True, slots=True)
class EpisodeEvent:
    """A finished episode: a row of the metrics."""

    episode: int
    """Number of the episode, from 1, in the order of their beginnings."""
    finished: int
    """Number of finished episodes, this one included."""
    total_steps: int
    summary: EpisodeSummary
    epsilon: float
    learning_rate: float
    loss: float | None
    """Mean over the updates made while it lasted; None while the replay memory fills up."""
    wall_s: float


class StepEvent(NamedTuple):
    """A step of every environment, with the updates that followed."""

    total_steps: int
    losses: Sequence[float]
    """One for each update; none while the replay memory fills up."""
    ended: Sequence[EpisodeEvent]


class Turn(NamedTuple):
    """A step of every environment that is stored, and is to be learnt from."""

    sight: Sight
    outcome: Outcome
    intervened: Mask
    driven: int
    """The number of environments that are in an episode."""
    losses: Sequence[float]
    """Those of the updates that were made beside it."""


class Trainer:
    """Trains an agent in N environments: one update for every step of every environment.

    With one environment this is the paper's loop. With N, the N transitions of a step are followed by N
    updates, and acting is one pass through the network. With `learning.overlap` these updates are made while
    the environments drive the next step; those of the last step are left out.
    """

    def __init__(self, env: VectorHighway, config: TrainConfig) -> None:
        self._config = config
        self._offered = ACTION_FILTERS[config.method]
        self._learning_rate = learning_rate_schedule(config)
        self._epsilon = epsilon_schedule(config)
        self._fleet = Fleet(env, episodes=config.episodes, seed=config.seed, window=config.network.window)
        self.agent, self.replay = make_learner(env.single_observation_space, env.single_action_space, config)
        self.observes = env.observation_names
        """The names of the numbers that the agent observes."""
        self.rule_digests = digests(env.rule_files())
        """The SHA-256 of each rule file."""
        self.total_steps = 0
        self._beside = _thread_of_its_own(config.threads) if config.learning.overlap else None
        self._due = 0
        """Updates that are to be made while the environments drive the next step."""

    @property
    def finished(self) -> int:
        """The number of finished episodes."""
        return self._fleet.finished

    def done(self) -> set[int]:
        """Return the numbers of the finished episodes."""
        return self._fleet.done()

    def run(self) -> Iterator[StepEvent]:
        """Train until the configured number of episodes is done; between two events the state is whole.

        Raises:
            DivergedError: a Q-value, a loss or a gradient is not finite.
            UserError: the user's own module raises an error.
            ValueError: the environment gave an observation that is not finite, or offered no action.
        """
        while self.finished < self._config.episodes:
            yield self._step()

    def _step(self) -> StepEvent:
        """Drive one step in every environment, and learn from it.

        Source: Algorithm 1, lines 6 to 17.
        """
        sight = self.look()
        turn = self.drive(sight, self.agent.act(*sight))
        if self._beside is None:
            return self.close(turn, self._learn(turn.driven))
        self._due = turn.driven
        return self.close(turn, turn.losses)

    def look(self) -> Sight:
        """Set the rates of now, begin the next episodes, and return what the agent chooses by."""
        self.agent.learning_rate = self._learning_rate(self.finished)
        self._fleet.begin()
        return Sight(self._fleet.observations, self._offered(self._fleet.safe), self._epsilon(self.finished))

    def drive(self, sight: Sight, choice: Choice) -> Turn:
        """Drive a step in every environment, and store it."""
        fleet, rows = self._fleet, self._fleet.rows()
        intervened = ~np.take_along_axis(fleet.safe, choice.preferred[:, None], axis=1)[:, 0]
        outcome, losses = self._drive(choice.actions)
        self.replay.add(
            sight.observations[rows],
            choice.actions[rows],
            outcome.rewards[rows],
            fleet.observations[rows],
            outcome.terminated[rows],
            self._offered(fleet.safe[rows]),
        )
        driven = len(choice.actions[rows])
        self.total_steps += driven
        return Turn(sight, outcome, intervened, driven, losses)

    def updates_due(self, driven: int) -> int:
        """Return the number of updates that follow so many steps."""
        return driven if len(self.replay) >= self._config.learning.learning_starts else 0

    def close(self, turn: Turn, losses: Sequence[float]) -> StepEvent:
        """Count a step and the updates that followed."""
        over = self._fleet.count(turn.outcome, turn.sight.offered, turn.intervened, losses)
        ended = [
            EpisodeEvent(
                episode=one.episode,
                finished=self.finished - len(over) + place,
                total_steps=self.total_steps,
                summary=one.summary,
                epsilon=turn.sight.epsilon,
                learning_rate=self.agent.learning_rate,
                loss=one.loss,
                wall_s=one.wall_s,
            )
            for place, one in enumerate(over, start=1)
        ]
        return StepEvent(self.total_steps, losses, ended)

    def _drive(self, actions: Actions) -> tuple[Outcome, Sequence[float]]:
        """Drive a step, and make the updates that are due beside it; return their losses, too."""
        if self._beside is None:
            return self._fleet.step(actions), ()
        learning = self._beside.submit(self._learn, self._due)
        try:
            outcome = self._fleet.step(actions)
        finally:
            losses = learning.result()
        return outcome, losses

    def _learn(self, driven: int) -> list[float]:
        updates = self.updates_due(driven)
        return self.agent.learn(self.replay, updates) if updates else []

    def get_state(self) -> dict[str, Any]:
        """Return all that the next step depends on."""
        return {
            "total_steps": self.total_steps,
            "due": self._due,
            "fleet": self._fleet.get_state(),
            "agent": self.agent.get_state(),
            "replay": self.replay.get_state(),
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Take over what `get_state` gave.

        Raises:
            UserError: the rules or the recording have changed.
            ValueError: the state belongs to another network.
        """
        self.total_steps, self._due = state["total_steps"], state.get("due", 0)
        self._fleet.set_state(state["fleet"])
        self.agent.set_state(state["agent"])
        self.replay.set_state(state["replay"])


def _thread_of_its_own(threads: int) -> ThreadPoolExecutor:
    """Return a thread in which PyTorch uses as many threads as it does here."""
    return ThreadPoolExecutor(1, "learner", torch.set_num_threads, (threads,))


def make_learner(
    observations: gymnasium.Space[Any], actions: gymnasium.Space[Any], config: TrainConfig
) -> tuple[DqnAgent, Replay]:
    """Return an untrained agent and an empty replay memory, with random streams from the run's seed.

    Sets PyTorch's number of threads for the process.

    Raises:
        TypeError: the spaces are not a vector of observed values and discrete actions.
        UserError: the configured device is not there, or the configured network cannot be made.
    """
    size, count = space_sizes(observations, actions)
    torch.set_num_threads(config.threads)
    device = resolve_device(config.device)
    weights, exploration, minibatches = np.random.SeedSequence(config.seed).spawn(3)
    agent = DqnAgent(
        size,
        count,
        config.network,
        config.learning,
        rng=np.random.default_rng(exploration),
        generator=torch.Generator().manual_seed(int(weights.generate_state(1)[0])),
        device=device,
    )
    replay = Replay(
        config.learning.replay_capacity,
        config.network.window * size,
        count,
        np.random.default_rng(minibatches),
        batch_size=config.learning.batch_size,
        batches=config.num_envs,
        device=device,
    )
    return agent, replay


def resolve_device(device: Device) -> torch.device:
    """Return the device that a configuration means.

    Raises:
        UserError: CUDA is asked for and PyTorch has none.
    """
    if device == "auto":
        return torch.device("cuda" if torch.cuda.is_available() else "cpu")
    if device == "cuda" and not torch.cuda.is_available():
        raise UserError("device 'cuda': PyTorch finds no CUDA device here; use --device cpu")
    return torch.device(device)
