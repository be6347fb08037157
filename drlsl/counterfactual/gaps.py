"""Find the least change of a scene for which an action is offered, or not offered.

One quantity of one vehicle is left open at a time: its place along the road, its speed, or the ego's speed;
all else stays as in the scene. The lowered rules, the same that `drlsl rules verify` proves properties of,
are then a formula in one unknown, and the solver bounds the least change that satisfies it. The reported
change is a round number just beyond, for which the interpreter has confirmed the other decision.
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
from drlsl.driving.scene import SCHEMA, Action, Scene, Vehicle, action_of_atom, facts_of
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
"""Width of the final bounds on the least change [m or m/s]."""

TIME_LIMIT: Final = 10.0
"""Default time limit for one action [s]."""

_OVERSHOOT: Final = Fraction(1, 20)
"""Largest share by which rounding may increase a change."""

_DIGITS: Final = (1, 2, 3, 4, 6, 9)
_COARSE: Final = 3
"""Number of decimals from which on the overshoot does not matter."""


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
        """Return the change, with the field of a scene file that it changes."""
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

    `changes` are confirmed: the interpreter decides differently in `scene`, which has them. `least` [m or
    m/s] is a lower bound of the sum of the changes' amounts, which exceed it only by rounding. With `found`,
    a `reason` says why lesser changes are not excluded: the search for them was broken off, or the rules may
    raise an error there.
    """

    status: Status
    changes: tuple[Change, ...] = ()
    least: float | None = None
    scene: Scene | None = None
    reason: str = ""

    def as_json(self) -> dict[str, Any]:
        """Return all fields but the scene."""
        return {
            "status": self.status,
            "changes": [change.as_json() for change in self.changes],
            "least": self.least,
            "reason": self.reason,
        }


@dataclass(frozen=True, slots=True)
class Answer:
    """The least changes for an offered action not to be offered, or for another action to be offered.

    `gap` is one vehicle elsewhere along the road, `speed` one at another speed, `ego_speed` the ego at
    another speed. `gap_without_passing`, searched if `gap` takes a vehicle past the ego, is one that stays in
    front or behind. `gaps`, searched if an action is not offered and no single vehicle's place would change
    that, is several vehicles elsewhere, by the least sum of metres. A kind that was not searched is None.
    """

    action: Action
    offered: bool
    gap: Finding
    gap_without_passing: Finding | None
    speed: Finding
    ego_speed: Finding
    gaps: Finding | None

    def findings(self) -> dict[str, Finding | None]:
        """Return the findings, by kind."""
        return {
            "gap": self.gap,
            "gap_without_passing": self.gap_without_passing,
            "speed": self.speed,
            "ego_speed": self.ego_speed,
            "gaps": self.gaps,
        }

    def as_json(self) -> dict[str, Any]:
        """Return the answer as JSON's values, always with the same keys."""
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
    """Return the least changes of `scene` for each action, each action in `time_limit` seconds.

    Vehicles in radar range change, one at a time. They keep their lane and y, and the sign of their speed:
    from 0 to the highest of `RANGES`. No vehicle is moved to where it touches another that it does not touch
    already, or farther than just out of radar range.

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
    """A rule program with its actions lowered: the condition of each, and generated code to answer."""

    shield: Shield
    lowered: LoweredAnswer
    conditions: Mapping[Action, Node]
    scalar: Scalar

    @classmethod
    def of(cls, shield: Shield) -> _Rules:
        """Lower the rules of a shield; raise UserError if that is impossible."""
        try:
            lowered = lower(shield.engine, SCHEMA, [Query("safe_actions", 1, "all")])
        except NotLowerable as reason:
            raise UserError(f"a what-if needs rules that can be lowered: {reason}") from reason
        (answer,) = lowered.answers
        if answer.choices is None:
            raise UserError(
                "a what-if needs rules that can be lowered: the actions of safe_actions/1 must be written in "
                "the program, not computed"
            )
        conditions = {
            action_of_atom(atom.name if isinstance(atom, Atom) else atom): condition
            for atom, condition in answer.choices
        }
        return cls(shield, answer, conditions, compile_scalar(lowered))

    def offers(self, scene: Scene, action: Action) -> bool:
        """Return whether the rules offer an action, by generated code if it can decide.

        Raises:
            RuleFailure: the rules give no usable answer.
        """
        try:
            (atoms,) = self.scalar(facts_of(scene))
        except Undecided:
            return action in self.shield.decide(scene).safe_actions
        return action.atom in atoms


@dataclass(frozen=True, slots=True)
class _Least:
    """Changes that answer a question, and a sum of changes up to which there are none.

    The two are as close as the precision, unless the search has `stopped` for a reason.
    """

    question: Question
    amounts: list[Fraction]
    low: Fraction
    stopped: str = ""

    @property
    def high(self) -> Fraction:
        """The sum of the changes."""
        return sum(map(abs, self.amounts), Fraction(0))

    @property
    def least(self) -> float:
        """The lower bound of the changes, [m] or [m/s], with 6 decimals."""
        # other levers were only searched for changes that are smaller by more than the precision
        proved = self.low if self.stopped else max(Fraction(0), self.high - PRECISION)
        return round(math.floor(proved / PRECISION) * float(PRECISION), 6)


class _Search:
    """Searches the least changes that alter the decision about one action."""

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
        """Return the findings of all kinds."""
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
        """Return whether a change takes a vehicle past the ego."""
        ego = self._scene.ego.x
        return any((change.before - ego) * (change.after - ego) < 0 for change in gap.changes)

    def _joint(self) -> Finding | None:
        """Return the least change of the places of all objecting vehicles; None if no vehicles object."""
        objecting = self._objecting()
        if len(objecting) < 2:
            return None
        return self._sought([tuple(place_lever(self._scene, car) for car in objecting)])

    def _objecting(self) -> list[Vehicle]:
        """Return the vehicles that jointly prevent the action, each of them needed for it; else none."""
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
            return False  # as on the road: if rules fail, no lane change is offered

    def _sought(self, groups: Sequence[tuple[Lever, ...]]) -> Finding:
        """Return the least change of all levers of any one group."""
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
        """Return the least change, if there is one that is clearly less than `below`."""
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

    def _confirmed(self, best: _Least, reservation: str) -> Finding:
        """Return the change in round numbers, if the interpreter confirms it."""
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
            return "the scene is at a rounding limit: exact numbers change its decision"
        return f"the solver finds a change of {float(best.high):.6g}, which the rules do not confirm"

    def _is_other(self, scene: Scene) -> bool:
        """Return whether the interpreter decides differently about the action."""
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
    """Yield the changes rounded up to few decimals, then to more, and finally exact."""
    signs = [(amount > 0) - (amount < 0) if abs(amount) > PRECISION else 0 for amount in best.amounts]
    # A scene exactly at a limit needs hardly any change, and the solver's may be 0.
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
