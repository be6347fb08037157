"""Scenes drawn by the thousand within the ranges of the properties, as arrays.

A scene is a row of numbers, as a driver in the ego's lane counts them: forward and to the right. So every row
within the bounds is a scene of `SymbolicScene`, and scenes can be changed number by number. Numbers across
the road are multiples of `GRAIN`, so that lanes touch in floats as they do in real numbers.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Final

import numpy as np

from drlsl.traffic import Floats, Integers, Mask
from drlsl.verify.ranges import MOST_LANES_ONE_WAY, TYPICAL, Case, Range

GRAIN: Final = 2.0**-30
"""Places and sizes across the road [m] are multiples of this: their sums do not round."""

SCALARS: Final = (
    *("median", "road_position", "aside", "ego_speed", "sideways", "ego_length", "ego_width"),
    *("position", "time_step", "radar_range"),
)
OF_A_VEHICLE: Final = ("ahead", "right", "speed", "sideways", "length", "width")

_KINDS: Final = {
    "sideways": "lateral_speed",
    "ego_length": "length",
    "ego_width": "width",
    "ahead": "ahead",
    "right": "right",
}
_ACROSS: Final = frozenset({"lane_width", "median", "road_position", "aside", "right"})
_TYPICAL_SPECIALS: Final = (0.0, 1.0)


class Layout:
    """The columns of a scene's numbers in a row, with the bounds of each.

    `names` are the possible names of a vehicle besides a name of its own. With `ends` each lane may end.
    """

    def __init__(
        self,
        cases: Sequence[Case],
        ranges: Mapping[str, Range],
        vehicles: int,
        *,
        unknowns: Iterable[str] = (),
        names: Sequence[str] = (),
        constants: Iterable[float] = (),
        ends: bool = False,
    ) -> None:
        self.cases = tuple(cases)
        self.vehicles = vehicles
        self.unknowns = tuple(unknowns)
        self.names = tuple(names)
        self.ranges = {
            **ranges,
            "aside": _around(ranges["lane_width"][1] / 2),
            "ahead": _around(ranges["radar_range"][1]),
            "right": _around(ranges["radar_range"][1] + ranges["lane_width"][1]),
            "ends": (Fraction(0), Fraction(1)),
        }
        lanes = range(1, MOST_LANES_ONE_WAY + 1)
        self.kinds: list[str] = [
            *("lane_width" for _ in lanes),
            *("speed_limit" for _ in lanes),
            *(_KINDS.get(name, name) for name in SCALARS),
            *(_KINDS.get(name, name) for _ in range(vehicles) for name in OF_A_VEHICLE),
            *self.unknowns,
            *(kind for kind in ("end_ahead", "ends") for _ in lanes if ends),
        ]
        self.widths = slice(0, len(lanes))
        self.limits = slice(len(lanes), 2 * len(lanes))
        first = 2 * len(lanes)
        self.scalar = {name: first + place for place, name in enumerate(SCALARS)}
        self.first_vehicle = first + len(SCALARS)
        after = self.first_vehicle + vehicles * len(OF_A_VEHICLE)
        self.unknown = {name: after + place for place, name in enumerate(self.unknowns)}
        first_end = after + len(self.unknowns)
        self.end_ahead = slice(first_end, first_end + len(lanes) * ends)
        self.ends = slice(self.end_ahead.stop, len(self.kinds))
        self.across = np.array([kind in _ACROSS for kind in self.kinds])
        self.low, self.high = self._bounds()
        self.specials = self._specials(sorted(set(constants)))
        self.leftward = np.array([case.leftward for case in cases], dtype=np.int64)
        self.lanes = np.array([case.lanes for case in cases], dtype=np.int64)
        self.ego_lane = np.array([case.ego_lane for case in cases], dtype=np.int64)
        self.target = np.array([case.target_lane for case in cases], dtype=np.int64)
        self.sign = np.array([case.direction(case.ego_lane).sign for case in cases], dtype=np.float64)

    @property
    def has_ends(self) -> bool:
        """True if lanes may end."""
        return self.ends.stop > self.ends.start

    @property
    def columns(self) -> int:
        """The number of columns of a scene."""
        return len(self.kinds)

    def vehicle(self, name: str) -> slice:
        """Return the columns of one number of every vehicle."""
        start = self.first_vehicle + OF_A_VEHICLE.index(name)
        stop = self.first_vehicle + self.vehicles * len(OF_A_VEHICLE)
        return slice(start, stop, len(OF_A_VEHICLE))

    def _bounds(self) -> tuple[Floats, Floats]:
        """Return the bounds of every column, rounded inward; a range of one number is that number."""
        low = np.array([_inside(self.ranges[kind], least=True) for kind in self.kinds])
        high = np.array([_inside(self.ranges[kind], least=False) for kind in self.kinds])
        grains = np.ceil(low / GRAIN) * GRAIN, np.floor(high / GRAIN) * GRAIN
        fits = self.across & (grains[0] <= grains[1])
        return np.where(fits, grains[0], low), np.where(fits, grains[1], np.maximum(low, high))

    def _specials(self, constants: Sequence[float]) -> tuple[Floats, Integers]:
        """Return special numbers by column, its ends and constants, and their count for each column."""
        rows = []
        for kind, low, high in zip(self.kinds, self.low, self.high, strict=True):
            usual = [float(TYPICAL[kind])] if kind in TYPICAL else []
            both = [sign * one for one in constants for sign in (1.0, -1.0)]
            tried = dict.fromkeys([low, high, *usual, *_TYPICAL_SPECIALS, *both])
            rows.append([one for one in tried if low <= one <= high])
        most = max(map(len, rows))
        table = np.array([row + [row[0]] * (most - len(row)) for row in rows])
        return table, np.array([len(row) for row in rows], dtype=np.int64)


def _around(most: Fraction) -> Range:
    return (-most, most)


def _inside(bounds: Range, *, least: bool) -> float:
    """Return the end of a range as a float that is not beyond it, unless the range is one number."""
    low, high = bounds
    end = float(low if least else high)
    if low != high and least and Fraction(end) < low:
        return float(np.nextafter(end, np.inf))
    if low != high and not least and Fraction(end) > high:
        return float(np.nextafter(end, -np.inf))
    return end


@dataclass(slots=True)
class Drawn:
    """N scenes: a row of numbers each, (N, columns), and their discrete parts.

    `case` (N,) is the index of the kind of road in `Layout.cases`. `present`, `named` and `upper`, (N, K),
    are for each vehicle whether it exists, the index of its name in `Layout.names` (-1: its own), and its
    lane if it is on the line between two. `focus` (N,) is the index of a vehicle, or -1.
    """

    numbers: Floats
    case: Integers
    present: Mask
    named: Integers
    upper: Mask
    focus: Integers

    def __len__(self) -> int:
        return len(self.case)

    def take(self, index: Any) -> Drawn:
        """Return some of the scenes, copied."""
        return Drawn(*(getattr(self, name)[index].copy() for name in self.__slots__))

    def put(self, index: Any, other: Drawn) -> None:
        """Replace some of the scenes by others."""
        for name in self.__slots__:
            getattr(self, name)[index] = getattr(other, name)


def joined(parts: Sequence[Drawn]) -> Drawn:
    """Return scenes one after the other."""
    return Drawn(*(np.concatenate([getattr(part, name) for part in parts]) for name in Drawn.__slots__))


def draw(layout: Layout, rng: np.random.Generator, count: int) -> Drawn:
    """Draw `count` scenes: some with any numbers, some with usual ones, some at edges and constants."""
    shape = (count, layout.columns)
    numbers = layout.low + (layout.high - layout.low) * rng.random(shape)
    # how often a number of a scene is a special one, and how often it is the usual one
    special = rng.choice([0.0, 0.1, 0.4, 0.8], size=(count, 1))
    usual = rng.choice([0.0, 0.5, 0.9], size=(count, 1))
    typical = np.array([float(TYPICAL.get(kind, np.nan)) for kind in layout.kinds])
    keeps = ~np.isnan(typical) & (rng.random(shape) < usual)
    numbers = np.where(keeps, typical, numbers)
    chosen = rng.random(shape) < special
    rows, columns = chosen.nonzero()
    numbers[rows, columns] = specials(layout, rng, columns)
    there = rng.integers(0, layout.vehicles + 1, size=(count, 1))
    drawn = Drawn(
        numbers=numbers,
        case=rng.integers(0, len(layout.cases), size=count),
        present=np.arange(layout.vehicles) < there,
        named=_names(layout, rng, (count, layout.vehicles)),
        upper=rng.random((count, layout.vehicles)) < 0.5,
        focus=rng.integers(-1, max(1, layout.vehicles), size=count),
    )
    normalise(layout, drawn)
    if layout.vehicles:
        _place(layout, rng, drawn)
        normalise(layout, drawn)
    if layout.has_ends:
        _place_ends(layout, rng, drawn)
        normalise(layout, drawn)
    return drawn


def specials(layout: Layout, rng: np.random.Generator, columns: Integers) -> Floats:
    """Draw a special number for each of these columns: an end, a constant, or one close to it."""
    table, counts = layout.specials
    size = columns.shape
    value = table[columns, (rng.random(size) * counts[columns]).astype(np.int64)]
    way = rng.random(size)
    sign = rng.choice([-1.0, 1.0], size=size)
    spacing = np.spacing(np.maximum(np.abs(value), 1e-300)) * rng.integers(1, 4, size=size)
    reach = (layout.high - layout.low)[columns] * 10.0 ** -rng.uniform(0.0, 12.0, size=size)
    moved = value + sign * np.where(way < 0.6, spacing, reach)
    result: Floats = np.where(way < 0.4, value, moved)
    return result


def _names(layout: Layout, rng: np.random.Generator, shape: tuple[int, int]) -> Integers:
    if not layout.names:
        return np.full(shape, -1, dtype=np.int64)
    some = rng.integers(0, len(layout.names), size=shape)
    often = rng.choice([0.0, 0.3], size=(shape[0], 1))
    return np.where(rng.random(shape) < often, some, -1)


def _place(layout: Layout, rng: np.random.Generator, drawn: Drawn) -> None:
    """Put the vehicles where they matter: in lanes, at their lines, and at all distances from the ego."""
    count, vehicles = drawn.present.shape
    shape = (count, vehicles)
    centres = lane_centres(layout, drawn)
    widths = drawn.numbers[:, layout.widths]
    rows = np.arange(count)[:, None]
    lane = (rng.random(shape) * layout.lanes[drawn.case][:, None]).astype(np.int64)
    ego = centres[rows[:, 0], layout.ego_lane[drawn.case] - 1][:, None]
    middle = (centres[rows, lane] - ego) * layout.sign[drawn.case][:, None]
    wide = widths[rows, lane]
    half = drawn.numbers[:, layout.vehicle("width")] / 2
    sides = rng.choice([-1.0, 1.0], size=shape)
    touching = rng.choice([-1.0, 0.0, 1.0], size=shape) * half
    little = rng.choice([0.0, 1.0, -1.0], size=shape) * 10.0 ** -rng.uniform(0.0, 9.0, size=shape)
    way = rng.random(shape)
    right = np.where(
        way < 0.6,
        middle + wide * rng.uniform(-0.5, 0.5, size=shape),
        np.where(way < 0.8, middle + sides * wide / 2 + touching + little, rng.uniform(-12, 12, size=shape)),
    )
    drawn.numbers[:, layout.vehicle("right")] = np.where(rng.random(shape) < 0.15, middle, right)
    own = drawn.numbers[:, layout.scalar["ego_length"]][:, None]
    room = (own + drawn.numbers[:, layout.vehicle("length")]) / 2
    reach = drawn.numbers[:, layout.scalar["radar_range"]][:, None]
    gap = rng.choice([0.0, 2.0, 1.0], size=shape) + reach * 10.0 ** -rng.uniform(0.0, 6.0, size=shape)
    way = rng.random(shape)
    ahead = np.where(
        way < 0.6,
        sides * (room + np.where(way < 0.3, gap, reach * rng.random(shape))),
        np.where(way < 0.75, room * rng.uniform(-1.0, 1.0, size=shape), reach * rng.uniform(-1, 1, shape)),
    )
    kept = rng.random(shape) < 0.05
    drawn.numbers[:, layout.vehicle("ahead")] = np.where(
        kept, drawn.numbers[:, layout.vehicle("ahead")], ahead
    )
    alike = rng.random(shape) < 0.1
    speeds = drawn.numbers[:, layout.vehicle("speed")]
    drawn.numbers[:, layout.vehicle("speed")] = np.where(
        alike, drawn.numbers[:, layout.scalar["ego_speed"]][:, None], speeds
    )


def _place_ends(layout: Layout, rng: np.random.Generator, drawn: Drawn) -> None:
    """Put the ends of most lanes where they matter: at all distances from the ego's front."""
    ends = drawn.numbers[:, layout.end_ahead]
    front = drawn.numbers[:, [layout.scalar["ego_length"]]] / 2
    room = rng.choice([1.0, 1.0, -1.0], size=ends.shape) * 400.0 * 10.0 ** -rng.uniform(0.0, 6.0, ends.shape)
    drawn.numbers[:, layout.end_ahead] = np.where(rng.random(ends.shape) < 0.7, front + room, ends)


def normalise(layout: Layout, drawn: Drawn) -> None:
    """Make valid scenes of changed rows: within the bounds, the ego in its lane, every name once."""
    numbers = drawn.numbers
    grains = np.round(numbers / GRAIN) * GRAIN
    # a range of one number need not be a multiple
    fixed = layout.low == layout.high
    np.copyto(numbers, grains, where=(layout.across & ~fixed)[None, :])
    np.clip(numbers, layout.low, layout.high, out=numbers)
    rows = np.arange(len(drawn))
    half = numbers[rows, layout.ego_lane[drawn.case] - 1] / 2
    aside = layout.scalar["aside"]
    numbers[:, aside] = np.clip(numbers[:, aside], -half, half)
    for place in range(1, layout.vehicles):
        twice = (drawn.named[:, :place] == drawn.named[:, place : place + 1]).any(axis=1)
        drawn.named[twice, place] = -1
    lost = (drawn.focus >= 0) & ~(drawn.present[rows, drawn.focus] if layout.vehicles else False)
    drawn.focus[lost] = -1


def lane_centres(layout: Layout, drawn: Drawn) -> Floats:
    """Return the y of every lane's centre, shape (N, most lanes); missing lanes are extrapolated."""
    widths = drawn.numbers[:, layout.widths]
    steps = (widths[:, 1:] + widths[:, :-1]) / 2
    numbers = np.arange(1, widths.shape[1])
    between = numbers == layout.leftward[drawn.case][:, None]
    steps = steps + np.where(between, drawn.numbers[:, [layout.scalar["median"]]], 0.0)
    places = np.concatenate([np.zeros((len(drawn), 1)), np.cumsum(steps, axis=1)], axis=1)
    rows = np.arange(len(drawn))
    own = places[rows, layout.ego_lane[drawn.case] - 1][:, None]
    middle = drawn.numbers[:, [layout.scalar["road_position"]]]
    result: Floats = places - own + middle
    return result
