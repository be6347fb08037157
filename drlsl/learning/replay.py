"""The replay memory: a ring of transitions, and minibatches drawn from it."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from drlsl.learning.targets import KnownTargets


class Batch(NamedTuple):
    """A minibatch of B transitions with S observed values and A actions."""

    observations: torch.Tensor  # Shape: (B, S), float32
    actions: torch.Tensor  # Shape: (B,), int64
    rewards: torch.Tensor  # Shape: (B,), float32
    next_observations: torch.Tensor  # Shape: (B, S), float32
    terminated: torch.Tensor  # Shape: (B,), bool
    next_masks: torch.Tensor  # Shape: (B, A), bool: the actions offered in the next state

    def rows(self, positions: NDArray[np.int64]) -> "Batch":
        """Return a copy of some of the transitions."""
        index = torch.from_numpy(positions)
        return Batch(*(field[index] for field in self))


class Sample(NamedTuple):
    """Minibatches that were drawn at once; they are valid until the next draw."""

    batches: Sequence[Batch]
    all: Batch  # The transitions of all minibatches, one after another.
    places: NDArray[np.int64]  # Shape: (minibatches, B): where the memory holds them


class Replay:
    """The last `capacity` transitions, in one preallocated array of records.

    One record holds one transition, so drawing minibatches is a single gather into memory that is reused, and
    on a GPU a single transfer; the tensors of a batch are views of that memory.

    Source: Algorithm 1, the buffer D.
    """

    def __init__(
        self,
        capacity: int,
        observation_size: int,
        action_count: int,
        rng: np.random.Generator,
        *,
        batch_size: int,
        batches: int,
        device: torch.device,
    ) -> None:
        """Make a memory from which up to `batches` minibatches of `batch_size` are drawn at once."""
        record = np.dtype(
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
        self._records = np.zeros(capacity, record)
        # A view per field: writing through them is three times faster than assigning a whole record.
        self._fields = {name: self._records[name] for name in Batch._fields}
        self._rng = rng
        self._added = 0
        # PyTorch's memory, for its alignment: a matrix product may round differently with another alignment.
        shape = (batches, batch_size, record.itemsize)
        self._drawn = torch.zeros(shape, dtype=torch.uint8, pin_memory=device.type == "cuda")
        self._drawn_records = self._drawn.numpy().view(record)[..., 0]
        self._given = self._drawn if device.type == "cpu" else torch.zeros_like(self._drawn, device=device)
        self._batches = [_batch_of(given, record) for given in self._given]
        self._all = _batch_of(self._given.flatten(0, 1), record)
        self.targets = KnownTargets(capacity)
        """What an agent has computed of the transitions; forgotten together with them."""

    def __len__(self) -> int:
        """Return the number of transitions held."""
        return min(self._added, len(self._records))

    def add(
        self,
        observations: NDArray[np.float32],
        actions: NDArray[np.int64],
        rewards: NDArray[np.floating],
        next_observations: NDArray[np.float32],
        terminated: NDArray[np.bool_],
        next_masks: NDArray[np.bool_],
    ) -> None:
        """Store N transitions in place of the oldest; the last of a truncated episode is not `terminated`.

        Shapes as in `Batch`.

        Raises:
            ValueError: a value is not finite, or no action is offered in a next state that is not terminal.
        """
        if not (np.isfinite(next_observations).all() and np.isfinite(rewards).all()):
            raise ValueError(f"transitions with rewards {rewards} and next observations {next_observations}")
        if not (terminated | next_masks.any(axis=1)).all():
            raise ValueError("no action is offered in a next state")
        fields, capacity = self._fields, len(self._records)
        start = self._added % capacity
        stop = start + len(rewards)
        at = slice(start, stop) if stop <= capacity else np.arange(start, stop) % capacity
        fields["observations"][at] = observations
        fields["actions"][at] = actions
        fields["rewards"][at] = rewards
        fields["next_observations"][at] = next_observations
        fields["terminated"][at] = terminated
        fields["next_masks"][at] = next_masks
        self.targets.forget(at)
        self._added += len(rewards)

    def sample(self, count: int) -> Sample:
        """Draw `count` minibatches uniformly, with replacement.

        Raises:
            ValueError: the memory is empty, or was not made for so many minibatches.
        """
        if self._added == 0:
            raise ValueError("the replay memory is empty")
        if count > len(self._batches):
            raise ValueError(f"{count} minibatches from a memory made for {len(self._batches)}")
        drawn = self._drawn_records[:count]
        # The indices are in range; mode "raise" would gather into a temporary array first.
        places = self._rng.integers(len(self), size=drawn.shape)
        self._records.take(places, out=drawn, mode="clip")
        if self._given is not self._drawn:
            self._given[:count].copy_(self._drawn[:count])
        return Sample(self._batches[:count], self._all, places)

    def get_state(self) -> dict[str, Any]:
        """Return transitions, their count, known targets and the generator, in plain types and tensors."""
        held = len(self)
        fields = {name: torch.from_numpy(field[:held]).clone() for name, field in self._fields.items()}
        return {
            "added": self._added,
            "rng": self._rng.bit_generator.state,
            "fields": fields,
            "targets": self.targets.get_state(),
        }

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
        # Checkpoints from before targets were kept have none: they are computed again.
        if "targets" in state:
            self.targets.set_state(state["targets"])


_TORCH_TYPES = {"float32": torch.float32, "int64": torch.int64, "bool": torch.bool}


def _batch_of(given: torch.Tensor, record: np.dtype[Any]) -> Batch:
    """Return the fields of B records as views of their bytes. Shape: (B, bytes)."""
    views = []
    for name in Batch._fields:
        field, offset = record.fields[name][:2]  # type: ignore[index]  # a record's dtype has fields
        view = given[:, offset : offset + field.itemsize].view(_TORCH_TYPES[field.base.name])
        views.append(view if field.shape else view.squeeze(1))
    return Batch(*views)
