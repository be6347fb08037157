"""What would have to be different for an action to be offered, or not to be: the least change of a scene.

One quantity of one vehicle is left open at a time, its place along the road or its speed, or the ego's speed;
all else is as it is in the scene. The lowered rules, the same that `drlsl rules verify` proves properties of,
then are a formula in one unknown, and the solver narrows down the least change that fulfils it. What is
reported is a round number just beyond, in which the interpreter has confirmed the other decision.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, Final, Literal, TypeAlias

from drlsl.counterfactual.levers import (
    GaveUp,
    Lever,
    OpenScene,
    Quantity,
    Question,
    changed,
    place_lever,
    place_lever_on_its_side,
    speed_lever,
)
from drlsl.driving.scene import SCHEMA, Action, Scene, Vehicle, action_of_atom, road_facts, scene_facts
from drlsl.driving.shield import RuleFailure, Shield
from drlsl.errors import UserError
from drlsl.logic.terms import Atom
from drlsl.lowering.backends import Scalar, compile_scalar
from drlsl.lowering.frontend import Answer as LoweredAnswer
from drlsl.lowering.frontend import Query, deep_recursion, lower
from drlsl.lowering.ir import Node, NotLowerable, Undecided
from drlsl.verify.smt import Bool, NotTranslatable

Status: TypeAlias = Literal["found", "none", "unknown"]

PRECISION: Final = Fraction(1, 10**6)
"""How narrowly the least change is closed in [m or m/s]."""

TIME_LIMIT: Final = 10.0
"""Seconds for one action, if not said otherwise."""

_OVERSHOOT: Final = Fraction(1, 20)
"""A change is rounded to so few decimals that it is at most this share above the least."""

_DIGITS: Final = (1, 2, 3, 4, 6, 9)
_COARSE: Final = 3
"""From so many decimals on the overshoot does not matter."""


@dataclass(frozen=True, slots=True)
class Change:
    """One vehicle at another place along the road (`x`), or at another speed (`vx`).

    `change` counts forward for the ego [m], or faster in the vehicle's own direction [m/s]; `before` and
    `after` are its x [m] or vx [m/s]; `out_of_sight`: it leaves the radar range.
    """

    vehicle: str
    quantity: Quantity
    change: float
    before: float
    after: float
    out_of_sight: bool

    def as_json(self) -> dict[str, Any]:
        """The change, with the field of a scene file that it is a change of."""
        return {
            "vehicle": self.vehicle,
            "field": "x_m" if self.quantity == "x" else "vx_mps",
            "change": self.change,
            "before": self.before,
            "after": self.after,
            "out_of_sight": self.out_of_sight,
        }


@dataclass(frozen=True, slots=True)
class Finding:
    """The least change of one kind: `found`, `none` at all, or `unknown` for a reason.

    `changes` are confirmed: the interpreter decides otherwise in `scene`, which has them. `least` [m or m/s]
    is what the sum of the changes' amounts cannot be below; the changes are as little above it as rounding
    makes them. With `found` a `reason` says what is not known of lesser changes: that the search for them was
    broken off, or that the rules may raise an error there.
    """

    status: Status
    changes: tuple[Change, ...] = ()
    least: float | None = None
    scene: Scene | None = None
    reason: str = ""

    def as_json(self) -> dict[str, Any]:
        """All but the scene."""
        return {
            "status": self.status,
            "changes": [change.as_json() for change in self.changes],
            "least": self.least,
            "reason": self.reason,
        }


@dataclass(frozen=True, slots=True)
class Answer:
    """What would have to change for an action that is offered not to be, or for another to be offered.

    `gap` is one vehicle elsewhere along the road, `speed` one at another speed, `ego_speed` the ego at
    another speed. `gap_without_passing`, asked where `gap` takes a vehicle past the ego, is one that stays in
    front or behind. `gaps`, asked where an action is not offered and no single vehicle's place would change
    that, is several vehicles elsewhere, by the least sum of metres. What is not asked is None.
    """

    action: Action
    offered: bool
    gap: Finding
    gap_without_passing: Finding | None
    speed: Finding
    ego_speed: Finding
    gaps: Finding | None

    def findings(self) -> dict[str, Finding | None]:
        """What was found, by kind."""
        return {
            "gap": self.gap,
            "gap_without_passing": self.gap_without_passing,
            "speed": self.speed,
            "ego_speed": self.ego_speed,
            "gaps": self.gaps,
        }

    def as_json(self) -> dict[str, Any]:
        """The answer as JSON's values, with the same keys always."""
        found = self.findings().items()
        return {
            "offered": self.offered,
            **{kind: None if finding is None else finding.as_json() for kind, finding in found},
        }


def what_if(
    shield: Shield,
    scene: Scene,
    actions: Iterable[Action] = tuple(Action),
    *,
    time_limit: float = TIME_LIMIT,
) -> list[Answer]:
    """The least changes of `scene` for each action, each action in `time_limit` seconds.

    Vehicles in radar range change, one at a time. They keep their lane and y, and speeds their direction:
    from 0 to the highest of `RANGES`. Nobody is moved to where it touches a vehicle that it does not touch
    already, and nobody farther than out of radar range.

    Raises:
        UserError: the rules cannot be lowered, or offer an action that the agent does not know; or two
            vehicles have one name.
        RuleFailure: the rules give no usable answer in `scene`.
    """
    if len({scene.ego.id, *(car.id for car in scene.vehicles)}) <= len(scene.vehicles):
        raise UserError("two vehicles of the scene have one name; each needs one of its own")
    rules = _Rules.of(shield)
    offered = shield.decide(scene).safe_actions
    with deep_recursion():
        try:
            unknown = OpenScene(scene)
            return [
                _Search(rules, unknown, action, action in offered, time.perf_counter() + time_limit).answer()
                for action in actions
            ]
        except NotTranslatable as reason:
            raise UserError(f"a what-if needs rules that the solver can read: {reason}") from reason


@dataclass(frozen=True, slots=True)
class _Rules:
    """A rule program with its actions lowered: the condition of each, and a function that answers."""

    shield: Shield
    lowered: LoweredAnswer
    conditions: Mapping[Action, Node]
    scalar: Scalar

    @classmethod
    def of(cls, shield: Shield) -> _Rules:
        """Lower the rules of a shield; raises UserError where that cannot be."""
        try:
            lowered = lower(shield.engine, SCHEMA, [Query("safe_actions", 1, "all")])
        except NotLowerable as reason:
            raise UserError(f"a what-if needs rules that can be lowered: {reason}") from reason
        (answer,) = lowered.answers
        if answer.choices is None:
            raise UserError(
                "a what-if needs rules that can be lowered: the actions of safe_actions/1 must stand in the "
                "program, not be computed"
            )
        conditions = {
            action_of_atom(atom.name if isinstance(atom, Atom) else atom): condition
            for atom, condition in answer.choices
        }
        return cls(shield, answer, conditions, compile_scalar(lowered))

    def offers(self, scene: Scene, action: Action) -> bool:
        """Whether the rules offer an action, by generated code where it can tell.

        Raises:
            RuleFailure: the rules give no usable answer.
        """
        try:
            (atoms,) = self.scalar({**road_facts(scene.road), **scene_facts(scene)})
        except Undecided:
            return action in self.shield.decide(scene).safe_actions
        return action.atom in atoms


# ---------------------------------------------------------------- the search


@dataclass(frozen=True, slots=True)
class _Least:
    """Changes that a question asks for, and a sum of changes up to which there are none.

    The two are as close as the precision says, unless the search has `stopped` for a reason.
    """

    question: Question
    amounts: list[Fraction]
    low: Fraction
    stopped: str = ""

    @property
    def high(self) -> Fraction:
        """What the changes come to."""
        return sum(map(abs, self.amounts), Fraction(0))

    @property
    def least(self) -> float:
        """What no change is below, [m] or [m/s], with 6 decimals."""
        # other levers were only asked for changes that are smaller by more than the precision
        proved = self.low if self.stopped else max(Fraction(0), self.high - PRECISION)
        return round(math.floor(proved / PRECISION) * float(PRECISION), 6)


class _Search:
    """Looks for the least changes that make a decision about one action another."""

    def __init__(
        self, rules: _Rules, scene: OpenScene, action: Action, offered: bool, deadline: float
    ) -> None:
        self._rules = rules
        self._open = scene
        self._scene = scene.scene
        self._action = action
        self._offered = offered
        self._deadline = deadline
        booleans = scene.algebra.booleans
        condition = rules.conditions.get(action)
        found = booleans.false if condition is None else scene.truth(condition)
        self._undecided = scene.truth(rules.lowered.undecided)
        self._flipped = booleans.and_(
            (booleans.not_(found) if offered else found, booleans.not_(self._undecided))
        )

    def answer(self) -> Answer:
        """What was found."""
        scene = self._scene
        cars = sorted(scene.in_range(), key=lambda car: abs(car.x - scene.ego.x))
        gap = self._sought([(place_lever(scene, car),) for car in cars])
        on_their_sides = [(place_lever_on_its_side(scene, car),) for car in cars]
        asks_more = gap.status == "none" and not self._offered
        return Answer(
            self._action,
            self._offered,
            gap,
            self._sought(on_their_sides) if self._passes(gap) else None,
            self._sought([(speed_lever(scene, car),) for car in cars]),
            self._sought([(speed_lever(scene, scene.ego),)]),
            self._joint() if asks_more else None,
        )

    def _passes(self, gap: Finding) -> bool:
        """Whether a change takes a vehicle past the ego."""
        ego = self._scene.ego.x
        return any((change.before - ego) * (change.after - ego) < 0 for change in gap.changes)

    def _joint(self) -> Finding | None:
        """The least change of the places of all vehicles that object; None where it is not they who do."""
        objecting = self._objecting()
        if len(objecting) < 2:
            return None
        return self._sought([tuple(place_lever(self._scene, car) for car in objecting)])

    def _objecting(self) -> list[Vehicle]:
        """Vehicles without which the action would be offered, each of them needed for that; else none."""
        cars = self._scene.in_range()
        away = {car.id for car in cars}
        if not self._offered_without(away):
            return []
        for car in cars:
            if self._offered_without(away - {car.id}):
                away.remove(car.id)
        return [car for car in cars if car.id in away]

    def _offered_without(self, away: set[str]) -> bool:
        left = tuple(car for car in self._scene.vehicles if car.id not in away)
        try:
            return self._rules.offers(replace(self._scene, vehicles=left), self._action)
        except RuleFailure:
            return False  # as on the road: where rules fail, no lane change is offered

    def _sought(self, groups: Sequence[tuple[Lever, ...]]) -> Finding:
        """The least change of all levers of any one group."""
        try:
            best = self._best(self._flipped, groups)
            trouble = self._best(self._undecided, groups, None if best is None else best.high)
        except GaveUp as reason:
            return Finding("unknown", reason=str(reason))
        failing = f"at a change of {float(trouble.high):.6g} the rules may raise an error" if trouble else ""
        if best is None:
            return Finding("unknown", reason=failing) if failing else Finding("none")
        return self._confirmed(best, best.stopped or failing)

    def _best(
        self, truth: Bool, groups: Sequence[tuple[Lever, ...]], below: Fraction | None = None
    ) -> _Least | None:
        best: _Least | None = None
        for levers in groups:
            question = Question(self._open, truth, levers)
            best = self._least(question, below if best is None else best.high) or best
        return best

    def _least(self, question: Question, below: Fraction | None) -> _Least | None:
        """The least change, if there is one that is clearly less than `below`."""
        most = sum((max(-lever.low, lever.high) for lever in question.levers), Fraction(0))
        if below is not None:
            most = min(most, below - PRECISION)
        amounts = None if most < 0 else question.amounts(most, self._deadline)
        if amounts is None:
            return None
        best = _Least(question, amounts, Fraction(0))
        while best.high - best.low > PRECISION:
            middle = (best.high + best.low) / 2
            try:
                amounts = question.amounts(middle, self._deadline)
            except GaveUp as reason:
                if len(question.levers) == 1:
                    raise
                return replace(best, stopped=str(reason))
            best = replace(best, low=middle) if amounts is None else replace(best, amounts=amounts)
        return best

    # ------------------------------------------------------------ confirmation

    def _confirmed(self, best: _Least, reservation: str) -> Finding:
        """The change in round numbers, if the interpreter confirms it."""
        levers = best.question.levers
        for amounts in _rounded(best):
            if best.question.allows(amounts):
                scene = changed(self._scene, levers, amounts)
                if self._is_other(scene):
                    changes = self._changes(levers, amounts, scene)
                    return Finding("found", changes, best.least, scene, reservation)
        return Finding("unknown", least=best.least, reason=self._why_unconfirmed(best))

    def _why_unconfirmed(self, best: _Least) -> str:
        if self._open.only(self._flipped, []).op == "true":
            return "the scene is at a rounding limit: exact numbers decide otherwise about it as it is"
        return f"the solver finds a change of {float(best.high):.6g}, which the rules do not confirm"

    def _is_other(self, scene: Scene) -> bool:
        """Whether the interpreter decides otherwise about the action."""
        try:
            decision = self._rules.shield.decide(scene)
        except RuleFailure:
            return False
        return (self._action in decision.safe_actions) is not self._offered

    def _changes(
        self, levers: Sequence[Lever], amounts: Sequence[Fraction], scene: Scene
    ) -> tuple[Change, ...]:
        before, after = ({car.id: car for car in (one.ego, *one.vehicles)} for one in (self._scene, scene))
        seen = {scene.ego.id, *(car.id for car in scene.in_range())}
        return tuple(
            Change(
                lever.vehicle,
                lever.quantity,
                float(amount),
                getattr(before[lever.vehicle], lever.quantity),
                getattr(after[lever.vehicle], lever.quantity),
                lever.vehicle not in seen,
            )
            for lever, amount in zip(levers, amounts, strict=True)
            if amount
        )


def _rounded(best: _Least) -> Iterator[list[Fraction]]:
    """The changes rounded up to few decimals, then to more, at last as they are."""
    signs = [(amount > 0) - (amount < 0) if abs(amount) > PRECISION else 0 for amount in best.amounts]
    # A scene at the very limit needs hardly any change, and the solver's may be none.
    ways = [signs] if any(signs) else [[1], [-1]] if len(signs) == 1 else []
    for digits in _DIGITS:
        step = Fraction(1, 10**digits)
        for extra in (0, 1):
            sizes = [
                (math.ceil(max(Fraction(0), abs(amount) - PRECISION) / step) + extra) * step
                for amount in best.amounts
            ]
            for way in ways:
                amounts = [sign * size for sign, size in zip(way, sizes, strict=True)]
                total = sum(map(abs, amounts), Fraction(0))
                if total and (digits >= _COARSE or total <= best.high * (1 + _OVERSHOOT)):
                    yield amounts
    yield best.amounts
