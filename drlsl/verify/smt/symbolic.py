"""An unknown scene: every number an unknown within its range, every lane and presence open."""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Final

from gmpy2 import mpq

from drlsl.driving.scene import EGO, EGO_LIMITS, Road, Scene, Vehicle
from drlsl.logic.terms import Atom
from drlsl.lowering.ir import Relation
from drlsl.traffic import Lane
from drlsl.verify.ranges import TYPICAL, Case, Range
from drlsl.verify.smt.booleans import Bool, holds
from drlsl.verify.smt.formula import Constant, Finite, Row
from drlsl.verify.smt.polynomials import Polynomial, evaluate
from drlsl.verify.smt.values import Algebra, Value

FOCUS: Final = Relation("focus", ("atom",), single=True, fields=("id",))
"""The vehicle, any one, that `focus/1` names in properties."""

NOBODY: Final = "none"
"""The name in `focus/1` if no vehicle is in focus."""

_HALF: Final = mpq(1, 2)


@dataclass(slots=True)
class Box:
    """The unknowns of one vehicle; `dx` [m] counts from the ego."""

    name: str
    id: Finite
    present: Bool
    dx: Polynomial
    y: Polynomial
    vx: Polynomial
    vy: Polynomial
    length: Polynomial
    width: Polynomial
    lane: Finite


@dataclass(slots=True)
class Model:
    """A solver's model: numbers by unknown, truth by flag; None if the solver left it open."""

    numbers: Mapping[int, Fraction]
    flags: Mapping[str, bool]


class SymbolicScene:
    """The scenes of one case with a number of vehicles besides the ego.

    `facts` are the rows of all relations. `always` holds in every scene; `about` is the part of it that
    mentions a flag, by the flag's name. `usual` gives unknowns the value that a counterexample should have,
    with 1, or 2 for a speed. `unknowns` name facts of one number each that a property uses besides the scene.
    Each vehicle may have one of `names`, or else one of its own. With `ends` each lane may end.
    """

    def __init__(
        self,
        algebra: Algebra,
        case: Case,
        ranges: Mapping[str, Range],
        vehicles: int,
        unknowns: Sequence[str] = (),
        names: Iterable[Atom] = (),
        *,
        ends: bool = False,
    ) -> None:
        self.algebra = algebra
        self.case = case
        self.ranges = ranges
        self.vehicles = vehicles
        self.unknowns = unknowns
        self.names = sorted(names, key=lambda atom: atom.name)
        self.facts: dict[tuple[str, int], list[Row]] = {}
        self.always: list[Bool] = []
        self.about: dict[str, list[Bool]] = {}
        self.usual: dict[int, tuple[int, Fraction]] = {}
        self._numbers: dict[str, Polynomial] = {}
        self._ends: dict[int, Row] = {}
        self._lanes()
        self._ego = self._ego_box()
        own = (f"v{number}" for number in itertools.count(1) if Atom(f"v{number}") not in self.names)
        self._boxes = [self._vehicle_box(name) for name in itertools.islice(own, self.vehicles)]
        self._name_boxes()
        self._order()
        self._facts(ends=ends)

    def _unknown(self, kind: str, name: str, bounds: Range | None = None) -> Polynomial:
        """Return a number of that kind, within its range."""
        low, high = bounds or self.ranges[kind]
        ring = self.algebra.ring
        made = ring.const(low) if low == high else ring.unknown(name, low, high)
        value = TYPICAL.get(kind)
        if low != high and value is not None:
            level = 2 if kind in ("ego_speed", "speed") else 1
            self.usual[len(ring.unknowns) - 1] = (level, min(high, max(low, value)))
        self._numbers[name] = made
        return made

    def _lanes(self) -> None:
        """Make lanes that touch, counted from the ego's to both sides."""
        ring, case = self.algebra.ring, self.case
        numbers = range(1, case.lanes + 1)
        widths = {lane: self._unknown("lane_width", f"width_of_lane_{lane}") for lane in _outward(case)}
        offsets = {case.ego_lane: self.algebra.zero}
        for lane in _outward(case)[1:]:
            inner = lane + (1 if lane < case.ego_lane else -1)
            step = ring.scale(ring.add(widths[lane], widths[inner]), _HALF)
            if case.direction(lane) is not case.direction(inner):
                step = ring.add(step, self._unknown("median", "median"))
            away = mpq(-1 if lane < case.ego_lane else 1)
            offsets[lane] = ring.add(offsets[inner], ring.scale(step, away))
        middle = self._unknown("road_position", "y_of_ego_lane")
        self.widths = [widths[lane] for lane in numbers]
        self.centres = [ring.add(middle, offsets[lane]) for lane in numbers]
        limits = {lane: self._unknown("speed_limit", f"limit_of_lane_{lane}") for lane in _outward(case)}
        self.limits = [limits[lane] for lane in numbers]

    def _finite_lane(self, name: str, lanes: Sequence[int]) -> Finite:
        """Return one of several lanes."""
        booleans = self.algebra.booleans
        if len(lanes) == 1:
            return {lanes[0]: booleans.true}
        flags: Finite = {lane: booleans.flag(f"{name}_{lane}") for lane in lanes}
        some = booleans.or_(flags.values())
        pairs = [(one, other) for one in lanes for other in lanes if one < other]
        exclusive = [booleans.not_(booleans.and_((flags[one], flags[other]))) for one, other in pairs]
        self._require([some, *exclusive], flags.values())
        return flags

    def _require(self, truths: Sequence[Bool], flags: Iterable[Bool] = ()) -> None:
        self.always.extend(truths)
        for flag in flags:
            self.about.setdefault(flag.data, []).extend(truths)

    def _ego_box(self) -> Box:
        algebra, ring = self.algebra, self.algebra.ring
        lane = self.case.ego_lane
        half = self.ranges["lane_width"][1] / 2
        aside = self._unknown("aside", "ego_aside", (-half, half))
        width = self.widths[lane - 1]
        for turned in (aside, ring.scale(aside, mpq(-1))):
            self.always.append(algebra.at_least(ring.scale(width, _HALF), turned))
        return Box(
            name=EGO,
            id={Atom(EGO): algebra.booleans.true},
            present=algebra.booleans.true,
            dx=algebra.zero,
            y=ring.add(self.centres[lane - 1], self._forward(aside)),
            vx=self._forward(self._unknown("ego_speed", "ego_speed")),
            vy=self._forward(self._unknown("lateral_speed", "ego_sideways")),
            length=self._unknown("length", "ego_length"),
            width=self._unknown("width", "ego_width"),
            lane={lane: algebra.booleans.true},
        )

    def _vehicle_box(self, name: str) -> Box:
        ring = self.algebra.ring
        reach = self.ranges["radar_range"][1]
        aside = reach + self.ranges["lane_width"][1]
        box = Box(
            name=name,
            id={},
            present=self.algebra.booleans.flag(f"{name}_present"),
            dx=self._forward(self._unknown("ahead", f"{name}_ahead", (-reach, reach))),
            y=ring.add(
                self.centres[self.case.ego_lane - 1],
                self._forward(self._unknown("to_the_right", f"{name}_to_the_right", (-aside, aside))),
            ),
            vx=self._forward(self._unknown("speed", f"{name}_speed")),
            vy=self._forward(self._unknown("lateral_speed", f"{name}_sideways")),
            length=self._unknown("length", f"{name}_length"),
            width=self._unknown("width", f"{name}_width"),
            lane={},
        )
        box.lane = self._finite_lane(f"{name}_lane", range(self.case.lanes + 1))
        self._in_its_lane(box)
        return box

    def _forward(self, polynomial: Polynomial) -> Polynomial:
        """Return a driver's forward or rightward amount in coordinates of the road."""
        return self.algebra.ring.scale(polynomial, mpq(self.case.direction(self.case.ego_lane).sign))

    def _in_its_lane(self, box: Box) -> None:
        """Demand that a vehicle's lane is the one that holds its centre; 0 for none."""
        algebra, ring = self.algebra, self.algebra.ring
        booleans = algebra.booleans
        outside = []
        for lane, (centre, width) in enumerate(zip(self.centres, self.widths, strict=True), start=1):
            half = ring.scale(width, _HALF)
            low, high = ring.subtract(centre, half), ring.add(centre, half)
            inside = booleans.and_((algebra.at_least(box.y, low), algebra.at_least(high, box.y)))
            flag = box.lane[lane]
            self._require([booleans.implies(flag, inside)], [flag])
            outside.append(booleans.not_(inside))
        flag = box.lane[0]
        self._require([booleans.implies(flag, booleans.and_(outside))], [flag])

    def _name_boxes(self) -> None:
        """Demand that a vehicle has at most one of the names, and no two have the same."""
        booleans = self.algebra.booleans
        flags = {
            (box.name, atom): booleans.flag(f"{box.name}_is_{atom.name}")
            for box in self._boxes
            for atom in self.names
        }
        for (own, atom), flag in flags.items():
            others = [beside for (one, other), beside in flags.items() if (one == own) is not (other == atom)]
            self._require([booleans.not_(booleans.and_((flag, other))) for other in others], [flag])
        for box in self._boxes:
            named: Finite = {atom: flags[box.name, atom] for atom in self.names}
            box.id = {Atom(box.name): booleans.not_(booleans.or_(named.values())), **named}

    def _order(self) -> None:
        """Demand that the existing vehicles come first and are in radar range."""
        algebra, ring, booleans = self.algebra, self.algebra.ring, self.algebra.booleans
        radar = self._unknown("radar_range", "radar_range")
        for before, box in zip([None, *self._boxes], self._boxes, strict=False):
            if before is not None:
                self._require([booleans.implies(box.present, before.present)], [box.present])
            dy = ring.subtract(self._ego.y, box.y)
            distance = ring.add(ring.multiply(box.dx, box.dx), ring.multiply(dy, dy))
            near = algebra.at_least(ring.multiply(radar, radar), distance)
            self.always.append(near)
            # an absent one may be anywhere, so all may be assumed to be in range
            algebra.assume(near)

    def _facts(self, *, ends: bool) -> None:
        algebra, booleans = self.algebra, self.algebra.booleans
        true = booleans.true
        lanes = range(1, self.case.lanes + 1)
        x = self._unknown("position", "ego_x")
        target: Finite = {self.case.target_lane: true}
        focus = self._focus()

        def number(name: str, value: Polynomial) -> None:
            self.facts[name, 1] = [Row(true, (value,))]

        self.facts["vehicle", 8] = [self._row(box, x) for box in (self._ego, *self._boxes)]
        self.facts["road_lane", 5] = [
            Row(
                true,
                (
                    {lane: true},
                    {Atom(self.case.direction(lane).value): true},
                    self.centres[lane - 1],
                    self.widths[lane - 1],
                    self.limits[lane - 1],
                ),
            )
            for lane in lanes
        ]
        if ends:
            self._ends = {lane: self._end_row(lane, x) for lane in lanes}
        self.facts["lane_end", 2] = list(self._ends.values())
        self.facts["target_lane", 1] = [Row(true, (target,))]
        self.facts["focus", 1] = [Row(true, (focus,))]
        number("time_step", self._unknown("time_step", "time_step"))
        number("radar_range", self._numbers["radar_range"])
        for name, limit in EGO_LIMITS.items():
            number(name, algebra.number(limit))
        for name in self.unknowns:
            number(name, self._unknown(name, name))
        self._focused = focus

    def _row(self, box: Box, x: Polynomial) -> Row:
        ring = self.algebra.ring
        place = ring.add(x, box.dx)
        return Row(box.present, (box.id, box.lane, place, box.y, box.vx, box.vy, box.length, box.width))

    def _end_row(self, lane: int, x: Polynomial) -> Row:
        """Return the row of a lane's end, which holds if it ends."""
        booleans = self.algebra.booleans
        ahead = self._forward(self._unknown("end_ahead", f"end_of_lane_{lane}"))
        place = self.algebra.ring.add(x, ahead)
        return Row(booleans.flag(f"lane_{lane}_ends"), ({lane: booleans.true}, place))

    def _focus(self) -> Finite:
        """Return the name of one existing vehicle, or `none`."""
        booleans = self.algebra.booleans
        flags = [booleans.flag(f"focus_{box.name}") for box in self._boxes]
        pairs = [(one, other) for one in flags for other in flags if one.number < other.number]
        exclusive = [booleans.not_(booleans.and_(pair)) for pair in pairs]
        there = [booleans.implies(flag, box.present) for flag, box in zip(flags, self._boxes, strict=True)]
        self._require([*exclusive, *there], flags)
        parts: dict[Constant, list[Bool]] = {Atom(NOBODY): [booleans.not_(booleans.or_(flags))]}
        for flag, box in zip(flags, self._boxes, strict=True):
            for constant, own in box.id.items():
                parts.setdefault(constant, []).append(booleans.and_((flag, own)))
        return {constant: booleans.or_(conds) for constant, conds in parts.items()}

    def tidy(self) -> list[Bool]:
        """Return the conditions of a tidy counterexample: vehicles are in a lane and do not overlap."""
        algebra, ring, booleans = self.algebra, self.algebra.ring, self.algebra.booleans
        boxes = [self._ego, *self._boxes]
        result = []
        for number, one in enumerate(boxes):
            for other in boxes[number + 1 :]:
                along = ring.scale(ring.add(one.length, other.length), _HALF)
                across = ring.scale(ring.add(one.width, other.width), _HALF)
                dx, dy = ring.subtract(one.dx, other.dx), ring.subtract(one.y, other.y)
                clear = [
                    algebra.at_least(difference, room)
                    for distance, room in ((dx, along), (dy, across))
                    for difference in (distance, ring.scale(distance, mpq(-1)))
                ]
                both = booleans.and_((one.present, other.present))
                result.append(booleans.implies(both, booleans.or_(clear)))
        return [*result, *(booleans.not_(box.lane[0]) for box in self._boxes)]

    def scene(self, model: Model) -> tuple[Scene, str]:
        """Return the scene that a model describes, and the name of the vehicle in focus, or `NOBODY`."""
        flags = defaultdict(bool, model.flags)

        def number(value: Value | Finite) -> float:
            assert isinstance(value, Polynomial)
            return float(evaluate(value, model.numbers))

        def chosen(value: Value | Finite) -> str | int:
            assert isinstance(value, dict)
            found = next(constant for constant, flag in value.items() if holds(flag, {}, flags))
            return found.name if isinstance(found, Atom) else found

        def vehicle(row: Row) -> Vehicle:
            name, lane, *numbers = row.columns
            return Vehicle(str(chosen(name)), int(chosen(lane)), *map(number, numbers))

        def end(lane: int) -> float | None:
            row = self._ends.get(lane)
            return number(row.columns[1]) if row is not None and holds(row.present, {}, flags) else None

        lanes = tuple(
            Lane(lane, self.case.direction(lane), number(centre), number(width), number(limit), end(lane))
            for lane, (centre, width, limit) in enumerate(
                zip(self.centres, self.widths, self.limits, strict=True), start=1
            )
        )
        road = Road(
            lanes=lanes,
            time_step=number(self._numbers["time_step"]),
            radar_range=number(self._numbers["radar_range"]),
        )
        ego, *others = [vehicle(row) for row in self.facts["vehicle", 8] if holds(row.present, {}, flags)]
        scene = Scene(road=road, ego=ego, vehicles=tuple(others), target_lane=self.case.target_lane)
        return scene, str(chosen(self._focused))

    def unknown_values(self, model: Model) -> dict[str, float]:
        """Return a model's values of the property's further numbers."""
        return {name: float(evaluate(self._numbers[name], model.numbers)) for name in self.unknowns}


def _outward(case: Case) -> list[int]:
    """Return the lanes from the ego's on: those to its right by their distance, then those to its left."""
    up, down = list(range(case.ego_lane - 1, 0, -1)), list(range(case.ego_lane + 1, case.lanes + 1))
    right, left = (down, up) if case.direction(case.ego_lane).sign > 0 else (up, down)
    return [case.ego_lane, *right, *left]
