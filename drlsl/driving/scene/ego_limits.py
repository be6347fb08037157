"""The ego's physical limits, which the rules read as facts. Standard library only."""

from __future__ import annotations

from typing import Final

ACCELERATION_LIMIT: Final = 3.0
"""Largest acceleration of the ego [m/s²]."""

BRAKING_LIMIT: Final = 8.0
"""Largest braking of the ego [m/s²]: full braking on a dry road."""

CENTRE_TOLERANCE: Final = 0.4
"""Largest offset from the target lane's centre [m] at which the ego starts a new lane change."""

EGO_LIMITS: Final = {
    "acceleration_limit": ACCELERATION_LIMIT,
    "braking_limit": BRAKING_LIMIT,
    "centre_tolerance": CENTRE_TOLERANCE,
}
"""By the name of the fact that tells it."""
