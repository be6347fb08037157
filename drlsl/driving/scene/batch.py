"""Many scenes at once, as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from drlsl.driving.scene.facts import SCHEMA
from drlsl.driving.scene.model import EGO, Road, Scene, Vehicle
from drlsl.driving.scene.rows import copied, put_rows
from drlsl.traffic import NUMBERS, Boxes, Floats, Integers, Mask

EGO_ID: Final = -1
"""`SceneBatch.id` of the ego; other vehicles have ids >= 0."""


@dataclass(frozen=True, slots=True, eq=False)
class SceneBatch(Boxes):
    """N scenes with up to K vehicles each: the ego in column 0, the vehicles in range in the `valid` slots.

    `road` (N,) indexes `roads`; `target_lane` (N,) lane ids; the rest are of shape (N, K + 1): `id`, `lane`
    ids, `x`, `y` [m], `vx`, `vy` [m/s], `length`, `width` [m]. Numbers in slots that are not valid are finite
    but undefined.
    """

    roads: tuple[Road, ...]
    road: Integers
    target_lane: Integers
    id: Integers
    lane: Integers
    valid: Mask

    def __len__(self) -> int:
        return len(self.road)

    @property
    def columns(self) -> tuple[Integers, Floats, Floats, Floats, Floats, Floats, Floats]:
        """The columns of `vehicle/8` behind the name, in order."""
        return (self.lane, self.x, self.y, self.vx, self.vy, self.length, self.width)

    def scene(self, index: int) -> Scene:
        """Return one scene of the batch; vehicle 12 is called v12."""
        rows = np.flatnonzero(self.valid[index]).tolist()
        ids, *numbers = (column[index][rows].tolist() for column in (self.id, *self.columns))
        names = [EGO if vehicle == EGO_ID else f"v{vehicle}" for vehicle in ids]
        ego, *others = map(Vehicle, names, *numbers)
        return Scene(self.roads[int(self.road[index])], ego, tuple(others), int(self.target_lane[index]))

    @classmethod
    def of(cls, scenes: Sequence[Scene]) -> SceneBatch:
        """Make the batch of `scenes`, each with the vehicles in range, numbered in their order.

        Raises:
            TypeError, ValueError: a lane is not an integer of 64 bits, or another value not a number.
        """
        roads: dict[Road, int] = {}
        targets = SCHEMA.relations["target_lane", 1].conform((scene.target_lane,) for scene in scenes)
        road = [roads.setdefault(scene.road, len(roads)) for scene in scenes]
        conform = SCHEMA.relations["vehicle", 8].conform
        rows = [conform((scene.ego, *scene.in_range())) for scene in scenes]
        slots = max(map(len, rows))
        numbers = np.zeros((len(NUMBERS), len(rows), slots))
        lane = np.zeros((len(rows), slots), dtype=np.int64)
        valid = np.zeros((len(rows), slots), dtype=np.bool_)
        for n, vehicles in enumerate(rows):
            numbers[:, n, : len(vehicles)] = np.array([vehicle[2:] for vehicle in vehicles]).T
            try:
                lane[n, : len(vehicles)] = [vehicle[1] for vehicle in vehicles]
            except OverflowError as error:
                raise ValueError(f"a lane of scene {n} is not an integer of 64 bits") from error
            valid[n, : len(vehicles)] = True
        ids = np.broadcast_to(np.arange(EGO_ID, slots + EGO_ID), valid.shape)
        return cls.from_numbers(
            numbers,
            roads=tuple(roads),
            road=np.array(road),
            target_lane=np.array([lane for (lane,) in targets]),
            id=ids,
            lane=lane,
            valid=valid,
        )

    @classmethod
    def from_numbers(
        cls,
        numbers: Floats,
        *,
        roads: tuple[Road, ...],
        road: Integers,
        target_lane: Integers,
        id: Integers,
        lane: Integers,
        valid: Mask,
    ) -> SceneBatch:
        """Make a batch; x, y, vx, vy, length and width are the rows of `numbers`, shape (6, N, K + 1)."""
        x, y, vx, vy, length, width = numbers
        return cls(x, y, vx, vy, length, width, roads, road, target_lane, id, lane, valid)

    def put(self, places: Integers, scenes: SceneBatch) -> None:
        """Write `scenes`, with the same number of slots and the same roads, into `places`."""
        put_rows(self, places, scenes)

    def replaced(self, places: Integers, scenes: SceneBatch) -> SceneBatch:
        """Return a copy with `scenes`, of the same number of slots and the same roads, in `places`."""
        result = copied(self)
        result.put(places, scenes)
        return result
