"""The contacts of egos with other vehicles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from drlsl.driving.scene import SceneBatch
from drlsl.driving.simulation.fault import Verdict
from drlsl.traffic import Mask


@dataclass(frozen=True, slots=True)
class Contact:
    """A contact of one ego: the vehicle's id, the verdict, and the difference of their speeds [m/s]."""

    vehicle: int
    verdict: Verdict
    closing_speed: float

    @property
    def at_fault(self) -> bool:
        """True if the ego is at fault."""
        return self.verdict is Verdict.AT_FAULT


class Surroundings(NamedTuple):
    """The scenes around N egos, and which slots hold a vehicle that touches the ego, shape (N, S)."""

    scenes: SceneBatch
    touching: Mask
    any_touches: bool


def worst_contacts(touching: Mask, judged: Callable[[int, int], Contact], of: Mask) -> dict[int, Contact]:
    """Return the contact of each ego that `of` (N,) marks; of several, one at fault first."""
    contacts: dict[int, Contact] = {}
    for ego, slot in np.argwhere(touching & of[:, None]).tolist():
        if ego not in contacts or not contacts[ego].at_fault:
            contact = judged(ego, slot)
            if contact.at_fault or ego not in contacts:
                contacts[ego] = contact
    return contacts
