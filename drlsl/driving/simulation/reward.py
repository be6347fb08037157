"""The reward, term by term: plain functions of one ego, also readable for a compiler."""

from __future__ import annotations

from typing import Final

import numpy as np

from drlsl.driving.config import RewardConfig
from drlsl.lowering.backends import Floats1
from drlsl.traffic import Floats, Integers

TERMS: Final = ("lane_change", "velocity", "collision", "off_road", "lost_speed", "comfort", "jerk")
"""Names of all terms: the paper's in its order, then those that can be chosen beside or in place of them."""

_LANE_CHANGE, _VELOCITY, _COLLISION, _OFF_ROAD, _LOST_SPEED, _COMFORT, _JERK = range(len(TERMS))
_CHANGE_BEHIND: Final = len(TERMS)
_DISCOUNT: Final = len(TERMS) + 1


def reward_weights(config: RewardConfig) -> Floats:
    """Return the weights of `TERMS`, of a lane change behind somebody, and the discount, shape (9,)."""
    behind = -config.lane_change if config.lane_change_behind is None else config.lane_change_behind
    return np.array([*(getattr(config, name) for name in TERMS), behind, config.discount], dtype=np.float64)


def chosen_terms(config: RewardConfig) -> Integers:
    """Return the places in `TERMS` of the terms that `config` names."""
    return np.array([TERMS.index(name) for name in config.single_terms], dtype=np.int64)


def reward_term(
    term: int,
    weights: Floats1,
    playing: bool,
    changed: bool,
    front_is_free: bool,
    contact: bool,
    off_road: bool,
    speed: float,
    progress: float,
    limit: float,
    acceleration: float,
    jerk: float,
    dt: float,
) -> float:
    """Return one weighted term of `TERMS`, for one frame of one ego; the reward is the sum of those chosen.

    `playing`: the episode was not over; `changed`: a lane change was started, and `front_is_free` before
    it; `speed` [m/s]; `progress`: distance driven over the track's length; `limit` [m/s]: the highest of
    the direction; `acceleration` [m/s²] and `jerk` [m/s³] along the road; `dt` [s]: the frame's duration.

    Source: paper, Reward Function (lane_change, velocity, collision, off_road).
    """
    weight: float = weights[term]
    behind: float = weights[_CHANGE_BEHIND]
    discount: float = weights[_DISCOUNT]
    if term == _LANE_CHANGE:
        if not changed:
            return 0.0
        return -weight if front_is_free else behind
    if term == _VELOCITY:
        return weight * (speed if playing else 0.0)
    if term in (_COLLISION, _OFF_ROAD):
        if not (contact if term == _COLLISION else off_road):
            return 0.0
        return -weight * (1.0 - discount * min(max(progress, 0.0), 1.0))
    if not playing:
        return 0.0
    if term == _LOST_SPEED:
        return -weight * (limit - speed) * dt
    number = acceleration if term == _COMFORT else jerk
    return -weight * (number * number) * dt
