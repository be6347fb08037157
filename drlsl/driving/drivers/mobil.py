"""MOBIL: change lanes if the accelerations of those concerned become better by it.

Source: Kesting, Treiber and Helbing, General Lane-Changing Model MOBIL for Car-Following Models, TRR 1999
(2007), and Treiber and Kesting, Traffic Flow Dynamics (2013), section 14.3; the accelerations are those of
the Intelligent Driver Model.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from pydantic import Field

from drlsl.driving.drivers.driver import Momentary, Preferences, Situations
from drlsl.driving.scene import Action, Road, SceneBatch
from drlsl.driving.simulation import idm_acceleration
from drlsl.traffic import Floats, Integers, Mask

_LANES: Final = len(Action)
"""The lanes that the actions lead to, in their order: the target lane, the one to its left, to its right."""


class Mobil(Momentary):
    """Drives by MOBIL; each lane's limit is the speed that is desired in it.

    A change is wanted by as much as it betters the acceleration, the others' counted by `politeness`, above
    the threshold; never one for which the follower there would brake harder than `safe_braking`. The two
    criteria are the model's, also about actions that the rules do not offer.
    """

    politeness: float = Field(0.5, ge=0, le=1, description="Weight of the others' accelerations.")
    threshold: float = Field(0.1, ge=0, description="Least advantage of a lane change in m/s².")
    safe_braking: float = Field(
        4.0, gt=0, description="Hardest braking in m/s² that the follower in the new lane may need."
    )
    right_bias: float = Field(
        0.0, ge=0, description="Advantage in m/s² of the right lane where one keeps right; 0.3 in the paper."
    )

    def preferences(self, situations: Situations) -> Preferences:
        """Return the advantage of each action over keeping the lane [m/s²]; minus infinity if unsafe."""
        scenes = situations.scenes
        lanes = _Lanes.around(scenes)
        cars = [_Neighbours.of(scenes, lanes, lane) for lane in range(_LANES)]
        here = cars[Action.LANE_KEEPING]
        result = np.zeros((len(scenes.x), _LANES))
        freed = here.follower_alone - here.follower
        for action, bias in (
            (Action.LEFT_LANE_CHANGE, -self.right_bias),
            (Action.RIGHT_LANE_CHANGE, self.right_bias),
        ):
            there = cars[action]
            imposed = there.follower - there.follower_alone
            advantage = there.ego - here.ego + self.politeness * (imposed + freed)
            wanted = advantage - self.threshold + bias
            safe = there.is_free & (there.follower >= -self.safe_braking)
            possible = lanes.exists[:, action] & lanes.settled & safe
            result[:, action] = np.where(possible, wanted, -np.inf)
        return result


@dataclass(frozen=True, slots=True, eq=False)
class _Lanes:
    """The lanes that the actions lead to: `centre` [m], `limit` [m/s] and `exists`, shape (N, 3).

    `sign` (N,): that of the direction of travel; `settled` (N,): the ego is not changing lanes.
    """

    centre: Floats
    limit: Floats
    exists: Mask
    sign: Floats
    settled: Mask

    @classmethod
    def around(cls, scenes: SceneBatch) -> _Lanes:
        """Return those around the egos' target lanes."""
        rows = _table(scenes.roads)[scenes.road, scenes.target_lane]
        centre, limit = rows[:, :_LANES], rows[:, _LANES : 2 * _LANES]
        sign, tolerance = rows[:, -2], rows[:, -1]
        exists = np.isfinite(centre)
        settled = np.abs(scenes.y[:, 0] - centre[:, 0]) <= tolerance
        return cls(np.where(exists, centre, 0.0), limit, exists, sign, settled)


@lru_cache(maxsize=16)
def _table(roads: tuple[Road, ...]) -> Floats:
    """Return, by road and lane, the columns of `_Lanes`: three centres and limits, sign and tolerance.

    The centre is NaN where there is no lane.
    """
    last = max(lane.id for road in roads for lane in road.lanes)
    table = np.full((len(roads), last + 1, 2 * _LANES + 2), np.nan)
    for index, road in enumerate(roads):
        for lane in road.lanes:
            alike = road.lanes_of(lane.direction)
            # y points downward: the driver's left is on the side of smaller y if the lane heads right.
            from_left = alike if lane.direction.sign > 0 else alike[::-1]
            here = from_left.index(lane)
            beside = (
                lane,
                from_left[here - 1] if here else None,
                from_left[here + 1] if here + 1 < len(from_left) else None,
            )
            centres = [np.nan if one is None else one.centre for one in beside]
            limits = [lane.speed_limit if one is None else one.speed_limit for one in beside]
            table[index, lane.id] = [*centres, *limits, lane.direction.sign, road.centre_tolerance]
    return table


@dataclass(frozen=True, slots=True, eq=False)
class _Neighbours:
    """Accelerations [m/s²] with the ego in one lane, shape (N,).

    `ego`: of the ego behind the leader there; `follower`: of the follower there, behind the ego;
    `follower_alone`: of that follower without the ego; both 0 where there is none. `is_free` (N,): nobody
    is alongside there.
    """

    ego: Floats
    follower: Floats
    follower_alone: Floats
    is_free: Mask

    @classmethod
    def of(cls, scenes: SceneBatch, lanes: _Lanes, lane: int) -> _Neighbours:
        """Return the accelerations with all egos in one of the three lanes."""
        place = lanes.sign[:, None] * (scenes.x - scenes.x[:, :1])
        speed = np.maximum(lanes.sign[:, None] * scenes.vx, 0.0)
        side = np.abs(scenes.y - lanes.centre[:, lane, None])
        there = scenes.valid & (side < (scenes.width + scenes.width[:, :1]) / 2)
        there[:, 0] = False
        limit = lanes.limit[:, lane]
        leader, leads = _nearest(np.where(there & (place >= 0.0), place, np.inf))
        follower, follows = _nearest(np.where(there & (place < 0.0), -place, np.inf))
        rows = np.arange(len(place))

        def gap(rear: Integers, front: Integers, exists: Mask) -> Floats:
            """Return the gaps between the cars in one slot each and those in another, ahead of them."""
            reach = (scenes.length[rows, rear] + scenes.length[rows, front]) / 2
            return np.where(exists, place[rows, front] - place[rows, rear] - reach, np.inf)

        def behind(rear: Integers, front: Integers, exists: Mask) -> Floats:
            """Return the accelerations of the cars in one slot each behind those in another."""
            return idm_acceleration(gap(rear, front, exists), speed[rows, rear], speed[rows, front], limit)

        ego = np.zeros(len(place), dtype=np.int64)
        return cls(
            ego=behind(ego, leader, leads),
            is_free=(gap(ego, leader, leads) > 0.0) & (gap(follower, ego, follows) > 0.0),
            follower=np.where(follows, behind(follower, ego, follows), 0.0),
            follower_alone=np.where(follows, behind(follower, leader, leads), 0.0),
        )


def _nearest(distance: Floats) -> tuple[Integers, Mask]:
    """Return the slot of the least distance in each row, and whether it is finite."""
    slot = distance.argmin(axis=1)
    return slot, np.isfinite(distance[np.arange(len(distance)), slot])
