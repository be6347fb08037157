"""Safe actions by linear prediction instead of rules, for the masks of MPSDQN.

Every vehicle keeps its velocity; the ego keeps its speed along the road and moves sideways by its lane
controller's law for each action. An action is offered unless, within the horizon, the ego's box meets
another's or the ego leaves the lanes of its direction.

Source: paper, MPSDQN, which looks one step ahead; here the horizon is a setting.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from drlsl.driving.scene import SceneBatch
from drlsl.driving.simulation.controllers import LANE_GAIN, LATERAL_SPEED_LIMIT
from drlsl.driving.simulation.playback import Courses
from drlsl.traffic import Floats, Mask

TICK: Final = 0.1
"""The longest time between two predicted moments [s]: too short for two cars that approach at 250 km/h to
pass through each other."""

NOTHING_OFFERED: Final = "the prediction offers no action: each meets a vehicle or leaves the road"
"""The reason for the prediction's fail-safe: keep the lane, at the rules' target speed."""


def predicted_actions(scenes: SceneBatch, targets: Floats, low: Floats, high: Floats, horizon: float) -> Mask:
    """Return the mask of actions that avoid vehicles and stay on the road for `horizon` [s], shape (N, 3).

    `targets` (N, 3): the y [m] that each action steers for, NaN for one that would be ignored; `low` and
    `high` (N,): the edges of the ego's lanes [m].
    """
    times = _moments(horizon)
    half = scenes.width[:, 0, None] / 2
    edges = low[:, None] + half, high[:, None] - half
    path = sideways(scenes.y[:, 0], targets, times)
    on_road = (targets >= edges[0]) & (targets <= edges[1])
    on_road &= ((path >= edges[0][..., None]) & (path <= edges[1][..., None])).all(axis=2)
    return on_road & ~_meets(scenes, path, times)


def lane_goes_on(scenes: SceneBatch, targets: Floats, courses: Courses, horizon: float) -> Mask:
    """Return the mask of actions that leave a lane before it ends, for `horizon` [s], shape (N, 3).

    `targets` are those of `predicted_actions`; NaN counts as leaving no lane.
    """
    times = _moments(horizon)
    front = courses.sign * scenes.x[:, 0] + scenes.length[:, 0] / 2
    ahead = (courses.sign * scenes.vx[:, 0])[:, None] * times
    past = front[:, None] + ahead > courses.end[:, None]
    half = scenes.width[:, 0, None, None] / 2
    path = sideways(scenes.y[:, 0], targets, times)
    low, high = courses.low_after[:, None, None], courses.high_after[:, None, None]
    within = (path - half >= low) & (path + half <= high)
    return np.asarray((within | ~past[:, None, :]).all(axis=2))


def _moments(horizon: float) -> Floats:
    """Return the predicted moments [s], shape (T,)."""
    ticks = math.ceil(horizon / TICK)
    return horizon * np.arange(1, ticks + 1) / ticks


def sideways(y: Floats, targets: Floats, times: Floats) -> Floats:
    """Return the ego's y [m] at `times` [s] on its way from `y` (N,) to `targets` (N, A).

    This is the lane controller's law without its integral part and its limit of acceleration: at the largest
    speed, then ever slower towards the centre. Shape (N, A, T).
    """
    error = y[:, None] - targets
    knee = LATERAL_SPEED_LIMIT / LANE_GAIN
    size = np.abs(error)[..., None]
    until = np.maximum(size - knee, 0.0) / LATERAL_SPEED_LIMIT
    eased = np.minimum(size, knee) * np.exp(-LANE_GAIN * np.maximum(times - until, 0.0))
    left = np.where(times < until, size - LATERAL_SPEED_LIMIT * times, eased)
    return np.asarray(targets[..., None] + np.sign(error)[..., None] * left)


def _meets(scenes: SceneBatch, path: Floats, times: Floats) -> Mask:
    """Return whether the ego's box meets another on each path (N, A, T) across the road, shape (N, A)."""
    offset = scenes.x[:, 1:] - scenes.x[:, :1]
    drift = scenes.vx[:, 1:] - scenes.vx[:, :1]
    reach = (scenes.length[:, 1:] + scenes.length[:, :1]) / 2
    alongside = np.abs(offset[:, None] + drift[:, None] * times[:, None]) < reach[:, None]
    alongside &= scenes.valid[:, None, 1:]
    scene, tick, other = alongside.nonzero()
    other += 1
    y = scenes.y[scene, other] + scenes.vy[scene, other] * times[tick]
    room = (scenes.width[scene, other] + scenes.width[scene, 0]) / 2
    touches = np.abs(path[scene, :, tick] - y[:, None]) < room[:, None]
    result = np.zeros(path.shape[:2], dtype=np.bool_)
    row, action = touches.nonzero()
    result[scene[row], action] = True
    return result
