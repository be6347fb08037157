"""Scenes for checks of exported rules: dense, with boxes that touch, wrong ways and lane changes."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

from drlsl.driving.scene import EGO, Road, Scene, Vehicle
from drlsl.traffic import Direction, Lane

_WIDTHS: Final = (3.0, 3.5, 3.75)
_LIMITS: Final = (13.9, 22.0, 30.0, 36.11)
_LENGTHS: Final = (4.0, 4.6, 12.0)


def draw_scenes(count: int, vehicles: int, seed: int, *, ends: bool = False) -> Iterator[Scene]:
    """Yield `count` scenes with up to `vehicles` others; all lengths and speeds have two decimals.

    With `ends` some of the lanes end; all else is the same.
    """
    rng, other = random.Random(seed), random.Random(seed + 1)
    for _ in range(count):
        scene = _scene(rng, vehicles)
        yield replace(scene, road=_with_ends(other, scene)) if ends else scene


def _scene(rng: random.Random, most: int) -> Scene:
    road = _road(rng)
    lane = rng.choice(road.lanes)
    ego = Vehicle(
        EGO,
        lane.id,
        rng.choice((0.0, 200.0)),
        round(lane.centre + rng.choice((0.0, 0.0, rng.uniform(-0.5, 0.5) * lane.width)), 2),
        lane.direction.sign * round(rng.choice((0.0, lane.speed_limit, rng.uniform(0.0, 40.0))), 2),
        rng.choice((0.0, 0.0, 1.0, -1.0)),
        4.6,
        1.9,
    )
    near = [
        other.id
        for other in road.lanes_of(lane.direction)
        if other.id != lane.id and abs(other.centre - lane.centre) < 1.5 * lane.width
    ]
    others = tuple(_vehicle(rng, f"v{number}", road, ego) for number in range(rng.randint(0, most)))
    return Scene(road, ego, others, rng.choice([lane.id, lane.id, *near]))


def _road(rng: random.Random) -> Road:
    upper = rng.randint(0, 3)
    lower = rng.randint(2 if upper < 2 else 0, 3)
    width = rng.choice(_WIDTHS)
    median = 2.0 if upper and lower else 0.0
    lanes = tuple(
        Lane(
            number + 1,
            Direction.RIGHT_TO_LEFT if number < upper else Direction.LEFT_TO_RIGHT,
            (number + 0.5) * width + (median if number >= upper else 0.0),
            width,
            rng.choice(_LIMITS),
        )
        for number in range(upper + lower)
    )
    return Road(lanes, rng.choice((0.04, 0.1)), 100.0)


def _with_ends(rng: random.Random, scene: Scene) -> Road:
    def end() -> float | None:
        ahead = rng.choice((rng.uniform(-20.0, 20.0), rng.uniform(-300.0, 300.0)))
        return round(scene.ego.x + ahead, 2) if rng.random() < 0.5 else None

    return replace(scene.road, lanes=tuple(replace(lane, end=end()) for lane in scene.road.lanes))


def _vehicle(rng: random.Random, name: str, road: Road, ego: Vehicle) -> Vehicle:
    lane = rng.choice(road.lanes)
    length = rng.choice(_LENGTHS)
    touching = (ego.length + length) / 2
    offset = rng.choice(
        (rng.uniform(-120.0, 120.0), rng.uniform(-40.0, 40.0), touching, -touching, 0.0, 100.0)
    )
    y = round(lane.centre + rng.choice((0.0, rng.uniform(-2.0, 2.0))), 2)
    speed = round(rng.choice((0.0, abs(ego.vx), rng.uniform(0.0, 45.0))), 2)
    wrong_way = rng.random() < 0.15
    return Vehicle(
        name,
        road.lane_at(y),
        round(ego.x + offset, 2),
        y,
        lane.direction.sign * (-speed if wrong_way else speed),
        rng.choice((0.0, round(rng.uniform(-1.5, 1.5), 2))),
        length,
        rng.choice((1.8, 1.9, 2.5)),
    )
