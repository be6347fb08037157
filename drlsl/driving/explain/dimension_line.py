"""The line from the ego to a vehicle that is too close, and how much longer it ought to be."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

from drlsl.driving.explain.reasons import Objection
from drlsl.driving.scene import Vehicle, bumper_gap

_TOLERANCE: Final = 0.01
"""Largest difference at which the rules' gap is identified with a distance [m]."""


@dataclass(frozen=True, slots=True)
class Dimension:
    """The line from the ego to a vehicle that is too close, and how much longer it ought to be; x, y [m].

    It starts at the `ego`, the gap ends at the `other`, and what is needed at the `end`. The gap is that of
    two bumpers along the road or the distance of two centres, whichever the rules' number is.
    """

    measure: Literal["bumpers", "centres"]
    ego: tuple[float, float]
    other: tuple[float, float]
    end: tuple[float, float]


def dimension(ego: Vehicle, other: Vehicle, objection: Objection) -> Dimension | None:
    """Return the dimension line of an objection; None if its gap is no distance in the picture."""
    gap, missing = objection.gap, objection.missing
    if gap is None or missing is None:
        return None
    side = 1.0 if other.x >= ego.x else -1.0
    if math.isclose(gap, bumper_gap(ego, other), abs_tol=_TOLERANCE):
        own, theirs = ego.x + side * ego.length / 2, other.x - side * other.length / 2
        end = theirs + side * missing
        return Dimension("bumpers", (own, ego.y), (theirs, other.y), (end, other.y))
    dx, dy = other.x - ego.x, other.y - ego.y
    distance = math.hypot(dx, dy)
    if distance and math.isclose(gap, distance, abs_tol=_TOLERANCE):
        end_x, end_y = (centre + missing * part / distance for centre, part in ((other.x, dx), (other.y, dy)))
        return Dimension("centres", (ego.x, ego.y), (other.x, other.y), (end_x, end_y))
    return None
