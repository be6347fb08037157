"""One decision held for several frames, as one step."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import numpy.typing as npt

from drlsl.driving.scene import Action, several_actions, with_rows
from drlsl.driving.shield import Decisions
from drlsl.driving.simulation.playback import Playbacks
from drlsl.driving.simulation.world import StepResult, World
from drlsl.errors import UserError
from drlsl.traffic import Integers

_NEARLY: Final = 1e-6
"""Share of a frame by which a period may differ from a whole number of frames: rounding, no more."""


def frames_per_decision(period: float | None, playbacks: Playbacks) -> int:
    """Return the number of frames for which an action is held; without a `period` [s], one.

    Raises:
        UserError: the period is no multiple of a frame, or the recordings differ in their frame rates.
    """
    if period is None:
        return 1
    steps = sorted({playback.road.time_step for playback in playbacks.all})
    if len(steps) > 1:
        raise UserError(
            f"decision_period {period:g} s: the recordings have frames of {_listed(steps)} s, and a decision "
            "must be of equally many frames in all; use recordings of one frame rate, or no decision_period"
        )
    frames = period / steps[0]
    if round(frames) < 1 or abs(frames - round(frames)) > _NEARLY:
        nearest = max(1, round(frames)) * steps[0]
        raise UserError(
            f"decision_period {period:g} s is no multiple of the recording's frame, {steps[0]:g} s; "
            f"the nearest one is {nearest:g}"
        )
    return round(frames)


def drive_decision(
    world: World,
    actions: npt.NDArray[np.integer] | Sequence[int],
    restarts: Mapping[int, np.random.Generator] | None = None,
    *,
    frames: int,
    discount: float = 1.0,
    watch: Callable[[StepResult], None] | None = None,
) -> StepResult:
    """Drive `frames` frames with `actions` of shape (N,) and return them as one step.

    A lane change starts in the first frame or not at all; the rules are queried in every frame, so that a
    lane change is given up and the ego brakes as they say. The rewards of all frames are added up, each
    weighted by `discount` to the power of the share of the decision that has passed. An episode that ends
    has the decisions, the speed and the distance of its last frame. Egos in `restarts` begin a new episode in
    the last frame. `watch` is called with each frame's result.

    Raises:
        TypeError, ValueError: `actions` are not N valid actions; nothing is driven.
        UserError: the rules keep a lane that the road does not have.
    """
    if frames == 1 and watch is None:
        return world.step(actions, restarts)
    actions = several_actions(actions, world.count)
    keep = np.full(world.count, int(Action.LANE_KEEPING))
    held = None
    for frame in range(frames):
        last = frame == frames - 1
        result = world.step(actions if frame == 0 else keep, restarts if last else None)
        if watch is not None:
            watch(result)
        held = result if held is None else _added(held, result, discount ** (frame / frames))
        if (held.terminated | held.truncated).all():
            break
    assert held is not None
    return held


def _added(held: StepResult, result: StepResult, weight: float) -> StepResult:
    """Return the frames so far and one more; nothing happens to an ego whose episode has ended."""
    over = held.terminated | held.truncated
    ended = over.nonzero()[0]
    return StepResult(
        scenes=with_rows(result.scenes, ended, held.scenes),
        decisions=_with_ended(result.decisions, ended, held.decisions),
        reward=held.reward + weight * result.reward,
        rewards={name: held.rewards[name] + weight * term for name, term in result.rewards.items()},
        terminated=held.terminated | result.terminated,
        truncated=held.truncated | result.truncated,
        changed=held.changed | result.changed,
        off_road=held.off_road | result.off_road,
        contacts={**result.contacts, **held.contacts},
        entered=held.entered | (result.entered & ~over),
        distance=np.where(over, held.distance, result.distance),
        speed=np.where(over, held.speed, result.speed),
        failures={ego: why for ego, why in result.failures.items() if not over[ego]} | held.failures,
    )


def _with_ended(decisions: Decisions, ended: Integers, before: Decisions) -> Decisions:
    """Return the decisions, those about the egos of episodes that have `ended` as they were `before`."""
    places = set(ended.tolist())
    failures = {ego: why for ego, why in decisions.failures.items() if ego not in places}
    failures |= {ego: why for ego, why in before.failures.items() if ego in places}
    return replace(with_rows(decisions, ended, before), failures=failures)


def _listed(numbers: Sequence[float]) -> str:
    return " and ".join(f"{number:g}" for number in numbers)
