"""The oracle: try out in the recorded future what each action leads to, and take the best.

It is a reference for what a driver could gain behind the rules, and no driver: it looks into the future.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from pydantic import Field

from drlsl.driving.drivers.driver import Momentary, Preferences, Situations
from drlsl.driving.scene import Action
from drlsl.driving.simulation import World
from drlsl.traffic import Floats, Integers, Mask

_LOST: Final = 1e9
"""Metres by which a plan that ends in a contact or off the road ranks below all others."""


class Oracle(Momentary):
    """Chooses the offered action that leads farthest within `horizon`, of those that lead to no contact.

    A plan is an offered action, then lane keeping, with another action every `pause` until `decisions` of
    them are made, each of those that are offered then. All plans are driven in a branch of the world: with
    the same recording, traffic, rules and draws that the ego will meet.
    """

    horizon: float = Field(20.0, gt=0, le=600, description="Seconds that a plan looks ahead.")
    decisions: int = Field(2, ge=1, le=5, description="Decisions of a plan; lane keeping follows the last.")
    pause: float = Field(
        4.0, gt=0, le=60, description="Seconds between two of them; a lane change takes about 3."
    )

    def preferences(self, situations: Situations) -> Preferences:
        """Return how far [m] the best plan leads that begins with each action; never an action not offered.

        Raises:
            ValueError: the situations have no future.
        """
        if situations.branch is None:
            raise ValueError("the oracle needs situations that can be driven on from")
        offered = situations.offered
        result = np.where(offered, 0.0, -np.inf)
        # Who has no choice needs no plan.
        choosing = (offered.sum(axis=1) > 1).nonzero()[0]
        if choosing.size:
            place, action = offered[choosing].nonzero()
            ego = choosing[place]
            result[ego, action] = self._reached(situations.branch(ego), action)
        return result

    def _reached(self, world: World, actions: Integers) -> Floats:
        """Return how far the best plan leads that begins with each ego's action, shape (N,)."""
        dt = float(world.playbacks.courses.dt.min())
        pause, left = (max(1, round(seconds / dt)) for seconds in (self.pause, self.horizon))
        best = np.full(world.count, -np.inf)
        beginning = np.arange(world.count)
        for number in range(self.decisions):
            frames = left if number == self.decisions - 1 else min(pause, left)
            left -= frames
            ended, reached = _driven(world, actions, frames, left * dt)
            over = ended | (left == 0)
            np.maximum.at(best, beginning[over], reached[over])
            if over.all():
                break
            going = (~over).nonzero()[0]
            place, actions = _choices(world)[going].nonzero()
            world, beginning = world.branch(going[place]), beginning[going[place]]
        return best


def _choices(world: World) -> Mask:
    """Return the offered actions that make a difference, at least one for each ego, shape (N, 3)."""
    choices = world.decisions.action_mask & np.isfinite(world.targets())
    choices[~choices.any(axis=1), Action.LANE_KEEPING] = True
    return choices


def _driven(world: World, actions: Integers, frames: int, later: float) -> tuple[Mask, Floats]:
    """Drive an action and then keep the lane; return which episodes ended, and how far each ego came [m].

    An ego at the end of its track counts as driving on at the same speed, `later` [s] beyond these frames.
    """
    dt = world.playbacks.courses.dt.min()
    keep = np.full(world.count, int(Action.LANE_KEEPING))
    ended, reached = np.zeros(world.count, dtype=np.bool_), np.zeros(world.count)
    for frame in range(frames):
        result = world.step(keep if frame else actions)
        rest = (frames - 1 - frame) * dt + later
        reached = np.where(ended, reached, result.distance)
        reached[result.terminated] -= _LOST
        reached[result.truncated] += (result.speed * rest)[result.truncated]
        ended |= result.terminated | result.truncated
        if ended.all():
            break
    return ended, reached
