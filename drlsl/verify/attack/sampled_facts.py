"""The facts of drawn scenes: as arrays, as a scene for the other tiers, and in exact rational numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Any, Final, TypeAlias

import numpy as np

from drlsl.driving.scene import (
    EGO,
    EGO_LIMITS,
    Road,
    Scene,
    Vehicle,
    facts_of,
)
from drlsl.logic.terms import Atom
from drlsl.lowering.backends import Rows
from drlsl.traffic import Direction, Floats, Integers, Lane, Mask
from drlsl.verify.attack.sampling import OF_A_VEHICLE, Drawn, Layout, lane_centres
from drlsl.verify.ranges import Case, decimal
from drlsl.verify.smt import NOBODY, Rational

ExactFacts: TypeAlias = dict[tuple[str, int], list[tuple[Any, ...]]]
"""Rows of atoms, integers and fractions, by name and arity."""

_FIRST_OWN: Final = 1 << 20
"""The integer of vehicle 0 in arrays; atoms of the program have smaller ones."""


class _Places:
    """The places of vehicles and lanes, in coordinates of the road; of shape (N, K) or (N, lanes)."""

    def __init__(self, layout: Layout, drawn: Drawn) -> None:
        numbers = drawn.numbers
        self.sign = layout.sign[drawn.case][:, None]
        self.centres = lane_centres(layout, drawn)
        self.widths = numbers[:, layout.widths]
        rows = np.arange(len(drawn))
        self.ego_lane = layout.ego_lane[drawn.case]
        middle = self.centres[rows, self.ego_lane - 1][:, None]

        def scalar(name: str) -> Floats:
            return numbers[:, [layout.scalar[name]]]

        columns = {name: numbers[:, layout.vehicle(name)] for name in OF_A_VEHICLE}
        self.x = _beside(scalar("position"), scalar("position") + self.sign * columns["ahead"])
        self.y = _beside(middle + self.sign * scalar("aside"), middle + self.sign * columns["right"])
        self.vx = self.sign * _beside(scalar("ego_speed"), columns["speed"])
        self.vy = self.sign * _beside(scalar("sideways"), columns["sideways"])
        self.length = _beside(scalar("ego_length"), columns["length"])
        self.width = _beside(scalar("ego_width"), columns["width"])
        dx, dy = self.x - self.x[:, :1], self.y - self.y[:, :1]
        reach = scalar("radar_range")
        # at the edge of the range a root may round either way: only vehicles surely inside are facts
        near = (dx * dx + dy * dy <= reach * reach * (1.0 - 2e-15)) | ((dy == 0) & (np.abs(dx) <= reach))
        self.valid: Mask = near & _beside(np.ones((len(drawn), 1), dtype=np.bool_), drawn.present)
        self.lane = self._lanes(layout, drawn)

    def ends(self, layout: Layout, drawn: Drawn) -> tuple[Floats, Mask]:
        """Return the x where each lane ends, and whether it does."""
        ends = self.x[:, :1] + self.sign * drawn.numbers[:, layout.end_ahead]
        lanes = np.arange(1, ends.shape[1] + 1) <= layout.lanes[drawn.case][:, None]
        return ends, lanes & (drawn.numbers[:, layout.ends] >= 0.5)

    def _lanes(self, layout: Layout, drawn: Drawn) -> Integers:
        """Return the lane that holds each centre, 0 for none; on the line between two, either."""
        half = self.widths / 2
        inside = np.abs(self.y[:, 1:, None] - self.centres[:, None, :]) <= half[:, None, :]
        there = np.arange(1, half.shape[1] + 1) <= layout.lanes[drawn.case][:, None]
        inside &= there[:, None, :]
        first = np.where(inside.any(axis=2), inside.argmax(axis=2) + 1, 0)
        last = np.where(inside.any(axis=2), half.shape[1] - inside[:, :, ::-1].argmax(axis=2), 0)
        lane: Integers = _beside(self.ego_lane[:, None], np.where(drawn.upper, first, last))
        return lane


def _beside(one: Any, others: Any) -> Any:
    return np.concatenate([one, others], axis=1)


def array_facts(layout: Layout, drawn: Drawn, code: Callable[[str], int]) -> dict[tuple[str, int], Rows]:
    """Return the facts of all scenes; `code` returns the integers of atoms."""
    places = _Places(layout, drawn)
    count, lanes = len(drawn), places.widths.shape[1]
    named = np.array([code(name) for name in layout.names] or [0], dtype=np.int64)
    own = _FIRST_OWN + np.arange(layout.vehicles)
    ids = np.where(drawn.named >= 0, named[drawn.named], own)
    vehicle = [places.lane, places.x, places.y, places.vx, places.vy, places.length, places.width]
    names = _beside(np.full((count, 1), code(EGO), dtype=np.int64), ids)
    rows = np.arange(count)
    focus = np.where(drawn.focus >= 0, ids[rows, drawn.focus] if layout.vehicles else 0, code(NOBODY))
    numbers = np.broadcast_to(np.arange(1, lanes + 1), (count, lanes))
    left, right = (code(one.value) for one in (Direction.RIGHT_TO_LEFT, Direction.LEFT_TO_RIGHT))
    way = np.where(numbers <= layout.leftward[drawn.case][:, None], left, right)
    road = [numbers, way, places.centres, places.widths, drawn.numbers[:, layout.limits]]
    facts = {
        ("vehicle", 8): Rows([names, *vehicle], places.valid),
        ("road_lane", 5): Rows(road, numbers <= layout.lanes[drawn.case][:, None]),
        ("target_lane", 1): Rows([layout.target[drawn.case]]),
        ("focus", 1): Rows([focus]),
        ("time_step", 1): Rows([drawn.numbers[:, layout.scalar["time_step"]]]),
        ("radar_range", 1): Rows([drawn.numbers[:, layout.scalar["radar_range"]]]),
    }
    if layout.has_ends:
        ends, there = places.ends(layout, drawn)
        facts["lane_end", 2] = Rows([numbers, ends], there)
    facts.update({(name, 1): Rows([np.array([value])]) for name, value in EGO_LIMITS.items()})
    facts.update({(name, 1): Rows([drawn.numbers[:, place]]) for name, place in layout.unknown.items()})
    return facts


def name_of(layout: Layout, drawn: Drawn, vehicle: int) -> str:
    """Return the name of a vehicle of the only scene."""
    named = int(drawn.named[0, vehicle])
    if named >= 0:
        return layout.names[named]
    own = f"v{vehicle + 1}"
    while own in layout.names:
        own += "_"
    return own


def scene_of(layout: Layout, drawn: Drawn) -> tuple[Scene, str, dict[str, float]]:
    """Return the only scene that was drawn, the vehicle in focus or `none`, and the other numbers."""
    places = _Places(layout, drawn)
    case = layout.cases[int(drawn.case[0])]

    def car(name: str, row: int) -> Vehicle:
        columns = (places.x, places.y, places.vx, places.vy, places.length, places.width)
        return Vehicle(name, int(places.lane[0, row]), *(float(column[0, row]) for column in columns))

    limits = drawn.numbers[0, layout.limits]
    ends = _ends_of(layout, drawn, places)
    columns = (places.centres[0], places.widths[0], limits)
    lanes = tuple(
        Lane(lane, case.direction(lane), *(float(one[lane - 1]) for one in columns))
        for lane in range(1, case.lanes + 1)
    )
    lanes = tuple(replace(lane, end=ends.get(lane.id)) for lane in lanes)
    road = Road(
        lanes=lanes,
        time_step=float(drawn.numbers[0, layout.scalar["time_step"]]),
        radar_range=float(drawn.numbers[0, layout.scalar["radar_range"]]),
    )
    there = [place for place in range(layout.vehicles) if places.valid[0, place + 1]]
    others = tuple(car(name_of(layout, drawn, place), place + 1) for place in there)
    focus = int(drawn.focus[0])
    named = name_of(layout, drawn, focus) if focus in there else NOBODY
    values = {name: float(drawn.numbers[0, place]) for name, place in layout.unknown.items()}
    return Scene(road, car(EGO, 0), others, case.target_lane), named, values


def _ends_of(layout: Layout, drawn: Drawn, places: _Places) -> dict[int, float]:
    """Return where the lanes of the only scene end, by the lanes that do."""
    if not layout.has_ends:
        return {}
    ends, there = places.ends(layout, drawn)
    return {lane + 1: float(ends[0, lane]) for lane in np.flatnonzero(there[0]).tolist()}


def exact_facts(layout: Layout, drawn: Drawn) -> ExactFacts | None:
    """Return the facts of the only scene in rational numbers; None if the proof does not cover it.

    A number at the end of its range is exactly that end, whatever the float there is; lanes touch.
    """
    scene, focus, unknowns = scene_of(layout, drawn)
    case = layout.cases[int(drawn.case[0])]
    exact = [
        _exact(value, layout.ranges[kind]) for value, kind in zip(drawn.numbers[0], layout.kinds, strict=True)
    ]
    sign = case.direction(case.ego_lane).sign
    value = {name: exact[place] for name, place in layout.scalar.items()}
    centres, widths = _exact_lanes(layout, case, exact), exact[layout.widths]
    middle = centres[case.ego_lane - 1]
    own = ("ego_speed", "sideways", "ego_length", "ego_width")
    boxes = {EGO: (Fraction(0), value["aside"], *(value[name] for name in own))}
    for place in range(layout.vehicles):
        start = layout.first_vehicle + place * len(OF_A_VEHICLE)
        boxes[name_of(layout, drawn, place)] = tuple(exact[start : start + len(OF_A_VEHICLE)])
    rows: list[tuple[Any, ...]] = []
    for car in (scene.ego, *scene.vehicles):
        ahead, right, speed, sideways, length, width = boxes[car.id]
        y = middle + sign * right
        place_x = value["position"] + sign * ahead
        rows.append((Atom(car.id), car.lane, place_x, y, sign * speed, sign * sideways, length, width))
    strips = list(zip(centres, widths, strict=False))[: case.lanes]
    reach = value["radar_range"]
    seen = all((row[2] - rows[0][2]) ** 2 + (row[3] - rows[0][3]) ** 2 <= reach**2 for row in rows)
    if not seen or not all(_holds(strips, row[1], row[3]) for row in rows):
        return None
    limits = exact[layout.limits]
    lanes = [
        (lane, Atom(case.direction(lane).value), *strips[lane - 1], limits[lane - 1])
        for lane in range(1, case.lanes + 1)
    ]
    facts: ExactFacts = {
        ("vehicle", 8): rows,
        ("road_lane", 5): lanes,
        ("lane_end", 2): [
            (lane.id, value["position"] + sign * exact[layout.end_ahead][lane.id - 1])
            for lane in scene.road.lanes
            if lane.end is not None
        ],
        ("target_lane", 1): [(case.target_lane,)],
        ("focus", 1): [(Atom(focus),)],
    }
    single: Mapping[str, Rational] = {
        **{name: value[name] for name in ("time_step", "radar_range")},
        **{name: decimal(limit) for name, limit in EGO_LIMITS.items()},
        **{name: exact[layout.unknown[name]] for name in unknowns},
    }
    facts.update({(name, 1): [(number,)] for name, number in single.items()})
    return facts


def _exact(value: float, bounds: tuple[Fraction, Fraction]) -> Fraction:
    """Return a float as the fraction that it is or, at an end of its range, as that end."""
    return min(bounds[1], max(bounds[0], Fraction(value)))


def _exact_lanes(layout: Layout, case: Case, exact: list[Fraction]) -> list[Fraction]:
    widths = exact[layout.widths]
    places = [Fraction(0)]
    for lane in range(1, len(widths)):
        step = (widths[lane - 1] + widths[lane]) / 2
        places.append(places[-1] + step + (exact[layout.scalar["median"]] if lane == case.leftward else 0))
    own = places[case.ego_lane - 1]
    return [place - own + exact[layout.scalar["road_position"]] for place in places]


def _holds(strips: list[tuple[Fraction, Fraction]], lane: int, y: Fraction) -> bool:
    """Return whether a lane holds a centre, or, for lane 0, whether none does."""
    inside = [abs(y - centre) <= width / 2 for centre, width in strips]
    return inside[lane - 1] if lane else not any(inside)


def float_facts(scene: Scene, focus: str, unknowns: Mapping[str, float]) -> ExactFacts:
    """Return the facts of a scene in floats, as the rules get them."""
    facts: ExactFacts = {
        key: [tuple(Atom(cell) if isinstance(cell, str) else cell for cell in row) for row in rows]
        for key, rows in facts_of(scene).items()
    }
    facts["focus", 1] = [(Atom(focus),)]
    facts.update({(name, 1): [(value,)] for name, value in unknowns.items()})
    return facts
