"""A driver in a world: what it sees there, and what it drives of what is offered."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from drlsl.driving.drivers.driver import Driver, Situations, most_wanted
from drlsl.driving.simulation import World
from drlsl.traffic import Integers


class DrivenBy:
    """A driver in a world, with the observations that it remembers."""

    def __init__(self, driver: Driver) -> None:
        self._driver = driver
        self._seen: npt.NDArray[np.float32] | None = None

    def actions(self, world: World) -> Integers:
        """Return of the offered actions those that it wants most, shape (N,).

        An episode's first observation stands for those before it.
        """
        offered = world.decisions.action_mask
        situations = Situations(self._observed(world), offered, world.seen, world.branch)
        return most_wanted(self._driver.preferences(situations), offered).actions

    def _observed(self, world: World) -> npt.NDArray[np.float32]:
        now = world.decisions.observation.astype(np.float32)
        if self._driver.window == 1:
            return now
        first = np.tile(now, self._driver.window)
        if self._seen is None:
            self._seen = first
        later = np.concatenate([self._seen[:, now.shape[1] :], now], axis=1)
        self._seen = np.where((world.distance == 0.0)[:, None], first, later)
        return self._seen
