"""The contacts of egos with other vehicles."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from drlsl.driving.scene import SceneBatch
from drlsl.driving.simulation.fault import Verdict
from drlsl.traffic import Floats, Mask


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


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """The scenes around egos; of shape (N, S): `recorded` slots, and `dx`, `dy` relative to the ego."""

    scenes: SceneBatch
    recorded: Mask
    dx: Floats
    dy: Floats

    def touching(self, playing: Mask, largest: Floats) -> Iterator[tuple[int, int]]:
        """Yield the contacts of the egos that `playing` marks: ego and slot.

        `largest`: the greatest length and width of other vehicles [m].
        """
        scenes = self.scenes
        length, width = float(scenes.length[0, 0]), float(scenes.width[0, 0])
        near = np.abs(self.dx) < (largest[0] + length) / 2
        near &= np.abs(self.dy) < (largest[1] + width) / 2
        near &= self.recorded
        for place in near.ravel().nonzero()[0].tolist():
            ego, slot = divmod(place, near.shape[1])
            if (
                playing[ego]
                and abs(self.dx[ego, slot]) < (scenes.length[ego, slot] + length) / 2
                and abs(self.dy[ego, slot]) < (scenes.width[ego, slot] + width) / 2
            ):
                yield ego, slot


def worst_contacts(
    touching: Iterator[tuple[int, int]], judged: Callable[[int, int], Contact]
) -> dict[int, Contact]:
    """Return the contact of each ego that touches a vehicle; of several, one at fault first."""
    contacts: dict[int, Contact] = {}
    for ego, slot in touching:
        if ego not in contacts or not contacts[ego].at_fault:
            contact = judged(ego, slot)
            if contact.at_fault or ego not in contacts:
                contacts[ego] = contact
    return contacts
