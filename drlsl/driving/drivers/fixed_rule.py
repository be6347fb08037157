"""Drivers that look only at what is offered."""

from __future__ import annotations

import numpy as np

from drlsl.driving.drivers.driver import Momentary, Preferences, Situations, wanting
from drlsl.driving.scene import Action


class Keep(Momentary):
    """Keeps the lane."""

    def preferences(self, situations: Situations) -> Preferences:
        """Return a preference for keeping the lane."""
        return wanting(np.full(len(situations.offered), Action.LANE_KEEPING))


class AlwaysChange(Momentary):
    """Changes lanes whenever a change is offered, to the left if there is a choice."""

    def preferences(self, situations: Situations) -> Preferences:
        """Return a preference for an offered lane change."""
        order = np.array([0.0, 2.0, 1.0])
        return np.where(situations.offered, order, -1.0)
