"""Drivers that look only at what is offered."""

from __future__ import annotations

import numpy as np

from drlsl.driving.config import Section
from drlsl.driving.drivers.driver import Preferences, Situations, wanting
from drlsl.driving.scene import Action


class Keep(Section):
    """Keeps the lane."""

    @property
    def window(self) -> int:
        """One observation, which is not looked at."""
        return 1

    def preferences(self, situations: Situations) -> Preferences:
        """Return a preference for keeping the lane."""
        return wanting(np.full(len(situations.offered), Action.LANE_KEEPING))


class AlwaysChange(Section):
    """Changes lanes whenever a change is offered, to the left if there is a choice."""

    @property
    def window(self) -> int:
        """One observation, which is not looked at."""
        return 1

    def preferences(self, situations: Situations) -> Preferences:
        """Return a preference for an offered lane change."""
        order = np.array([0.0, 2.0, 1.0])
        return np.where(situations.offered, order, -1.0)
