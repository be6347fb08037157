"""The simulated drivers: their wishes, drawn one by one, and when they set out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from drlsl.traffic.road_network import main_route, ramp_route
from drlsl.traffic.road_presets import Preset

HARDEST_BRAKING: Final = 8.0
"""Emergency deceleration of every vehicle [m/s²], the limit of a dry road."""

LANE_CHANGING: Final = (
    'maxSpeedLat="1.0" lcAccelLat="0.8" lcSublane="1" minGapLat="0.3" lcSigma="0.2" lcKeepRight="2"'
)
"""SUMO's parameters of lane changes: at most 1 m/s sideways, reached with 0.8 m/s²; a change takes 5 s."""


@dataclass(frozen=True, slots=True)
class Normal:
    """A normal distribution cut off at both ends."""

    mean: float
    deviation: float
    low: float
    high: float

    def draw(self, random: np.random.Generator) -> float:
        """Return one value; draws beyond an end land on it."""
        return float(np.clip(random.normal(self.mean, self.deviation), self.low, self.high))


@dataclass(frozen=True, slots=True)
class Drivers:
    """Wishes of the drivers of one class [m/s, s, m/s²] and sizes of their vehicles [m]."""

    speed: Normal
    headway: Normal
    acceleration: Normal
    braking: Normal
    length: Normal
    width: Normal


CARS: Final = Drivers(
    speed=Normal(36.0, 4.5, 27.0, 46.0),
    headway=Normal(1.0, 0.15, 0.7, 1.4),
    acceleration=Normal(1.8, 0.25, 1.2, 2.4),
    braking=Normal(3.0, 0.3, 2.2, 3.8),
    length=Normal(4.5, 0.45, 3.5, 5.8),
    width=Normal(1.87, 0.1, 1.6, 2.2),
)
LATERAL_OFFSET: Final = Normal(0.0, 0.15, -0.4, 0.4)
"""Preferred offset of a driver to the left of the lane's centre [m]."""

TRUCKS: Final = Drivers(
    speed=Normal(24.0, 0.8, 22.2, 26.0),
    headway=Normal(1.5, 0.2, 1.1, 2.0),
    acceleration=Normal(1.0, 0.1, 0.7, 1.3),
    braking=Normal(2.5, 0.2, 2.0, 3.0),
    length=Normal(14.5, 3.0, 8.0, 18.5),
    width=Normal(2.5, 0.05, 2.3, 2.6),
)


def write_routes(path: Path, preset: Preset, random: np.random.Generator, seconds: float) -> frozenset[int]:
    """Write every vehicle with its own driver, by time of departure; return the ids of the trucks."""
    departures = sorted(_departures(preset, random, seconds))
    shuffled = random.permutation(len(departures))
    trucks = frozenset(shuffled[: round(preset.truck_share * len(departures))].tolist())
    lines = []
    for index, (time, _, route, lane) in enumerate(departures):
        truck = index in trucks
        lines.append(_vehicle_type(f"type{index}", preset, truck, random))
        lines.append(
            f'<vehicle id="{index}" type="type{index}" depart="{time:.2f}" '
            f'departLane="{"0" if truck else lane}" departPos="base" departSpeed="max">'
            f'<route edges="{route}"/></vehicle>'
        )
    path.write_text("<routes>" + "\n".join(lines) + "</routes>")
    return trucks


def _departures(
    preset: Preset, random: np.random.Generator, seconds: float
) -> Iterator[tuple[float, int, str, str]]:
    """Yield time [s], entrance, route and lane of every car; trucks begin in lane 0."""
    ways = [(preset.flow, main_route(preset, direction), "best") for direction in preset.directions]
    for number, merge in enumerate(preset.merges):
        ways += [(merge.flow, ramp_route(preset, way, number), "0") for way in preset.directions]
    for entrance, (flow, route, lane) in enumerate(ways):
        for time in _arrivals(flow, random, seconds):
            yield time, entrance, route, lane


def _arrivals(flow: float, random: np.random.Generator, seconds: float) -> list[float]:
    """Return the departure times of a Poisson process."""
    gaps = random.exponential(3600 / flow, size=int(seconds * flow / 3600 * 1.5) + 50)
    times = np.cumsum(gaps)
    return [float(time) for time in times[times < seconds]]


def _vehicle_type(name: str, preset: Preset, truck: bool, random: np.random.Generator) -> str:
    drivers = TRUCKS if truck else CARS
    values = {
        "maxSpeed": drivers.speed.draw(random),
        "tau": drivers.headway.draw(random),
        "accel": drivers.acceleration.draw(random),
        "decel": drivers.braking.draw(random),
        "length": drivers.length.draw(random),
        "width": drivers.width.draw(random),
        "latAlignment": LATERAL_OFFSET.draw(random),
    }
    drawn = " ".join(f'{key}="{value:.2f}"' for key, value in values.items())
    return (
        f'<vType id="{name}" vClass="{"truck" if truck else "passenger"}" {drawn} minGap="2.5" '
        f'emergencyDecel="{HARDEST_BRAKING}" speedFactor="1" speedDev="0" carFollowModel="EIDM" '
        f'laneChangeModel="SL2015" lcSpeedGain="{preset.eagerness}" {LANE_CHANGING}/>'
    )
