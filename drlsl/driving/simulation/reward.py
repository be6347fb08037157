"""The reward, term by term."""

from __future__ import annotations

from typing import Final

import numpy as np

from drlsl.driving.config import RewardConfig
from drlsl.traffic import Floats, Mask

TERMS: Final = ("lane_change", "velocity", "collision", "off_road")
"""Names of the reward's terms, in the order of the paper."""


def reward_terms(
    config: RewardConfig, *, changed: Mask, speed: Floats, contact: Mask, off_road: Mask, progress: Floats
) -> dict[str, Floats]:
    """Return weighted terms, each of shape (N,); the reward is their sum.

    `changed`: a lane change was started; `speed` [m/s]; `progress` in [0, 1]: distance driven over the
    track's length.

    Source: paper, Reward Function.
    """
    late = 1.0 - config.discount * np.minimum(np.maximum(progress, 0.0), 1.0)
    return {
        "lane_change": np.where(changed, -config.lane_change, 0.0),
        "velocity": config.velocity * speed,
        "collision": np.where(contact, -config.collision * late, 0.0),
        "off_road": np.where(off_road, -config.off_road * late, 0.0),
    }
