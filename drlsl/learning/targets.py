"""Targets of transitions, kept for as long as the target network stays the same."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray


class KnownTargets:
    """The targets y of the transitions in a replay memory, as far as they were computed.

    The target network is renewed every so many updates; until then a transition that is drawn again has the
    same target again.
    """

    def __init__(self, capacity: int) -> None:
        self._targets = np.zeros(capacity, np.float32)
        self._known = np.zeros(capacity, np.bool_)
        self._renewals = 0

    def forget(self, places: slice | NDArray[np.int64]) -> None:
        """Forget the targets of some places in the memory, which hold other transitions now."""
        self._known[places] = False

    def missing(self, places: NDArray[np.int64], renewals: int) -> NDArray[np.int64]:
        """Return the positions in `places` of transitions whose targets are to be computed. Shape: (N,).

        `renewals`: how often the target network was renewed; what an older one said is forgotten.
        """
        if renewals != self._renewals:
            self._known[:] = False
            self._renewals = renewals
        return np.flatnonzero(~self._known[places])

    def put(self, places: NDArray[np.int64], targets: torch.Tensor) -> None:
        """Keep targets. Shapes: (N,) and (N,)."""
        self._targets[places] = targets.numpy()
        self._known[places] = True

    def take(self, places: NDArray[np.int64]) -> torch.Tensor:
        """Return the targets of places, of any shape."""
        return torch.from_numpy(self._targets[places])

    def get_state(self) -> dict[str, Any]:
        """Return the targets that are known, in plain types and tensors."""
        places = np.flatnonzero(self._known)
        return {
            "renewals": self._renewals,
            "places": torch.from_numpy(places),
            "targets": torch.from_numpy(self._targets[places]),
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Take over what `get_state` gave."""
        places = state["places"].numpy()
        self._known[:] = False
        self._renewals = state["renewals"]
        self.put(places, state["targets"])
