"""The Intelligent Driver Model: a follower's acceleration behind a leader.

Source: Treiber and Kesting, Traffic Flow Dynamics (2013), section 11.3; parameters: Table 11.2, highway.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from drlsl.driving.scene import BRAKING_LIMIT
from drlsl.traffic import Floats

DESIRED_SPEED: Final = 120 / 3.6
"""The speed on a free road [m/s]."""

TIME_GAP: Final = 1.0
"""The time headway of a follower [s]."""

MINIMUM_GAP: Final = 2.0
"""The gap at standstill [m]."""

ACCELERATION: Final = 1.0
"""The largest acceleration [m/s²]."""

COMFORTABLE_BRAKING: Final = 1.5
"""The comfortable braking [m/s²]."""

_LEAST_GAP: Final = 0.01
"""Gaps count as at least this long [m], because the model divides by them."""


def idm_acceleration(
    gap: Floats, speed: Floats, leader_speed: Floats, desired: Floats | float = DESIRED_SPEED
) -> Floats:
    """Return the acceleration behind a leader [m/s²], from full braking up to that on a free road.

    `gap` [m] from bumper to bumper, infinite without a leader; `speed`, `leader_speed` and `desired`, the
    speed on a free road, above 0 [m/s] along the road; all of one shape.
    """
    closing = speed * (speed - leader_speed) / (2 * math.sqrt(ACCELERATION * COMFORTABLE_BRAKING))
    wanted = MINIMUM_GAP + np.maximum(0.0, speed * TIME_GAP + closing)
    pressing = wanted / np.maximum(gap, _LEAST_GAP)
    return np.maximum(free_acceleration(speed, desired) - ACCELERATION * pressing * pressing, -BRAKING_LIMIT)


def free_acceleration(speed: Floats, desired: Floats | float = DESIRED_SPEED) -> Floats:
    """Return the acceleration on a free road [m/s²]: 0 above the `desired` speed.

    The model's exponent is 4. Source: Table 11.2.
    """
    share = np.minimum(speed / desired, 1.0)
    square = share * share
    return np.asarray(ACCELERATION * (1.0 - square * square))
