"""The road: directions and lanes, in SI units. Standard library only, so that commands start quickly."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Direction(Enum):
    """The direction of travel of a lane, seen from above with x to the right and y downward."""

    LEFT_TO_RIGHT = "left_to_right"
    RIGHT_TO_LEFT = "right_to_left"

    @property
    def sign(self) -> int:
        """Sign of vx of the traffic: +1 or -1. The driver's left is -sign on the y axis."""
        return 1 if self is Direction.LEFT_TO_RIGHT else -1


@dataclass(frozen=True, slots=True)
class Lane:
    """One lane of the road, a strip along x.

    `id` counts 1, 2, 3 … from the top (smallest y) over both directions; `centre` [m] is its y, `width` [m]
    its extent in y, `speed_limit` [m/s] its limit.
    """

    id: int
    direction: Direction
    centre: float
    width: float
    speed_limit: float
