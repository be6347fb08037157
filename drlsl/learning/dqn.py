"""Deep Q-learning over the actions that are offered."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch.nn import functional

from drlsl.config import Bootstrap, LearningConfig, NetworkConfig
from drlsl.errors import UserError
from drlsl.learning.network import Policy, QNetwork
from drlsl.learning.replay import Batch

_REMEDY = "train again with a lower schedule.learning_rate_start"


class DivergedError(UserError):
    """Learning produced a value that is not finite."""


class Choice(NamedTuple):
    """An action, and the one of highest value had every action been offered."""

    action: int
    preferred: int


def greedy_choice(values: NDArray[np.float32], offered: NDArray[np.bool_]) -> Choice:
    """The offered action of highest value; the first of equals.

    Raises:
        ValueError: no action is offered.
        DivergedError: a value is not finite.
    """
    if not offered.any():
        raise ValueError("no action is offered")
    if not np.isfinite(values).all():
        raise DivergedError(f"the Q-values are {values.tolist()}: {_REMEDY}")
    return Choice(int(np.where(offered, values, -np.inf).argmax()), int(values.argmax()))


def td_targets(
    next_values: torch.Tensor, batch: Batch, discount: float, bootstrap: Bootstrap
) -> torch.Tensor:
    """Targets y = r + discount · max Q̂(s', a'), and y = r where the episode terminated; truncation is no end.

    Args:
        next_values: the target network's values of the next states. Shape: (B, A).
        bootstrap: whether a' runs over "all" actions or over those "safe" in s'.

    Returns:
        Shape: (B,).

    Source: Algorithm 1, line 14.
    """
    if bootstrap == "safe":
        next_values = next_values.masked_fill(~batch.next_masks, -torch.inf)
    # Not a product with (1 - terminated): a terminal state may offer nothing, and 0 · -inf is NaN.
    future = next_values.amax(dim=1).masked_fill(batch.terminated, 0.0)
    return batch.rewards + discount * future


def td_loss(values: torch.Tensor, actions: torch.Tensor, targets: torch.Tensor) -> torch.Tensor:
    """Mean squared error of the values of the actions taken. Shapes: (B, A), (B,), (B,) to ().

    Source: Eq. 1.
    """
    return functional.mse_loss(values.gather(1, actions.unsqueeze(1)).squeeze(1), targets)


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
        self._device = device
        self.network = QNetwork(observation_size, network.hidden, action_count, generator).to(device)
        self._target = QNetwork(observation_size, network.hidden, action_count, generator).to(device)
        self._target.load_state_dict(self.network.state_dict())
        self._target.requires_grad_(False)
        self._optimiser = torch.optim.Adam(self.network.parameters(), fused=True)
        self.policy = Policy(self.network, device)
        self.updates = 0

    @property
    def learning_rate(self) -> float:
        """The rate Adam takes its next step with."""
        return float(self._optimiser.param_groups[0]["lr"])

    @learning_rate.setter
    def learning_rate(self, rate: float) -> None:
        for group in self._optimiser.param_groups:
            group["lr"] = rate

    def act(self, observation: NDArray[np.float32], offered: NDArray[np.bool_], epsilon: float) -> Choice:
        """Choose ε-greedily among the offered actions.

        Raises:
            ValueError: no action is offered, or the observation is not finite.
            DivergedError: a Q-value is not finite.

        Source: Algorithm 1, lines 9 and 10.
        """
        choice = greedy_choice(self.policy.values(observation), offered)
        if self._rng.random() < epsilon:
            return choice._replace(action=int(self._rng.choice(np.flatnonzero(offered))))
        return choice

    def update(self, batch: Batch) -> float:
        """Take one step of Adam on a minibatch and give its loss.

        Raises:
            DivergedError: the loss is not finite; the weights are left as they were.
        """
        batch = Batch(*(field.to(self._device) for field in batch))
        with torch.no_grad():
            next_values = self._target(batch.next_observations)
            targets = td_targets(next_values, batch, self._learning.discount, self._learning.bootstrap)
        loss = td_loss(self.network(batch.observations), batch.actions, targets)
        value = loss.item()
        if not np.isfinite(value):
            raise DivergedError(f"the loss is {value} at update {self.updates + 1}: {_REMEDY}")
        self._optimiser.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]  # torch leaves it untyped
        self._optimiser.step()
        self.updates += 1
        if self.updates % self._learning.target_every == 0:
            self._target.load_state_dict(self.network.state_dict())
        return value

    def get_state(self) -> dict[str, Any]:
        """Weights, optimiser, counter and generator, in plain types and tensors."""
        return {
            "network": self.network.state_dict(),
            "target": self._target.state_dict(),
            "optimiser": self._optimiser.state_dict(),
            "updates": self.updates,
            "rng": self._rng.bit_generator.state,
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Take over what `get_state` gave."""
        self.network.load_state_dict(state["network"])
        self._target.load_state_dict(state["target"])
        self._optimiser.load_state_dict(state["optimiser"])
        self.updates = state["updates"]
        self._rng.bit_generator.state = state["rng"]
