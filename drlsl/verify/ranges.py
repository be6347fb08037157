"""The scenes that proofs cover: the roads, and the ranges of every number."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Final, TypeAlias

from drlsl.traffic import Direction

Range: TypeAlias = tuple[Fraction, Fraction]

RANGES: Final[dict[str, Range]] = {
    "ego_speed": (Fraction(0), Fraction(70)),
    "speed": (Fraction(-70), Fraction(70)),
    "lateral_speed": (Fraction(-10), Fraction(10)),
    "length": (Fraction(1), Fraction(30)),
    "width": (Fraction(1, 2), Fraction(3)),
    "lane_width": (Fraction(5, 2), Fraction(5)),
    "median": (Fraction(0), Fraction(30)),
    "road_position": (Fraction(-200), Fraction(200)),
    "speed_limit": (Fraction(5), Fraction(70)),
    "time_step": (Fraction(1, 100), Fraction(1, 5)),
    "radar_range": (Fraction(20), Fraction(300)),
    "position": (Fraction(-1000), Fraction(1000)),
    "end_ahead": (Fraction(-1000), Fraction(1000)),
}
"""The least and greatest value of every quantity, in m, s and m/s.

`ego_speed` and `speed`, that of the others, count in the direction of the ego's lane, `lateral_speed` to its
right; `median` is the strip between the two directions, `road_position` the y of the middle of the ego's
lane, `end_ahead` how far ahead of the ego's centre a lane ends, if it ends. A file of properties may narrow
or widen a range with a fact ``range(Name, Low, High)``.
"""

TYPICAL: Final[dict[str, Fraction]] = {
    "lateral_speed": Fraction(0),
    "length": Fraction(23, 5),
    "width": Fraction(19, 10),
    "lane_width": Fraction(15, 4),
    "median": Fraction(0),
    "road_position": Fraction(0),
    "speed_limit": Fraction(35),
    "time_step": Fraction(1, 25),
    "radar_range": Fraction(100),
    "position": Fraction(0),
    "end_ahead": Fraction(200),
    "aside": Fraction(0),
    "ego_speed": Fraction(30),
    "speed": Fraction(28),
}
"""The usual numbers of a counterexample, unless the property excludes them, so that the others stand out.

`aside` is the ego's place in its lane; the `speed` of the others is in the ego's direction.
"""

NAMES: Final = {
    "ego_speed": "the ego's speed along its lane, m/s",
    "speed": "the others' speed the ego's way, m/s",
    "lateral_speed": "speed to the right, m/s",
    "length": "length of a vehicle, m",
    "width": "width of a vehicle, m",
    "lane_width": "width of a lane, m",
    "median": "strip between the directions, m",
    "road_position": "y of the ego's lane, m",
    "speed_limit": "a lane's speed limit, m/s",
    "time_step": "time step, s",
    "radar_range": "radar range, m",
    "position": "the ego's x, m",
    "end_ahead": "end of a lane ahead of the ego, m",
}
"""Descriptions of the ranges."""


def decimal(value: float) -> Fraction:
    """Return what proofs take a number for: a float is the decimal fraction that it prints as."""
    return Fraction(repr(value)) if isinstance(value, float) else Fraction(value)


@dataclass(frozen=True, slots=True)
class Case:
    """One kind of road, the ego's lane, and its target lane.

    Lanes are numbered 1, 2, … from the top; the upper `leftward` ones run right to left, the other
    `rightward` ones left to right.
    """

    leftward: int
    rightward: int
    ego_lane: int
    target_lane: int

    def __str__(self) -> str:
        return (
            f"{self.leftward} lanes right to left, {self.rightward} left to right, "
            f"the ego in lane {self.ego_lane} steering for {self.target_lane}"
        )

    @property
    def lanes(self) -> int:
        """The number of lanes."""
        return self.leftward + self.rightward

    def direction(self, lane: int) -> Direction:
        """Return the direction of a lane."""
        return Direction.RIGHT_TO_LEFT if lane <= self.leftward else Direction.LEFT_TO_RIGHT


MOST_LANES_EACH_WAY: Final = 3
"""Largest number of lanes in each direction of a two-way road."""

MOST_LANES_ONE_WAY: Final = 6
"""Largest number of lanes of a one-way road."""


def all_cases() -> list[Case]:
    """Return every road with every lane for the ego, and with every target lane from there."""
    both = range(MOST_LANES_EACH_WAY + 1)
    one = range(MOST_LANES_EACH_WAY + 1, MOST_LANES_ONE_WAY + 1)
    roads = [(up, down) for up in both for down in both if up + down]
    roads += [road for lanes in one for road in ((lanes, 0), (0, lanes))]
    roads.sort(key=lambda road: (sum(road), road))
    return [
        case
        for up, down in roads
        for lane in range(1, up + down + 1)
        for target in (lane, lane - 1, lane + 1)
        if 1 <= target <= up + down
        and (case := Case(up, down, lane, target)).direction(lane) is case.direction(target)
    ]
