"""A known scene with some numbers open: formulas of the rules for other places and speeds of vehicles."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Final, Literal, TypeAlias

from drlsl.driving.scene import SCHEMA, Road, Scene, Vehicle, facts_of
from drlsl.logic.terms import Atom
from drlsl.lowering.ir import Node
from drlsl.verify import RANGES, decimal
from drlsl.verify.smt import (
    Algebra,
    Bool,
    Finite,
    Formula,
    NotTranslatable,
    Polynomial,
    Row,
    Solver,
    Value,
    leaves,
)

Quantity: TypeAlias = Literal["x", "vx"]

BEYOND: Final = Fraction(1)
"""Distance out of radar range to which a vehicle may be moved [m]: farther makes no difference."""


class GaveUp(Exception):
    """The solver did not decide; the message gives the reason."""


@dataclass(frozen=True, slots=True)
class Lever:
    """A number that may change: an amount of 1 adds `sign`; the amount is between `low` and `high`."""

    vehicle: str
    quantity: Quantity
    sign: int
    low: Fraction
    high: Fraction


def place_lever(scene: Scene, car: Vehicle) -> Lever:
    """Return the lever of a vehicle's x [m], forward for the ego, up to just out of radar range."""
    sign, offset = _offset(scene, car)
    reach = decimal(scene.road.radar_range) + BEYOND
    return Lever(car.id, "x", sign, -reach - offset, reach - offset)


def place_lever_on_its_side(scene: Scene, car: Vehicle) -> Lever:
    """Return the same lever for a vehicle that does not pass the ego: its centre stays ahead or behind."""
    lever = place_lever(scene, car)
    _, offset = _offset(scene, car)
    if offset > 0:
        return replace(lever, low=-offset)
    return replace(lever, high=-offset) if offset < 0 else lever


def speed_lever(scene: Scene, car: Vehicle) -> Lever:
    """Return the lever of a vehicle's speed in its direction [m/s], from 0 to the highest of `RANGES`."""
    sign = _heading(car, scene.road, _heading(scene.ego, scene.road, 1))
    speed = sign * decimal(car.vx)
    _, highest = RANGES["ego_speed" if car is scene.ego else "speed"]
    return Lever(car.id, "vx", sign, -speed, max(Fraction(0), highest - speed))


def changed(scene: Scene, levers: Sequence[Lever], amounts: Sequence[Fraction]) -> Scene:
    """Return the scene with its levers moved by these amounts."""
    cars = {car.id: car for car in (scene.ego, *scene.vehicles)}
    for lever, amount in zip(levers, amounts, strict=True):
        car = cars[lever.vehicle]
        number = float(decimal(getattr(car, lever.quantity)) + lever.sign * amount)
        cars[car.id] = car._replace(x=number) if lever.quantity == "x" else car._replace(vx=number)
    return replace(scene, ego=cars[scene.ego.id], vehicles=tuple(cars[car.id] for car in scene.vehicles))


def _offset(scene: Scene, car: Vehicle) -> tuple[int, Fraction]:
    """Return the sign of x that is forward for the ego, and how far a vehicle is ahead of it [m]."""
    return scene.forward, scene.forward * (decimal(car.x) - decimal(scene.ego.x))


def _heading(car: Vehicle, road: Road, otherwise: int) -> int:
    """Return the sign of a vehicle's direction along x: by its motion or, at standstill, by its lane."""
    if car.vx:
        return 1 if car.vx > 0 else -1
    lane = road.lane(car.lane)
    return lane.direction.sign if lane is not None else otherwise


@dataclass(slots=True)
class _Frame:
    """The solver's constraints besides a question: only the algebra's own definitions."""

    algebra: Algebra
    always: list[Bool] = field(default_factory=list)
    about: dict[str, list[Bool]] = field(default_factory=dict)
    usual: dict[int, tuple[int, Fraction]] = field(default_factory=dict)

    def tidy(self) -> list[Bool]:
        """Return no constraints: the scene is known."""
        return []


class OpenScene:
    """A scene in which every lever is open at once, so that rules become formulas only once."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.algebra = Algebra()
        frame = _Frame(self.algebra)
        self._solvers = {few: Solver(frame, linear=False, few=few) for few in (True, False)}
        self._cars = [scene.ego, *scene.vehicles]
        cars = scene.in_range()
        levers = [
            *(place_lever(scene, car) for car in cars),
            *(speed_lever(scene, car) for car in (scene.ego, *cars)),
        ]
        ring = self.algebra.ring
        self._changes = {
            (lever.vehicle, lever.quantity): ring.unknown(
                f"{lever.quantity} of {lever.vehicle}", lever.low, lever.high
            )
            for lever in levers
        }
        self._levers = len(levers)
        self._numbers = {
            (lever.vehicle, lever.quantity): self.moved(lever, self.change(lever)) for lever in levers
        }
        self._formula = Formula(self.algebra, self._facts())

    def solver(self, levers: int) -> Solver:
        """Return the solver for questions about that number of levers."""
        return self._solvers[levers == 1]

    def change(self, lever: Lever) -> Polynomial:
        """Return the unknown of a lever's change."""
        return self._changes[lever.vehicle, lever.quantity]

    def moved(self, lever: Lever, change: Polynomial) -> Polynomial:
        """Return a lever's number, moved by `change`."""
        ring = self.algebra.ring
        car = next(car for car in self._cars if car.id == lever.vehicle)
        before = self.algebra.number(getattr(car, lever.quantity))
        return ring.add(before, ring.scale(change, Fraction(lever.sign)))

    def truth(self, node: Node) -> Bool:
        """Return the formula of a condition of the rules, for all levers."""
        return self._formula.truth(node)

    def _facts(self) -> dict[tuple[str, int], list[Row]]:
        facts = facts_of(self.scene)
        result = {}
        for key, relation in SCHEMA.relations.items():
            result[key] = [self._row(relation.columns, row) for row in facts[key]]
        vehicles = [self.scene.ego, *self.scene.in_range()]
        pairs = zip(vehicles, result["vehicle", 8], strict=True)
        result["vehicle", 8] = [self._open_row(car, row) for car, row in pairs]
        return result

    def _row(self, kinds: Sequence[str], row: Sequence[str | int | float]) -> Row:
        true = self.algebra.booleans.true

        def column(kind: str, value: str | int | float) -> Value | Finite:
            if kind == "atom":
                return {Atom(str(value)): true}
            return {int(value): true} if kind == "int" else self.algebra.number(float(value))

        return Row(true, tuple(map(column, kinds, row)))

    def _open_row(self, car: Vehicle, row: Row) -> Row:
        """Return a vehicle's row with its levers open; the row holds while it is in radar range."""
        columns = list(row.columns)
        columns[Vehicle._fields.index("vx")] = self._numbers[car.id, "vx"]
        if car is self.scene.ego:
            return Row(row.present, tuple(columns))
        columns[Vehicle._fields.index("x")] = self._numbers[car.id, "x"]
        return Row(self._is_seen(car), tuple(columns))

    def _is_seen(self, car: Vehicle) -> Bool:
        algebra, ring, ego = self.algebra, self.algebra.ring, self.scene.ego
        dx = ring.subtract(self._numbers[car.id, "x"], algebra.number(ego.x))
        dy = ring.const(decimal(car.y) - decimal(ego.y))
        reach = algebra.number(self.scene.road.radar_range)
        distance = ring.add(ring.multiply(dx, dx), ring.multiply(dy, dy))
        return algebra.at_least(ring.multiply(reach, reach), distance)

    def only(self, truth: Bool, levers: Sequence[Lever]) -> Bool:
        """Return a formula with all levers but these left unchanged."""
        algebra = self.algebra
        kept = {self.change(lever).only_unknown for lever in levers}
        result = _Restriction(algebra, {n for n in range(self._levers) if n not in kept}).of(truth)
        compared = [leaf for leaf in leaves([result]) if leaf.op != "flag"]
        if any(unknown >= self._levers for leaf in compared for unknown in leaf.data.unknowns):
            # a root or quotient that is an unknown of its own is defined for all levers
            still = [
                algebra.equal(change, algebra.zero)
                for change in self._changes.values()
                if change.only_unknown not in kept
            ]
            return algebra.booleans.and_([result, *still])
        return result

    def apart(self, numbers: Mapping[tuple[str, Quantity], Polynomial]) -> Bool:
        """Return the condition that moved vehicles touch none but those that they touch in the scene."""
        algebra, ring = self.algebra, self.algebra.ring
        parts = []
        for one, other in self._pairs({vehicle for vehicle, quantity in numbers if quantity == "x"}):
            here, there = (numbers.get((car.id, "x")) or algebra.number(car.x) for car in (one, other))
            room = ring.const((decimal(one.length) + decimal(other.length)) / 2)
            sides = (ring.subtract(here, there), ring.subtract(there, here))
            parts.append(algebra.booleans.or_(algebra.less(room, side) for side in sides))
        return algebra.booleans.and_(parts)

    def _pairs(self, movable: set[str]) -> Iterator[tuple[Vehicle, Vehicle]]:
        """Yield pairs of vehicles that do not touch, but may when some move along the road."""
        for number, one in enumerate(self._cars):
            for other in self._cars[number + 1 :]:
                if one.id in movable or other.id in movable:
                    length = decimal(one.length) + decimal(other.length)
                    width = decimal(one.width) + decimal(other.width)
                    across = abs(decimal(one.y) - decimal(other.y)) <= width / 2
                    if across and abs(decimal(one.x) - decimal(other.x)) > length / 2:
                        yield one, other


class _Restriction:
    """Formulas with some unknowns set to 0."""

    def __init__(self, algebra: Algebra, gone: set[int]) -> None:
        self._algebra = algebra
        self._gone = gone
        self._done: dict[Bool, Bool] = {}

    def of(self, truth: Bool) -> Bool:
        """Return the remaining formula."""
        if truth not in self._done:
            self._done[truth] = self._make(truth)
        return self._done[truth]

    def _make(self, truth: Bool) -> Bool:
        algebra, booleans = self._algebra, self._algebra.booleans
        if truth.op == "not":
            return booleans.not_(self.of(truth.args[0]))
        if truth.op in ("and", "or"):
            # parts behind the deciding one are skipped
            dominant = booleans.const(truth.op == "or")
            parts = []
            for arg in truth.args:
                parts.append(self.of(arg))
                if parts[-1] is dominant:
                    return dominant
            return booleans.and_(parts) if truth.op == "and" else booleans.or_(parts)
        if truth.op in ("true", "false", "flag"):
            return truth
        left = self._polynomial(truth.data)
        if truth.op == "zero":
            return algebra.equal(left, algebra.zero)
        return algebra.above(left) if truth.op == "above" else algebra.at_least(left, algebra.zero)

    def _polynomial(self, polynomial: Polynomial) -> Polynomial:
        kept = {}
        for monomial, factor in polynomial.terms.items():
            powers = [power for unknown, power in monomial if unknown in self._gone]
            if any(power < 0 for power in powers):
                raise NotTranslatable("a comparison holds a quotient by a changing number")
            if not powers:
                kept[monomial] = factor
        return self._algebra.ring.make(kept)


class Question:
    """The search for the smallest amounts of some levers for which a formula holds."""

    def __init__(self, scene: OpenScene, truth: Bool, levers: Sequence[Lever]) -> None:
        algebra = scene.algebra
        self.levers = levers
        self._scene = scene
        self._changes = [scene.change(lever) for lever in levers]
        # a sum of amounts has as many cases as signs; with a bound on each amount it has one
        self._sizes = [
            algebra.ring.unknown(f"size of {lever.vehicle}", 0, max(-lever.low, lever.high))
            for lever in levers
        ]
        within = [
            side
            for lever, change in zip(levers, self._changes, strict=True)
            for side in (
                algebra.at_least(change, algebra.ring.const(lever.low)),
                algebra.at_least(algebra.ring.const(lever.high), change),
            )
        ]
        left = scene.only(truth, levers)
        self._truth = algebra.booleans.and_([left, *within])
        if left is not algebra.booleans.false:
            self._truth = algebra.booleans.and_((self._truth, scene.apart(self._places(self._changes))))

    def _places(self, changes: Sequence[Polynomial]) -> dict[tuple[str, Quantity], Polynomial]:
        pairs = zip(self.levers, changes, strict=True)
        return {(lever.vehicle, lever.quantity): self._scene.moved(lever, change) for lever, change in pairs}

    def amounts(self, most: Fraction, deadline: float) -> list[Fraction] | None:
        """Return amounts for which the formula holds, with a sum of at most `most`; None if there are none.

        Raises:
            GaveUp: the solver does not know, or has no time left.
        """
        if self._truth.op == "false":
            return None
        left = deadline - time.perf_counter()
        if left <= 0:
            raise GaveUp("the time limit")
        algebra = self._scene.algebra
        asked = algebra.booleans.and_((self._truth, self._within(most)))
        outcome = self._scene.solver(len(self.levers)).holds_nowhere(asked, left)
        if outcome.verdict == "unknown":
            timed_out = outcome.reason in ("timeout", "canceled")
            raise GaveUp("the time limit" if timed_out else f"the solver gave up: {outcome.reason}")
        if outcome.model is None:
            return None
        return [outcome.model.numbers.get(change.only_unknown, Fraction(0)) for change in self._changes]

    def _within(self, most: Fraction) -> Bool:
        """Return the condition that the amounts add up to at most `most`, whatever their signs."""
        algebra, ring = self._scene.algebra, self._scene.algebra.ring
        total = algebra.zero
        parts = []
        for size, change in zip(self._sizes, self._changes, strict=True):
            parts += [algebra.at_least(size, change), algebra.at_least(size, algebra.negate(change))]
            total = ring.add(total, size)
        return algebra.booleans.and_([*parts, algebra.at_least(ring.const(most), total)])

    def allows(self, amounts: Sequence[Fraction]) -> bool:
        """Return whether the levers allow these amounts."""
        within = all(
            lever.low <= amount <= lever.high for lever, amount in zip(self.levers, amounts, strict=True)
        )
        places = self._places([self._scene.algebra.ring.const(amount) for amount in amounts])
        return within and self._scene.apart(places) is self._scene.algebra.booleans.true
