"""Small changes of drawn scenes: a number moved a little or a lot, a vehicle of another scene."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from drlsl.lowering.backends import BatchProgram
from drlsl.traffic import Floats, Integers, Mask
from drlsl.verify.attack.sampling import OF_A_VEHICLE, Drawn, Layout, normalise, specials

_BY_COLUMN: Final[dict[int, tuple[str, ...]]] = {
    1: ("right", "lane_width"),
    2: ("ahead",),
    3: ("right", "aside", "lane_width", "median"),
    4: ("ego_speed", "speed"),
    5: ("lateral_speed",),
    6: ("length",),
    7: ("width",),
}
"""The kinds of numbers that a column of `vehicle/8` depends on."""

_BY_ROAD_COLUMN: Final[dict[int, tuple[str, ...]]] = {
    2: ("lane_width", "median", "road_position"),
    3: ("lane_width",),
    4: ("speed_limit",),
}


def relevant_columns(layout: Layout, program: BatchProgram[Any]) -> Mask:
    """Return the columns of scenes on which the relations of a program depend."""
    kinds: set[str] = {name for name, _ in program.reads}
    for relation, table in ((("vehicle", 8), _BY_COLUMN), (("road_lane", 5), _BY_ROAD_COLUMN)):
        for column in program.columns_read(*relation):
            kinds.update(table.get(column, ()))
    if 2 in program.columns_read("vehicle", 8):
        kinds.update(("position", "radar_range"))
    if ("lane_end", 2) in program.reads:
        kinds.update(("end_ahead", "ends"))
    relevant = np.array([kind in kinds for kind in layout.kinds])
    return relevant if relevant.any() else np.ones(layout.columns, dtype=np.bool_)


def change(layout: Layout, rng: np.random.Generator, scenes: Drawn, relevant: Mask) -> Drawn:
    """Change every scene slightly: one or a few of its numbers, or its vehicles."""
    drawn = scenes.take(slice(None))
    count = len(drawn)
    chosen = _chosen(layout, rng, drawn, relevant)
    rows, columns = chosen.nonzero()
    drawn.numbers[rows, columns] = _moved(layout, rng, scenes, rows, columns)
    _rearrange(layout, rng, drawn, scenes)
    normalise(layout, drawn)
    assert len(drawn) == count
    return drawn


def _chosen(layout: Layout, rng: np.random.Generator, drawn: Drawn, relevant: Mask) -> Mask:
    """Return the numbers of each scene to change: one or a few of the relevant ones."""
    count = len(drawn)
    counts = np.broadcast_to(relevant, (count, layout.columns)).copy()
    size = len(OF_A_VEHICLE)
    for place in range(layout.vehicles):
        start = layout.first_vehicle + place * size
        counts[:, start : start + size] &= drawn.present[:, place : place + 1]
    lanes = np.arange(layout.widths.stop)[None, :] < layout.lanes[drawn.case][:, None]
    counts[:, layout.widths] &= lanes
    counts[:, layout.limits] &= lanes
    if layout.has_ends:
        counts[:, layout.ends] &= lanes
        counts[:, layout.end_ahead] &= lanes
    often = rng.choice([1.0, 2.0, 4.0], size=(count, 1)) / np.maximum(1, counts.sum(axis=1, keepdims=True))
    chosen: Mask = (rng.random(counts.shape) < often) & counts
    return chosen


def _moved(
    layout: Layout, rng: np.random.Generator, scenes: Drawn, rows: Integers, columns: Integers
) -> Floats:
    """Return new values for numbers of scenes."""
    value = scenes.numbers[rows, columns]
    size = value.shape
    sign = rng.choice([-1.0, 1.0], size=size)
    reach = (layout.high - layout.low)[columns]
    step = reach * 10.0 ** -rng.uniform(0.0, 13.0, size=size)
    near = np.abs(value) * 10.0 ** -rng.uniform(0.0, 13.0, size=size)
    last = np.spacing(np.abs(value)) * rng.integers(1, 5, size=size)
    other = scenes.numbers[rng.integers(0, len(scenes), size=size), columns]
    way = rng.random(size)
    return np.select(
        [way < 0.4, way < 0.55, way < 0.65, way < 0.75],
        [value + sign * step, value + sign * near, value + sign * last, other],
        specials(layout, rng, columns),
    )


def _rearrange(layout: Layout, rng: np.random.Generator, drawn: Drawn, scenes: Drawn) -> None:
    """Change the vehicles, the focus, the names, and occasionally the road."""
    count = len(drawn)
    roads = rng.random(count) < 0.05
    drawn.case[roads] = rng.integers(0, len(layout.cases), size=int(roads.sum()))
    if not layout.vehicles:
        return
    rows = np.arange(count)
    one = rng.integers(0, layout.vehicles, size=count)
    toggled = rng.random(count) < 0.08
    drawn.present[rows[toggled], one[toggled]] ^= True
    looked_at = rng.random(count) < 0.1
    drawn.focus[looked_at] = rng.integers(-1, layout.vehicles, size=int(looked_at.sum()))
    drawn.upper[rows, one] ^= rng.random(count) < 0.1
    if layout.names:
        renamed = rng.random(count) < 0.1
        drawn.named[rows[renamed], one[renamed]] = rng.integers(
            -1, len(layout.names), size=int(renamed.sum())
        )
    _copy_vehicles(layout, rng, drawn, scenes)


def _copy_vehicles(layout: Layout, rng: np.random.Generator, drawn: Drawn, scenes: Drawn) -> None:
    """Occasionally copy a vehicle from another scene, or one vehicle's speed to another."""
    count = len(drawn)
    rows = (rng.random(count) < 0.08).nonzero()[0]
    size = len(OF_A_VEHICLE)
    source = rng.integers(0, count, size=len(rows))
    here, there = (rng.integers(0, layout.vehicles, size=len(rows)) for _ in range(2))
    for offset in range(size):
        columns = (layout.first_vehicle + place * size + offset for place in (here, there))
        own, others = columns
        drawn.numbers[rows, own] = scenes.numbers[source, others]
    drawn.present[rows, here] = True
    alike = (rng.random(count) < 0.05).nonzero()[0]
    place = rng.integers(0, layout.vehicles, size=len(alike))
    speed = layout.first_vehicle + place * size + OF_A_VEHICLE.index("speed")
    drawn.numbers[alike, speed] = drawn.numbers[alike, layout.scalar["ego_speed"]]
