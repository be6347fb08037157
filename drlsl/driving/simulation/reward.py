"""The reward, term by term."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from drlsl.driving.config import RewardConfig
from drlsl.traffic import Floats, Mask


@dataclass(frozen=True, slots=True, eq=False)
class Driven:
    """Results of one frame for N egos; all of shape (N,).

    `playing`: the episode was not over; `changed`: a lane change was started, and `front_is_free` before
    it; `speed` [m/s]; `progress`: distance driven over the track's length; `limit` [m/s]: the highest of
    the direction; `dt` [s]: the frame's duration; `motion` gives acceleration [m/s²] and jerk [m/s³] along
    the road.
    """

    playing: Mask
    changed: Mask
    front_is_free: Mask
    speed: Floats
    contact: Mask
    off_road: Mask
    progress: Floats
    limit: Floats
    dt: Floats
    motion: Callable[[], tuple[Floats, Floats]]


def _change(config: RewardConfig, driven: Driven) -> Floats | float:
    if config.lane_change_behind is None:
        return -config.lane_change
    return np.where(driven.front_is_free, -config.lane_change, config.lane_change_behind)


def _ended(weight: float, happened: Mask, config: RewardConfig, driven: Driven) -> Floats:
    late = 1.0 - config.discount * np.minimum(np.maximum(driven.progress, 0.0), 1.0)
    return np.where(happened, -weight * late, 0.0)


def _through_time(weight: float, cost: Floats, driven: Driven) -> Floats:
    return np.where(driven.playing, -weight * cost * driven.dt, 0.0)


_TERMS: Final[Mapping[str, Callable[[RewardConfig, Driven], Floats]]] = {
    "lane_change": lambda config, driven: np.where(driven.changed, _change(config, driven), 0.0),
    "velocity": lambda config, driven: config.velocity * (driven.speed * driven.playing),
    "collision": lambda config, driven: _ended(config.collision, driven.contact, config, driven),
    "off_road": lambda config, driven: _ended(config.off_road, driven.off_road, config, driven),
    "lost_speed": lambda config, driven: _through_time(
        config.lost_speed, driven.limit - driven.speed, driven
    ),
    "comfort": lambda config, driven: _through_time(config.comfort, np.square(driven.motion()[0]), driven),
    "jerk": lambda config, driven: _through_time(config.jerk, np.square(driven.motion()[1]), driven),
}

TERMS: Final = tuple(_TERMS)
"""Names of all terms: the paper's in its order, then those that can be chosen beside or in place of them."""


def reward_terms(config: RewardConfig, driven: Driven) -> dict[str, Floats]:
    """Return the weighted terms that `config` names, each of shape (N,); the reward is their sum.

    Source: paper, Reward Function (lane_change, velocity, collision, off_road).
    """
    return {name: _TERMS[name](config, driven) for name in config.single_terms}
