"""What the ego can do; the rules are told as facts. Standard library only."""

from __future__ import annotations

from typing import Final

ACCELERATION_LIMIT: Final = 3.0
"""The hardest the ego can speed up [m/s²]."""

BRAKING_LIMIT: Final = 8.0
"""The hardest the ego can brake [m/s²]: a dry road's full braking."""

CENTRE_TOLERANCE: Final = 0.4
"""Offset from the target lane's centre [m] up to which the ego takes up a new lane change."""
