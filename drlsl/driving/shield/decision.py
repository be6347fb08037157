"""Usable answers of the rules, and the fail-safe if there is none, for one scene and for many.

NumPy is loaded only for many, so that a query about one scene starts without it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

from drlsl.driving.scene import Action, Road, Scene, action_of_atom, copied, put_rows, taken_rows
from drlsl.driving.shield.observation import ObservationSpace
from drlsl.driving.shield.questions import ACTIONS, COMFORT, FREE, LANE, SPEED, STATE, Question
from drlsl.shield import RuleFailure as RuleFailure  # the shield's surface has it, too

if TYPE_CHECKING:
    from drlsl.traffic import Floats, Integers, Mask


NO_WISH: Final = math.inf
"""The comfortable acceleration of a program that has none: as hard as the target speed allows."""

FAIL_SAFE_ACTION: Final = Action.LANE_KEEPING
"""The only action of the fail-safe."""


@dataclass(frozen=True, slots=True)
class Decision:
    """The rules' decision about one scene.

    `safe_actions` in the order derived, of array tiers by index, never empty; `target_speed` [m/s] >= 0;
    `observation`: numbers within the bounds of `Shield.observation`; `front_is_free`; `lane_to_keep`: the
    lane that lane keeping steers for; `comfortable_acceleration` [m/s²]: what a comfortable driver wants,
    `NO_WISH` if the rules do not say.
    """

    safe_actions: tuple[Action, ...]
    target_speed: float
    observation: tuple[float, ...]
    front_is_free: bool
    lane_to_keep: int
    comfortable_acceleration: float = NO_WISH

    @property
    def action_mask(self) -> tuple[int, int, int]:
        """1 for every action that is offered, by action index."""
        keep, left, right = (int(action in self.safe_actions) for action in Action)
        return keep, left, right

    def _repr_html_(self) -> str:
        """Return the decision as a table, for notebooks."""
        refused = [action for action in Action if action not in self.safe_actions]
        rows = {
            "offered": ", ".join(action.atom for action in self.safe_actions),
            "not offered": ", ".join(action.atom for action in refused) or "none",
            "target speed": f"{self.target_speed:.2f} m/s",
            "the road ahead is free": "yes" if self.front_is_free else "no",
            "lane to keep": str(self.lane_to_keep),
        }
        if self.comfortable_acceleration != NO_WISH:
            rows["comfortable acceleration"] = f"{self.comfortable_acceleration:.2f} m/s²"
        cells = "".join(f"<tr><th>{name}</th><td>{text}</td></tr>" for name, text in rows.items())
        return f"<table>{cells}</table>"


@dataclass(frozen=True, slots=True, eq=False)
class Decisions:
    """The rules' decisions about N scenes.

    `action_mask` (N, 3) bool, at least one action in each row; `target_speed` (N,) [m/s]; `observation` (N,
    S) within the bounds of `Shield.observation`; `front_is_free` (N,); `lane_to_keep` (N,) lane ids;
    `comfortable_acceleration` (N,) [m/s²], `NO_WISH` without one; `failures`: by scene, the reason for the
    fail-safe.
    """

    action_mask: Mask
    target_speed: Floats
    observation: Floats
    front_is_free: Mask
    lane_to_keep: Integers
    comfortable_acceleration: Floats
    failures: dict[int, str]

    @classmethod
    def blank(cls, count: int, size: int) -> Decisions:
        """Return arrays for `count` scenes and observations of `size` numbers, to be filled by `put`."""
        import numpy as np

        return cls(
            action_mask=np.zeros((count, len(Action)), dtype=np.bool_),
            target_speed=np.zeros(count),
            observation=np.zeros((count, size)),
            front_is_free=np.zeros(count, dtype=np.bool_),
            lane_to_keep=np.zeros(count, dtype=np.int64),
            comfortable_acceleration=np.full(count, NO_WISH),
            failures={},
        )

    def one(self, index: int) -> Decision:
        """Return the decision about one of the scenes."""
        return Decision(
            safe_actions=tuple(action for action in Action if self.action_mask[index, action]),
            target_speed=float(self.target_speed[index]),
            observation=tuple(self.observation[index].tolist()),
            front_is_free=bool(self.front_is_free[index]),
            lane_to_keep=int(self.lane_to_keep[index]),
            comfortable_acceleration=float(self.comfortable_acceleration[index]),
        )

    def put(self, index: int, decision: Decision, failure: str = "") -> None:
        """Write the decision about one scene; of a fail-safe with the reason for it."""
        self.action_mask[index] = decision.action_mask
        self.target_speed[index] = decision.target_speed
        self.observation[index] = decision.observation
        self.front_is_free[index] = decision.front_is_free
        self.lane_to_keep[index] = decision.lane_to_keep
        self.comfortable_acceleration[index] = decision.comfortable_acceleration
        if failure:
            self.failures[index] = failure

    def taken(self, places: Integers) -> Decisions:
        """Return the decisions in `places`, as copies."""
        failures = {
            row: self.failures[place] for row, place in enumerate(places.tolist()) if place in self.failures
        }
        return replace(taken_rows(self, places), failures=failures)

    def replaced(self, places: Integers, decisions: Decisions) -> Decisions:
        """Return a copy with `decisions` in `places`."""
        result, order = copied(self), places.tolist()
        put_rows(result, places, decisions)
        kept = {place: why for place, why in self.failures.items() if place not in order}
        new = {order[place]: why for place, why in decisions.failures.items()}
        return replace(result, failures=kept | new)


def decision_of(space: ObservationSpace, answers: Mapping[Question, Any], scene: Scene) -> Decision:
    """Return the decision of a tier's answers about a scene; an answer of None stands for no solution.

    Raises:
        RuleFailure: an answer is not usable.
        UserError: the rules offer an action that the agent does not know.
    """
    safe = tuple(dict.fromkeys(action_of_atom(atom) for atom in answers[ACTIONS]))
    if not safe:
        raise RuleFailure("the rules offer no action")
    for question, answer in answers.items():
        if answer is None:
            raise RuleFailure(f"{question} has no solution")
    target_speed = _number(answers[SPEED])
    if not is_speed(target_speed):
        raise RuleFailure(f"{SPEED} gave {answers[SPEED]!r}; expected a speed in m/s, 0 or more")
    numbers = _observed(space, answers[STATE])
    lane = answers.get(LANE, scene.target_lane)
    if not isinstance(lane, int):
        raise RuleFailure(f"{LANE} gave {lane!r}; expected a lane")
    wish = answers.get(COMFORT, NO_WISH)
    comfortable = _number(wish)
    if not is_wish(comfortable):
        raise RuleFailure(f"{COMFORT} gave {wish!r}; expected an acceleration in m/s²")
    return Decision(safe, target_speed, numbers, answers[FREE], lane, comfortable)


def _observed(space: ObservationSpace, answer: object) -> tuple[float, ...]:
    """Return the numbers of an observation.

    Raises:
        RuleFailure: they are not as many as the space has, or out of its bounds.
    """
    if not isinstance(answer, list) or len(answer) != len(space):
        raise RuleFailure(f"{STATE} gave {answer!r}; expected a list of {len(space)} numbers")
    numbers = tuple(map(_number, answer))
    place = space.outside(numbers)
    if place is not None:
        name, low, high = space.names[place], space.low[place], space.high[place]
        expected = f"expected a number from {low:g} to {high:g}"
        raise RuleFailure(f"{STATE} gave {answer!r}, in which {name} is {answer[place]!r}; {expected}")
    return numbers


def fail_safe(scene: Scene, space: ObservationSpace) -> Decision:
    """Return the decision if the rules give no usable answer: keep the lane and brake hard."""
    speed = fail_safe_speed(abs(scene.ego.vx), scene.road)
    return Decision((FAIL_SAFE_ACTION,), speed, space.zero, False, scene.target_lane)


def fail_safe_speed(speed: float, road: Road) -> float:
    """Return the target speed [m/s] of the fail-safe: full braking."""
    return max(0.0, speed - road.braking_limit * road.time_step)


def _number(answer: object) -> float:
    """Return a number as a float: infinity if it is too large, NaN if it is no number."""
    if not isinstance(answer, int | float):
        return math.nan
    try:
        return float(answer)
    except OverflowError:
        return math.inf


def is_speed(value: float) -> bool:
    """Return whether a number is a speed in m/s; NaN is not."""
    return (value >= 0) & (value < math.inf)


def is_wish(value: float) -> bool:
    """Return whether a number is an acceleration or `NO_WISH`; NaN is neither."""
    return value > -math.inf
