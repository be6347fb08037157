"""Confirm the solver's scenes with the rules: only what every tier confirms is a refutation."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any, Final

from drlsl.driving.scene import (
    Facts,
    Road,
    Scene,
    SceneBatch,
    Vehicle,
    facts_of,
    parse_scene,
    scene_json,
)
from drlsl.driving.shield import LIMITS, RuleFailure, Shield
from drlsl.errors import UserError
from drlsl.logic import Engine, LimitExceeded, PrologError
from drlsl.lowering.backends import Scalar, compile_scalar
from drlsl.lowering.frontend import lower
from drlsl.lowering.ir import NotLowerable, Schema, Undecided
from drlsl.traffic import Direction, Lane
from drlsl.verify.images import calls
from drlsl.verify.properties import FACTS, Property
from drlsl.verify.smt import FOCUS, NOBODY, Model, SymbolicScene

_DIGITS: Final = (2, 4, 8, None)
"""Decimals to which a scene's numbers are rounded if it still breaks the property then."""

_TIERS: Final = ("scalar", "numpy")


@dataclass(frozen=True, slots=True)
class Counterexample:
    """A scene that breaks a property, and the vehicle that `focus/1` names in it, or None.

    `images` are the other scenes of the property, by name; `error` is the error that the rules raise in the
    scene, if that breaks the property. `unknowns` are the numbers of the property besides the scene.
    """

    scene: Scene
    focus: str | None = None
    images: tuple[tuple[str, Scene], ...] = ()
    error: str | None = None
    unknowns: Mapping[str, float] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """Return the scene as a scene file has it, with all other fields."""
        result: dict[str, Any] = {"scene": json.loads(scene_json(self.scene))}
        if self.focus is not None:
            result["focus"] = self.focus
        if self.unknowns:
            result["unknowns"] = dict(self.unknowns)
        if self.images:
            result["images"] = {name: json.loads(scene_json(scene)) for name, scene in self.images}
        if self.error is not None:
            result["error"] = self.error
        return result


class Replay:
    """Runs the tiers on a scene to see whether it breaks a property."""

    def __init__(self, engine: Engine, prop: Property, facts: Schema = FACTS) -> None:
        self._engine = engine
        self._property = prop
        self._goal = engine.prepare(prop.goal)
        self._scalar: Scalar | None = None
        self._shields: list[Shield] | None = None
        with suppress(NotLowerable):  # then the interpreter's answer is enough
            self._scalar = compile_scalar(lower(engine, facts, [prop.query]))

    def confirm(self, symbolic: SymbolicScene, model: Model) -> Counterexample | None:
        """Return the counterexample of a model, with its numbers rounded if possible; None if it is none."""
        exact, focus = symbolic.scene(model)
        unknowns = symbolic.unknown_values(model)
        for digits in _DIGITS:
            try:
                scene = parse_scene(scene_json(_rounded(exact, digits)), "scene")
            except UserError:
                continue
            if _ranges_hold(scene, symbolic):
                found = self.breaks(scene, focus, _shortened(unknowns, digits, symbolic))
                if found is not None:
                    return found
        return None

    def breaks(
        self, scene: Scene, focus: str, unknowns: Mapping[str, float] | None = None
    ) -> Counterexample | None:
        """Return the counterexample of a scene and unknown numbers, if all tiers confirm it."""
        facts = facts_of(scene)
        facts[FOCUS.name, FOCUS.arity] = [(focus,)]
        facts.update({(name, 1): [(value,)] for name, value in (unknowns or {}).items()})
        called = self._called()
        shown = focus if focus != NOBODY and (FOCUS.name, FOCUS.arity) in called else None
        spoken_of = {name: value for name, value in (unknowns or {}).items() if (name, 1) in called}
        try:
            if not self._ask(facts):
                return None
        except (PrologError, LimitExceeded) as error:
            return Counterexample(scene, shown, error=str(error).splitlines()[0], unknowns=spoken_of)
        if self._scalar is not None:
            try:
                (broken,) = self._scalar(facts)
            except Undecided:
                broken = True  # left to the interpreter, which has confirmed it
            if not broken:
                return None
        if not self._tiers_agree(scene):
            return None
        self._ask(facts)
        return Counterexample(scene, shown, tuple(self._images(scene)), unknowns=spoken_of)

    def _ask(self, facts: Facts) -> bool:
        for (name, arity), rows in facts.items():
            self._engine.replace_facts(name, arity, rows)
        return self._goal.holds(LIMITS)

    def _tiers_agree(self, scene: Scene) -> bool:
        """Return whether interpreter, generated code and arrays make the same decision."""
        shields = self._driving_shields()
        if not shields:
            return True
        try:
            decision = shields[0].decide(scene)
        except RuleFailure:
            return True
        for shield in shields[1:]:
            batch = shield.decide_batch(SceneBatch.of([scene]))
            if batch.failures or tuple(map(int, batch.action_mask[0])) != decision.action_mask:
                return False
            if float(batch.target_speed[0]) != decision.target_speed:
                return False
        return True

    def _driving_shields(self) -> Sequence[Shield]:
        """Return shields of the interpreter and of the tiers that can run the program.

        There are none if the program answers only some questions. They are made once, because the clauses of
        the program do not change.
        """
        if self._shields is None:
            self._shields = []
            with suppress(UserError):
                self._shields.append(Shield(self._engine))
                for tier in _TIERS:
                    with suppress(UserError):  # a program that this tier cannot run
                        self._shields.append(self._shields[0].with_tier(tier))
        return self._shields

    def _called(self) -> set[tuple[str, int]]:
        """Return the predicates that the property depends on, also indirectly."""
        seen: set[tuple[str, int]] = set()
        open_ = [(self._property.query.name, 0)]
        while open_:
            key = open_.pop()
            if key in seen or not self._engine.defines(*key):
                continue
            seen.add(key)
            for clause in self._engine.clauses(*key):
                if key == ("violates", 1) and getattr(clause.args[0], "name", None) != self._property.name:
                    continue
                open_.extend(calls(clause.body))
        return seen

    def _image_names(self) -> Iterator[str]:
        """Yield the images in which the property asks a goal."""
        yield from dict.fromkeys(name.split(":")[0] for name, _ in sorted(self._called()) if ":" in name)

    def _images(self, scene: Scene) -> Iterator[tuple[str, Scene]]:
        """Yield the scenes that the facts of the images describe."""
        for image in self._image_names():
            vehicles = self._rows(f"{image}:vehicle", 8) or [scene.ego, *scene.in_range()]
            lanes, ends = self._rows(f"{image}:road_lane", 5), self._rows(f"{image}:lane_end", 2)
            road = scene.road if not lanes else _road(scene.road, lanes)
            if ends:
                road = _with_ends(road, dict(ends))
            ego, *others = [Vehicle(*row) for row in vehicles]
            yield image, Scene(road, ego, tuple(others), scene.target_lane)

    def _rows(self, name: str, arity: int) -> list[tuple[Any, ...]]:
        if not self._engine.defines(name, arity):
            return []
        variables = [f"A{place}" for place in range(arity)]
        goal = f"'{name}'({', '.join(variables)})"
        return [
            tuple(_plain(solution[variable]) for variable in variables)
            for solution in self._engine.query(goal, limits=LIMITS)
        ]


def _plain(value: object) -> object:
    return value if isinstance(value, int | float) else str(value)


def _road(road: Road, rows: Sequence[tuple[Any, ...]]) -> Road:
    ends = {lane.id: lane.end for lane in road.lanes}
    lanes = [
        Lane(lane, Direction(way), centre, width, limit, ends.get(lane))
        for lane, way, centre, width, limit in rows
    ]
    return replace(road, lanes=tuple(sorted(lanes, key=lambda lane: lane.centre)))


def _with_ends(road: Road, ends: Mapping[int, float]) -> Road:
    return replace(road, lanes=tuple(replace(lane, end=ends.get(lane.id)) for lane in road.lanes))


def _rounded(scene: Scene, digits: int | None) -> Scene:
    """Return the scene with its numbers rounded; lanes still touch, and lane ids are unchanged."""
    if digits is None:
        return scene

    def short(value: float) -> float:
        return round(value, digits)

    def vehicle(car: Vehicle) -> Vehicle:
        return Vehicle(car.id, car.lane, *map(short, car[2:]))

    lanes = []
    edge, before = 0.0, None
    for lane in scene.road.lanes:
        width = round(lane.width, digits)
        top = lane.centre - lane.width / 2
        edge = short(top) if before is None or before.direction is not lane.direction else edge
        lanes.append(
            replace(
                lane,
                centre=edge + width / 2,
                width=width,
                speed_limit=short(lane.speed_limit),
                end=None if lane.end is None else short(lane.end),
            )
        )
        edge, before = edge + width, lane
    road = replace(
        scene.road,
        lanes=tuple(lanes),
        time_step=round(scene.road.time_step, max(2, digits)),
        radar_range=short(scene.road.radar_range),
    )
    return replace(scene, road=road, ego=vehicle(scene.ego), vehicles=tuple(map(vehicle, scene.vehicles)))


def _shortened(
    unknowns: Mapping[str, float], digits: int | None, symbolic: SymbolicScene
) -> dict[str, float]:
    """Return the unknown numbers rounded, each within its range."""
    if digits is None:
        return dict(unknowns)
    result = {}
    for name, value in unknowns.items():
        low, high = map(float, symbolic.ranges[name])
        result[name] = min(high, max(low, round(value, digits)))
    return result


def _ranges_hold(scene: Scene, symbolic: SymbolicScene) -> bool:
    """Return whether a rounded scene is still within the property's ranges."""
    ranges = symbolic.ranges

    def within(name: str, value: float) -> bool:
        low, high = ranges[name]
        return low - Fraction(1, 10**9) <= value <= high + Fraction(1, 10**9)

    road, cars = scene.road, (scene.ego, *scene.vehicles)
    sign = symbolic.case.direction(symbolic.case.ego_lane).sign
    lanes = [
        within("lane_width", lane.width)
        and within("speed_limit", lane.speed_limit)
        and (lane.end is None or within("end_ahead", sign * (lane.end - scene.ego.x)))
        for lane in road.lanes
    ]
    boxes = [
        within("length", car.length)
        and within("width", car.width)
        and within("ego_speed" if car is scene.ego else "speed", sign * car.vx)
        and within("lateral_speed", sign * car.vy)
        and _is_in_lane(road, car)
        for car in cars
    ]
    return (
        all([*lanes, *boxes])
        and within("time_step", road.time_step)
        and within("radar_range", road.radar_range)
        and len(scene.in_range()) == len(scene.vehicles)
    )


def _is_in_lane(road: Road, car: Vehicle) -> bool:
    lane = road.lane(car.lane)
    return lane is None or abs(car.y - lane.centre) <= lane.width / 2 + 1e-9
