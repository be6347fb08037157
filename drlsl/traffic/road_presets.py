"""Kinds of road and traffic that can be simulated, and the checks of what is asked for."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

from drlsl.errors import UserError
from drlsl.traffic.road import Direction, MergingLane, Traffic

UPPER_EDGE: Final = 8.0
"""y of the topmost marking [m]; about where it lies in highD."""

MEDIAN: Final = 4.0
"""Distance between the inner markings of the two directions [m]."""

STRETCH: Final = 420.0
"""Length of the recorded stretch of road [m] if none is given, as in highD."""

STRETCHES: Final = (100.0, 5000.0)
"""Shortest and longest stretch of road that can be recorded [m]."""

LIMITS: Final = (5.0, 50.0)
"""Lowest and highest speed limit of a lane [m/s]; drivers wish for at most 46 m/s."""

LARGEST_FLOW: Final = 2500.0
"""Most vehicles that a lane takes in an hour."""

RAMP: Final = 100.0
"""Length of an on-ramp that is recorded before its lane begins [m]."""

SHORTEST_MERGE: Final = 50.0
"""Length of the shortest merging lane [m]."""


@dataclass(frozen=True, slots=True)
class Merge:
    """An on-ramp on the right, in each direction of the road.

    Its lane begins `at` [m] into the stretch, along the direction of travel, and ends `length` [m] later;
    `flow` [vehicles/h] is its demand.
    """

    at: float
    length: float
    flow: float

    @property
    def end(self) -> float:
        """The end of the lane, from the beginning of the stretch [m]."""
        return self.at + self.length


@dataclass(frozen=True, slots=True)
class Preset:
    """A kind of road and traffic.

    `flow` [vehicles/h] is the demand of one direction; `run_up` [m] and `run_out` [m] are simulated before
    and behind the recorded `stretch` [m], for `warm_up` [s] before the recording starts. `bottleneck` [m/s],
    if given, is the speed limit behind the stretch, which congests the traffic in it. `eagerness` is SUMO's
    weight of a gain in speed in changing lanes, 1 by default. `speed_limit` [m/s] is the one that the
    recording states, None for no limit; the drivers do as they wish. `lane_limits` [m/s], from the right lane
    to the left, are stated and kept by all drivers; none: `speed_limit`. `merges` are ordered along the
    road. `traffic` is what the recording says that its vehicles do about an ego. `accelerations`: whether
    they are written, besides the velocities whose differences they are.
    """

    directions: tuple[Direction, ...]
    lanes: int
    lane_width: float
    speed_limit: float | None
    frame_rate: float
    flow: float
    truck_share: float
    run_up: float
    run_out: float
    warm_up: float
    minutes: float
    seed: int
    eagerness: float
    bottleneck: float | None = None
    stretch: float = STRETCH
    lane_limits: tuple[float, ...] = ()
    merges: tuple[Merge, ...] = ()
    traffic: Traffic = Traffic.RECORDED
    accelerations: bool = True

    def __post_init__(self) -> None:
        """Check what can be asked for; one line says what is out of range.

        Raises:
            UserError: a value is out of range, or the values do not fit together.
        """
        _check_numbers(self)
        _check_merges(self)

    @property
    def upper_markings(self) -> tuple[float, ...]:
        """y of the markings of the lanes from right to left [m], top first; empty where there are none."""
        if Direction.RIGHT_TO_LEFT not in self.directions:
            return ()
        return tuple(UPPER_EDGE + self.lane_width * number for number in range(self.lanes + 1))

    @property
    def lower_markings(self) -> tuple[float, ...]:
        """y of the markings of the lanes from left to right [m], top first; empty where there are none."""
        if Direction.LEFT_TO_RIGHT not in self.directions:
            return ()
        top = self.upper_markings[-1] + MEDIAN if self.upper_markings else UPPER_EDGE
        return tuple(top + self.lane_width * number for number in range(self.lanes + 1))

    @property
    def limits_from_the_top(self) -> tuple[float, ...]:
        """The lanes' limits [m/s] in the order of the markings, over both directions; empty without any."""
        limits: tuple[float, ...] = ()
        if self.upper_markings:
            limits += self.lane_limits
        if self.lower_markings:
            limits += self.lane_limits[::-1]
        return limits

    @property
    def merging_lanes(self) -> tuple[MergingLane, ...]:
        """The merging lanes in the picture's coordinates: beyond the right edge of each direction."""
        lanes = []
        for merge in self.merges:
            if self.upper_markings:
                centre = self.upper_markings[0] - self.lane_width / 2
                begin, end = self.stretch - merge.at, self.stretch - merge.end
                lanes.append(MergingLane(Direction.RIGHT_TO_LEFT, centre, self.lane_width, begin, end))
            if self.lower_markings:
                centre = self.lower_markings[-1] + self.lane_width / 2
                lanes.append(
                    MergingLane(Direction.LEFT_TO_RIGHT, centre, self.lane_width, merge.at, merge.end)
                )
        return tuple(lanes)


def _check_numbers(preset: Preset) -> None:
    shortest, longest = STRETCHES
    if not shortest <= preset.stretch <= longest:
        raise UserError(f"a stretch has {shortest:g} to {longest:g} m, not {preset.stretch:g}")
    most = LARGEST_FLOW * preset.lanes
    if not 0 < preset.flow <= most:
        raise UserError(
            f"the flow on {preset.lanes} lanes is more than 0 and at most {most:g} vehicles/h, not "
            f"{preset.flow:g}"
        )
    if not 0 <= preset.truck_share <= 1:
        raise UserError(f"the share of trucks is 0 to 1, not {preset.truck_share:g}")
    if len(preset.lane_limits) not in (0, preset.lanes):
        raise UserError(
            f"{len(preset.lane_limits)} lane limits for {preset.lanes} lanes; give one for all, or "
            f"{preset.lanes} from the right lane to the left"
        )
    lowest, highest = LIMITS
    for limit in preset.lane_limits:
        if not lowest <= limit <= highest:
            raise UserError(f"a lane limit is {lowest:g} to {highest:g} m/s, not {limit:g}")


def _check_merges(preset: Preset) -> None:
    for merge in preset.merges:
        if not (math.isfinite(merge.at) and merge.at >= 0 and merge.end <= preset.stretch):
            raise UserError(
                f"a merging lane from {merge.at:g} to {merge.end:g} m does not lie in the stretch of "
                f"{preset.stretch:g} m"
            )
        if not merge.length >= SHORTEST_MERGE:
            raise UserError(f"a merging lane has {SHORTEST_MERGE:g} m or more, not {merge.length:g}")
        if not 0 < merge.flow <= LARGEST_FLOW:
            raise UserError(
                f"the flow of an on-ramp is more than 0 and at most {LARGEST_FLOW:g} vehicles/h, not "
                f"{merge.flow:g}"
            )
    for one, other in pairwise(preset.merges):
        if other.at < one.end + RAMP:
            raise UserError(
                f"the merging lane at {other.at:g} m begins less than {RAMP:g} m behind the end of the one "
                f"before, at {one.end:g} m"
            )


_HIGHWAY = Preset(
    directions=(Direction.LEFT_TO_RIGHT, Direction.RIGHT_TO_LEFT),
    lanes=3,
    lane_width=3.75,
    speed_limit=None,
    frame_rate=25.0,
    flow=5100.0,
    truck_share=0.11,
    run_up=700.0,
    run_out=500.0,
    warm_up=90.0,
    minutes=5.0,
    seed=1,
    eagerness=5.0,
)

_OVERTAKE = replace(
    _HIGHWAY,
    directions=(Direction.LEFT_TO_RIGHT,),
    frame_rate=10.0,
    flow=2400.0,
    truck_share=0.25,
    stretch=1400.0,
    seed=11,
    traffic=Traffic.REACTIVE,
    accelerations=False,
)

_MERGE = replace(
    _OVERTAKE,
    lanes=2,
    flow=2000.0,
    truck_share=0.1,
    stretch=700.0,
    lane_limits=(100 / 3.6, 120 / 3.6),
    merges=(Merge(at=200.0, length=250.0, flow=400.0),),
    seed=21,
)

PRESETS: Mapping[str, Preset] = {
    "highway-train": _HIGHWAY,
    "highway-test": replace(_HIGHWAY, minutes=2.0, seed=2),
    "freeway": Preset(
        directions=(Direction.LEFT_TO_RIGHT,),
        lanes=5,
        lane_width=3.66,
        speed_limit=29.06,
        frame_rate=10.0,
        flow=9000.0,
        truck_share=0.03,
        run_up=900.0,
        run_out=500.0,
        warm_up=300.0,
        minutes=2.0,
        seed=4,
        eagerness=0.5,
        bottleneck=8.0,
    ),
    "overtake-train": _OVERTAKE,
    "overtake-test": replace(_OVERTAKE, minutes=3.0, seed=12),
    "overtake-dense-test": replace(_OVERTAKE, flow=5100.0, minutes=2.0, seed=13),
    "merge-train": _MERGE,
    "merge-test": replace(_MERGE, minutes=3.0, seed=22),
}
"""Presets of `drlsl data generate`; the bundled recordings are made with their defaults.

Flow and truck share of the highway are those of a busy highD recording, 1,700 vehicles in ten minutes. The
freeway resembles US-101 in the rush hour: five lanes of 12 ft, 65 mph, traffic held up downstream. On the
overtake roads, long and with many trucks, changing lanes saves time. The merge roads have an on-ramp with a
merging lane as long as those of German motorways.
"""


def find_preset(name: str) -> Preset:
    """Return the preset of this name.

    Raises:
        UserError: there is none.
    """
    if name not in PRESETS:
        raise UserError.no_such("preset", name, PRESETS)
    return PRESETS[name]
