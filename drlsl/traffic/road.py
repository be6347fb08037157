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
    its extent in y, `speed_limit` [m/s] its limit. `end` [m]: the x where it ends, None if it goes on. The
    lanes of a recording go on.
    """

    id: int
    direction: Direction
    centre: float
    width: float
    speed_limit: float
    end: float | None = None


class Traffic(Enum):
    """Behaviour of recorded vehicles towards an ego, which was not there when they were recorded."""

    RECORDED = "recorded"
    """They drive as recorded, through the ego too."""
    REACTIVE = "reactive"
    """They brake for the ego and follow it."""


@dataclass(frozen=True, slots=True)
class MergingLane:
    """A lane beside the road from which vehicles join it, before the lane ends.

    It is no `Lane` of the recording: its vehicles are in lane 0, and the ego stays out of it unless it enters
    there. `centre` [m] is its y, `width` [m] its extent in y, `begin` and `end` [m] the x where it begins and
    ends, in the order of travel; before it lies the on-ramp.
    """

    direction: Direction
    centre: float
    width: float
    begin: float
    end: float
