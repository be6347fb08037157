"""The replay memory: a ring of transitions and minibatches drawn from it."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray


class Batch(NamedTuple):
    """A minibatch of B transitions with S observed values and A actions."""

    observations: torch.Tensor  # Shape: (B, S), float32
    actions: torch.Tensor  # Shape: (B,), int64
    rewards: torch.Tensor  # Shape: (B,), float32
    next_observations: torch.Tensor  # Shape: (B, S), float32
    terminated: torch.Tensor  # Shape: (B,), bool
    next_masks: torch.Tensor  # Shape: (B, A), bool: the actions offered in the next state


class Replay:
    """The last `capacity` transitions, in one preallocated array of records.

    One record holds one transition, so drawing a minibatch is a single gather; the tensors of a batch are
    views of the gathered records.

    Source: Algorithm 1, the buffer D.
    """

    def __init__(
        self, capacity: int, observation_size: int, action_count: int, rng: np.random.Generator
    ) -> None:
        self._record = np.dtype(
            [
                ("observations", np.float32, (observation_size,)),
                ("actions", np.int64),
                ("rewards", np.float32),
                ("next_observations", np.float32, (observation_size,)),
                ("terminated", np.bool_),
                ("next_masks", np.bool_, (action_count,)),
            ],
            align=True,
        )
        self._records = np.zeros(capacity, self._record)
        # A view per field: writing through them is three times faster than assigning a whole record.
        self._fields = {name: self._records[name] for name in Batch._fields}
        self._rng = rng
        self._added = 0

    def __len__(self) -> int:
        """Transitions held."""
        return min(self._added, len(self._records))

    def add(
        self,
        observation: NDArray[np.float32],
        action: int,
        reward: float,
        next_observation: NDArray[np.float32],
        terminated: bool,
        next_mask: NDArray[np.bool_],
    ) -> None:
        """Store a transition in place of the oldest; a truncated episode's last one is not `terminated`.

        Raises:
            ValueError: a value is not finite, or no action is offered in a next state that is not terminal.
        """
        if not (np.isfinite(next_observation).all() and np.isfinite(reward)):
            raise ValueError(f"transition with reward {reward} and next observation {next_observation}")
        if not (terminated or next_mask.any()):
            raise ValueError("no action is offered in the next state")
        fields = self._fields
        at = self._added % len(self._records)
        fields["observations"][at] = observation
        fields["actions"][at] = action
        fields["rewards"][at] = reward
        fields["next_observations"][at] = next_observation
        fields["terminated"][at] = terminated
        fields["next_masks"][at] = next_mask
        self._added += 1

    def sample(self, size: int) -> Batch:
        """Draw `size` transitions uniformly, with replacement.

        Raises:
            ValueError: the memory is empty.
        """
        if self._added == 0:
            raise ValueError("the replay memory is empty")
        drawn = self._records.take(self._rng.integers(len(self), size=size))
        return Batch(*(torch.from_numpy(drawn[name]) for name in Batch._fields))

    def get_state(self) -> dict[str, Any]:
        """The transitions held, their count and the generator, in plain types and tensors."""
        held = len(self)
        fields = {name: torch.from_numpy(field[:held]).clone() for name, field in self._fields.items()}
        return {"added": self._added, "rng": self._rng.bit_generator.state, "fields": fields}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Take over what `get_state` gave.

        Raises:
            ValueError: the state belongs to a memory of another capacity or shape.
        """
        held = min(state["added"], len(self._records))
        for name, field in self._fields.items():
            stored, here = state["fields"][name].numpy(), field[:held]
            if stored.shape != here.shape:
                raise ValueError(f"replay field {name} has shape {stored.shape}, expected {here.shape}")
            here[:] = stored
        self._added = state["added"]
        self._rng.bit_generator.state = state["rng"]
