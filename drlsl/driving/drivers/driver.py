"""The interface of a driver: from the situations of N egos to how much it wants each action."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

from drlsl.driving.config import Section
from drlsl.driving.scene import Action, SceneBatch
from drlsl.driving.simulation import World
from drlsl.traffic import Integers, Mask

Preferences: TypeAlias = npt.NDArray[np.floating[Any]]
"""How much each action is wanted, shape (N, 3): finite, or minus infinity for never by own choice."""


@dataclass(frozen=True, slots=True, eq=False)
class Situations:
    """The situations in which N egos decide.

    `observations` (N, W · S) float32: the last W observations, the latest last; `offered` (N, 3) bool: the
    actions that may be taken, at least one of each; `scenes`: those that the rules saw. `branch` returns a
    world in which some of the egos drive on (`World.branch`): it shows the future, so it is for a reference
    like the oracle, and a driver of a user's own does not get it.
    """

    observations: npt.NDArray[np.float32]
    offered: Mask
    scenes: SceneBatch
    branch: Callable[[Integers], World] | None = None


class Driver(Protocol):
    """Whoever chooses the actions of N egos, once for each step of the environment."""

    @property
    def window(self) -> int:
        """Number of observations that it needs, 1 or more."""

    def preferences(self, situations: Situations) -> Preferences:
        """Return how much each action is wanted, offered or not.

        The most wanted action is what the driver prefers; of those that are offered the most wanted one is
        driven. Of equals the first counts.
        """


class Momentary(Section):
    """The settings of a driver that decides by the offered actions and the scenes, whatever it observed."""

    @property
    def window(self) -> int:
        """One observation, which is not looked at."""
        return 1


class Choice(NamedTuple):
    """The actions to drive, and those that the driver prefers, of any. Shapes: (N,)."""

    actions: Integers
    preferred: Integers


def most_wanted(preferences: Preferences, offered: Mask) -> Choice:
    """Return the offered action that is wanted most, and the one of any, the first of equals.

    Raises:
        ValueError: no action is offered, or a preference is NaN or infinite.
    """
    if not offered.any(axis=1).all():
        raise ValueError("no action is offered")
    if preferences.shape != offered.shape or not (preferences < np.inf).all():
        raise ValueError(
            f"preferences of shape {preferences.shape} are {preferences.tolist()}; expected {offered.shape} "
            "numbers below infinity"
        )
    # An offered action that is never wanted still ranks above one that is not offered.
    wanted = np.maximum(preferences, np.finfo(preferences.dtype).min)
    return Choice(np.where(offered, wanted, -np.inf).argmax(axis=1), preferences.argmax(axis=1))


def wanting(actions: Integers) -> Preferences:
    """Return preferences for `actions` (N,) first, then for keeping the lane."""
    result = np.zeros((len(actions), len(Action)))
    result[:, Action.LANE_KEEPING] = 0.5
    result[np.arange(len(actions)), actions] = 1.0
    return result
