"""Deep Q-learning over the offered actions."""

import math
from collections.abc import Iterator, Mapping
from itertools import starmap
from typing import Any, Final, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from drlsl.driving.drivers import Choice, most_wanted
from drlsl.learning.config import Bootstrap, LearningConfig, NetworkConfig, Precision
from drlsl.learning.divergence import DivergedError, check_values
from drlsl.learning.network import Policy, make_networks
from drlsl.learning.precision import faster_precision
from drlsl.learning.replay import Batch, Replay, Sample

FEW: Final = 8
"""Rows below which a product may be another routine's, which rounds differently."""

PIECE: Final[Mapping[Precision, int]] = {"float32": 1, "bfloat16": 4}
"""Minibatches whose targets are computed in one pass through the network."""


def greedy_choice(values: NDArray[np.float32], offered: NDArray[np.bool_]) -> Choice:
    """Return the offered action of highest value, the first of equals. Shapes: (N, A) and (N, A).

    Raises:
        ValueError: no action is offered.
        DivergedError: a value is not finite.
    """
    check_values(values)
    return most_wanted(values, offered)


def td_targets(
    next_values: torch.Tensor, batch: Batch, discount: float, bootstrap: Bootstrap
) -> torch.Tensor:
    """Return targets y = r + discount · max Q̂(s', a'), or y = r where the episode terminated.

    Args:
        next_values: the target network's values of the next states. Shape: (..., B, A).
        bootstrap: whether a' runs over "all" actions or over those "safe" in s'. Truncation is no end.

    Returns:
        Shape: (..., B).

    Source: Algorithm 1, line 14.
    """
    if bootstrap == "safe":
        next_values = next_values.masked_fill(~batch.next_masks, -torch.inf)
    # Not a product with (1 - terminated): a terminal state may offer nothing, and 0 · -inf is NaN.
    future = next_values.amax(dim=-1).masked_fill(batch.terminated, 0.0)
    return torch.add(batch.rewards, future, alpha=discount)


class Sight(NamedTuple):
    """The observations that an agent chooses by, in N environments."""

    observations: NDArray[np.float32]  # Shape: (N, S)
    offered: NDArray[np.bool_]  # Shape: (N, A)
    epsilon: float


class Lesson(NamedTuple):
    """A minibatch to learn from, and its targets."""

    batch: Batch
    targets: torch.Tensor | None  # Shape: (B,); None: they are yet to be computed.


class DqnAgent:
    """A Q-network, its target network and Adam."""

    def __init__(
        self,
        observation_size: int,
        action_count: int,
        network: NetworkConfig,
        learning: LearningConfig,
        *,
        rng: np.random.Generator,
        generator: torch.Generator,
        device: torch.device,
    ) -> None:
        self._learning = learning
        self._rng = rng
        self._generator = generator
        self.network, self.target = make_networks(network, observation_size, action_count, generator, device)
        self._learn_in(
            faster_precision(network, learning.batch_size, device)
            if learning.precision == "auto"
            else learning.precision
        )
        self.policy = Policy(self.network, device, network.window)
        # On a GPU a target that was kept would have to be sent there, at each update.
        self.keeps_targets = self.network.steady and device.type == "cpu"
        """Whether a transition's target is kept until the target network is renewed."""
        self.updates = 0

    def _learn_in(self, precision: Precision) -> None:
        self.precision: Precision = precision
        """The precision of products in learning."""
        for network in (self.network, self.target):
            network.learn_in(precision)
        self.optimiser = self.network.optimiser()

    def renew_optimiser(self) -> None:
        """Give the optimiser the memory that the parameters are in now."""
        state = self.optimiser.get_state()
        self.optimiser = self.network.optimiser()
        self.optimiser.set_state(state)

    @property
    def learning_rate(self) -> float:
        """The learning rate of Adam's next step."""
        return self.optimiser.learning_rate

    @learning_rate.setter
    def learning_rate(self, rate: float) -> None:
        self.optimiser.learning_rate = rate

    def act(self, observations: NDArray[np.float32], offered: NDArray[np.bool_], epsilon: float) -> Choice:
        """Choose ε-greedily among the offered actions. Shapes: (N, S) and (N, A).

        Raises:
            ValueError: no action is offered, or an observation is not finite.
            DivergedError: a Q-value is not finite.
        """
        self.network.draw_noise()
        return self.choose(self.policy.values(observations), offered, epsilon)

    def choose(self, values: NDArray[np.float32], offered: NDArray[np.bool_], epsilon: float) -> Choice:
        """Choose ε-greedily among the offered actions by their Q-values. Shapes: (N, A) and (N, A).

        Raises:
            ValueError: no action is offered.
            DivergedError: a Q-value is not finite.

        Source: Algorithm 1, lines 9 and 10.
        """
        choice = greedy_choice(values, offered)
        rows = np.flatnonzero(self._rng.random(len(offered)) < epsilon)
        free = offered[rows]
        places = self._rng.integers(free.sum(axis=1))
        choice.actions[rows] = (free.cumsum(axis=1) > places[:, np.newaxis]).argmax(axis=1)
        return choice

    def learn(self, replay: Replay, updates: int) -> list[float]:
        """Take steps of Adam, each on a minibatch of its own from the memory; return their losses.

        Raises:
            DivergedError: the loss or its gradient is not finite; the weights are those of the step before.
        """
        return [self.update(*lesson) for lesson in self.lessons(replay, updates)]

    def lessons(self, replay: Replay, updates: int) -> Iterator[Lesson]:
        """Yield minibatches from the memory, each once the update on the one before it is made."""
        sample, every = replay.sample(updates), self._learning.target_every
        begun = 0
        while begun < updates:
            # The updates that are left until the target network is renewed.
            part = slice(begun, begun + every - self.updates % every)
            batches = sample.batches[part]
            begun += len(batches)
            targets = self._targets(replay, sample, part) if self.keeps_targets else [None] * len(batches)
            yield from starmap(Lesson, zip(batches, targets, strict=True))

    @torch.inference_mode()
    def _targets(self, replay: Replay, sample: Sample, part: slice) -> torch.Tensor:
        """Return the targets of some of the minibatches. Shape: (minibatches, B)."""
        known, places = replay.targets, sample.places[part]
        missing = known.missing(places.ravel(), self.updates // self._learning.target_every)
        if len(missing):
            missing = np.resize(missing, max(FEW, len(missing)))
            rows = sample.all.rows(missing + part.start * places.shape[1])
            known.put(places.ravel()[missing], self._computed_targets(rows))
        return known.take(places)

    def _computed_targets(self, rows: Batch) -> torch.Tensor:
        """Return the targets of transitions by the target network of now. Shape: (B,)."""
        # In equal pieces, whose values stay in the processor's cache.
        size = PIECE[self.precision] * self._learning.batch_size
        pieces = rows.next_observations.tensor_split(-(-len(rows.actions) // size))
        next_values = torch.cat([self.target.next_values(piece) for piece in pieces])
        return td_targets(next_values, rows, self._learning.discount, self._learning.bootstrap)

    @torch.inference_mode()
    def update(self, batch: Batch, targets: torch.Tensor | None = None) -> float:
        """Take one step of Adam on a minibatch and return its loss; without targets they are computed.

        Raises:
            DivergedError: the loss or its gradient is not finite; the weights are left as they were.
        """
        self.target.draw_noise()
        self.network.draw_noise()
        if targets is None:
            targets = self._computed_targets(batch)
        loss = self.checked(self.network.find_gradient(batch.observations, batch.actions, targets))
        self.optimiser.step()
        self.count_update()
        return loss

    def checked(self, loss: float) -> float:
        """Return the loss of the next update.

        Raises:
            DivergedError: it is not finite.
        """
        if not math.isfinite(loss):
            raise DivergedError(f"the loss is {loss} at update {self.updates + 1}")
        return loss

    def count_update(self) -> None:
        """Count an update that was made, and renew the target network if it is time."""
        self.updates += 1
        if self.updates % self._learning.target_every == 0:
            self.target.copy_from(self.network)

    def get_state(self) -> dict[str, Any]:
        """Return weights, optimiser, counter, precision and generator, in plain types and tensors."""
        return {
            "network": self.network.get_state(),
            "target": self.target.get_state(),
            "optimiser": self.optimiser.get_state(),
            "updates": self.updates,
            "precision": self.precision,
            "rng": self._rng.bit_generator.state,
            "noise": self._generator.get_state(),
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Take over what `get_state` gave.

        Raises:
            ValueError: the state belongs to another network.
        """
        # What auto was when the training began; there was float32 alone when files did not tell.
        self._learn_in(state.get("precision", "float32"))
        self.network.set_state(state["network"])
        self.target.set_state(state["target"])
        self.optimiser.set_state(state["optimiser"])
        self.updates = state["updates"]
        self._rng.bit_generator.state = state["rng"]
        self._generator.set_state(state["noise"])
