"""Ways of vehicles along the lanes of highway-env, and where on two of them the vehicles come too near."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np

from drlsl.traffic import Floats, Mask

GRID: Final = 0.5
"""Distance between two places on a way that are looked at [m]."""

ROOM_ALONG: Final = 0.3
ROOM_ACROSS: Final = 0.3
"""The room kept between two vehicles, along the direction of the first and across it [m]."""

SIDE_LAG: Final = 0.7
"""Time constant with which a vehicle approaches the centre line of its lane [s], about."""

SLOWEST: Final = 2.0
"""A vehicle that drives slower than this approaches the centre line as if it drove so [m/s]."""

_SPARE: Final = 0.5
"""How much a zone may grow when it takes in the next place of the ego [m]: fewer zones are faster."""

_PER_LANE: Final = 0.5
"""Distance between two places of a lane that are computed; what is between is straight [m]."""


class Zone(NamedTuple):
    """A zone: the ego from `from_1` to `to_1` and the other from `from_2` to `to_2` are too near.

    All are distances that the centres drive from now on [m]; `alike` is the greatest cosine of the angle
    between their directions there.
    """

    from_1: float
    to_1: float
    from_2: float
    to_2: float
    alike: float


class Sampled:
    """The places of the lanes of a network, each lane sampled when it is first used."""

    def __init__(self, network: Any) -> None:
        self.network = network
        self._lanes: dict[Any, tuple[Floats, Floats]] = {}

    def lane(self, index: Any) -> tuple[Floats, Floats]:
        """Return distances along a lane, and x, y and heading of its centre line there, shape (3, N)."""
        known = self._lanes.get(index)
        if known is None:
            lane = self.network.get_lane(index)
            places = np.linspace(0.0, lane.length, 1 + math.ceil(lane.length / _PER_LANE))
            rows = [(*lane.position(place, 0.0), lane.heading_at(place)) for place in places]
            known = self._lanes[index] = places, np.array(rows).T
        return known


@dataclass(frozen=True, slots=True)
class Way:
    """The places of a vehicle on its way: x, y [m] and direction, each shape (N,), `GRID` apart."""

    x: Floats
    y: Floats
    right: Floats
    down: Floats
    length: float
    width: float

    @classmethod
    def along(cls, sampled: Sampled, route: Sequence[Any], car: Any, reach: float) -> Way:
        """Return the way of a vehicle on the lanes of a route, from where it is, at least `reach` far."""
        along, across = sampled.network.get_lane(route[0]).local_coordinates(car.position)
        places: Floats = np.arange(math.ceil(reach / GRID) + 2, dtype=np.float64) * GRID
        x, y, heading = _centre_line(sampled, route, float(along), places)
        aside = across * np.exp(-places / (max(float(car.speed), SLOWEST) * SIDE_LAG))
        right, down = np.cos(heading), np.sin(heading)
        return cls(x - aside * down, y + aside * right, right, down, float(car.LENGTH), float(car.WIDTH))


def _centre_line(sampled: Sampled, route: Sequence[Any], along: float, places: Floats) -> Floats:
    """Return x, y and heading at distances from a place in the first lane of a route, shape (3, N).

    Before the first lane and behind the last the way is straight.
    """
    distances, rows, start = [], [], -along
    for index in route:
        place, row = sampled.lane(index)
        distances.append(start + place)
        rows.append(row)
        start += float(place[-1])
    known, values = np.concatenate(distances), np.concatenate(rows, axis=1)
    values[2] = np.unwrap(values[2])
    found = np.array([np.interp(places, known, one) for one in values])
    beyond = places - np.clip(places, known[0], known[-1])
    found[0] += beyond * np.cos(found[2])
    found[1] += beyond * np.sin(found[2])
    return found


Path: TypeAlias = "tuple[int, Way]"
"""Another vehicle's number, and a way that it may take."""


def meetings(ways: Sequence[Way], paths: Sequence[Path]) -> Iterator[tuple[int, int, Zone]]:
    """Yield number of the ego's way, number of the other vehicle, and each zone of the two."""
    for number, way in enumerate(ways):
        for car, path in paths:
            for zone in zones(way, path):
                yield number, car, zone


def zones(one: Way, other: Way) -> Iterator[Zone]:
    """Yield the zones of two ways: they cover all pairs of places at which the vehicles are too near."""
    near, cosine = _too_near(one, other)
    if not near.any():
        return
    cells = near[1:, 1:] | near[:-1, 1:] | near[1:, :-1] | near[:-1, :-1]
    open_: list[list[float]] = []  # first and last row, first and last column
    for row in np.flatnonzero(cells.any(axis=1)).tolist():
        grown = []
        for low, high in _runs(cells[row]):
            for zone in open_:
                if zone[1] == row - 1 and _fits(zone, low, high):
                    open_.remove(zone)
                    grown.append([zone[0], row, min(zone[2], low), max(zone[3], high)])
                    break
            else:
                grown.append([row, row, low, high])
        yield from (_zone(zone, cosine) for zone in open_)
        open_ = grown
    yield from (_zone(zone, cosine) for zone in open_)


def _fits(zone: Sequence[float], low: float, high: float) -> bool:
    """Return whether a zone grows by little if it takes in the columns of the next row."""
    size = max(zone[3] - zone[2], high - low)
    return max(zone[3], high) - min(zone[2], low) <= size + _SPARE / GRID


def _runs(cells: Mask) -> Iterator[tuple[int, int]]:
    """Yield the first and the last of each run of true cells."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], cells.astype(np.int8), [0]))))
    for low, high in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        yield low, high - 1


def _zone(cells: Sequence[float], cosine: Floats) -> Zone:
    first, last, low, high = map(int, cells)
    alike = float(cosine[first : last + 2, low : high + 2].max())
    return Zone(first * GRID, (last + 1) * GRID, low * GRID, (high + 1) * GRID, alike)


def _too_near(one: Way, other: Way) -> tuple[Mask, Floats]:
    """Return for each pair of places whether they are too near, and the cosine of the directions."""
    dx, dy = other.x[None, :] - one.x[:, None], other.y[None, :] - one.y[:, None]
    right, down = one.right[:, None], one.down[:, None]
    cosine = right * other.right + down * other.down
    cos, sin = np.abs(cosine), np.abs(right * other.down - down * other.right)
    along = (one.length + other.length * cos + other.width * sin) / 2 + ROOM_ALONG
    across = (one.width + other.length * sin + other.width * cos) / 2 + ROOM_ACROSS
    near = (np.abs(dx * right + dy * down) < along) & (np.abs(dy * right - dx * down) < across)
    return near, cosine
