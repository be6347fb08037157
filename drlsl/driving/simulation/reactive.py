"""Traffic that reacts: recorded vehicles that brake for the ego instead of driving through it.

A vehicle drives its recorded track until the Intelligent Driver Model demands harder braking than the record
has, for the ego or for another vehicle that has left the record. From then on it drives a *lag* behind its
recorded place: across the road it is where it was recorded; along the road it follows the vehicle in its way,
and makes up for its lag if there is room. It is never ahead of the record, and disappears with its track.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from drlsl.driving.scene import BRAKING_LIMIT, SceneBatch
from drlsl.driving.simulation.fault import Track
from drlsl.driving.simulation.films import Films
from drlsl.driving.simulation.idm import COMFORTABLE_BRAKING, free_acceleration, idm_acceleration
from drlsl.driving.simulation.playback import Courses
from drlsl.traffic import FIRST, Floats, Integers, Mask

SIDE_ROOM: Final = 0.5
"""Sideways room [m] below which a vehicle ahead is in the way."""

_LOOKED_AT: Final = 30
"""Number of cars ahead, on all lanes, among which the leader is searched."""

_LEAST_LAG: Final = 1e-6
"""The lag of a vehicle that has left the record, but is back at its recorded place [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class _Cars:
    """Cars in N scenes, along the ego's direction of travel; all of shape (N, S).

    `there`: the ego, and every recorded vehicle that is not oncoming.
    """

    s: Floats
    y: Floats
    speed: Floats
    length: Floats
    width: Floats
    there: Mask

    @classmethod
    def of(cls, scenes: SceneBatch, sign: Floats, recorded: Mask) -> _Cars:
        speed = sign * scenes.vx
        there = recorded & (speed >= 0.0)
        there[:, 0] = True
        return cls(sign * scenes.x, scenes.y, speed, scenes.length, scenes.width, there)


class ReactiveTraffic:
    """The vehicles behind their record, around N egos; `lag` [m] >= 0 and `speed` [m/s], shape (N, S)."""

    def __init__(self, films: Films, count: int, memory: int) -> None:
        """Put all vehicles on the record; lags are remembered for `memory` steps."""
        self._films = films
        self.lag = np.zeros((count, films.slots))
        self.speed = np.zeros_like(self.lag)
        self._past: deque[tuple[Integers, Floats, Floats]] = deque(maxlen=memory)

    def forget(self, ego: int) -> None:
        """Put all vehicles around an ego back on the record."""
        self.lag[ego] = 0.0

    def advance(self, scenes: SceneBatch, courses: Courses, frame: Integers, reacts: Mask) -> None:
        """Drive from `frame`, shape (N,), in which the egos are in `scenes`, to the next one.

        Only around the egos that `reacts` (N,) marks.
        """
        cars = _Cars.of(scenes, courses.sign[:, None], self._films.valid(courses, frame))
        moving = self.lag.ravel() > 0.0
        rear, front = _followers(cars, self.lag > 0.0, reacts)
        moving[rear] = True
        places = moving.nonzero()[0]
        if places.size:
            demand = np.full(self.lag.size, np.inf)
            demand[rear] = _demand(cars, rear, front)
            self._drive(places, demand[places], cars.speed, courses, frame)
        lagging = self.lag.ravel().nonzero()[0]
        self._past.append((lagging, self.lag.ravel()[lagging], self.speed.ravel()[lagging]))

    def driven(self, ego: int, slot: int, track: Track) -> Track:
        """Return the track actually driven, for a recorded track that ends now."""
        s, speed = track.s.copy(), track.speed.copy()
        place = ego * self.lag.shape[1] + slot
        for back in range(1, min(len(s), len(self._past)) + 1):
            lagging, lag, driven = self._past[-back]
            index = int(np.searchsorted(lagging, place))
            if index < len(lagging) and lagging[index] == place:
                s[-back] -= lag[index]
                speed[-back] = driven[index]
        return replace(track, s=s, speed=speed)

    def taken(self, egos: Integers) -> ReactiveTraffic:
        """Return the vehicles around `egos`, as copies, one for each time that an ego is named."""
        result = ReactiveTraffic(self._films, len(egos), self._past.maxlen or 0)
        result.lag, result.speed = self.lag[egos], self.speed[egos]
        slots = self.lag.shape[1]
        for lagging, lag, speed in self._past:
            begin, end = np.searchsorted(lagging, egos * slots), np.searchsorted(lagging, (egos + 1) * slots)
            count = end - begin
            ego = np.repeat(np.arange(len(egos)), count)
            source = np.arange(count.sum()) + np.repeat(end - np.cumsum(count), count)
            places = lagging[source] + (ego - egos[ego]) * slots
            result._past.append((places, lag[source], speed[source]))
        return result

    def get_state(self) -> dict[str, Any]:
        """Return the present and remembered lags."""
        past = [np.concatenate(columns) for columns in zip(*self._past, strict=True)]
        counts = np.array([len(lagging) for lagging, _, _ in self._past], dtype=np.int64)
        return {"lag": self.lag.copy(), "speed": self.speed.copy(), "past": past, "counts": counts}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Take over what `get_state` gave."""
        self.lag, self.speed = state["lag"].copy(), state["speed"].copy()
        ends = np.cumsum(state["counts"])[:-1]
        columns = [np.split(column, ends) for column in state["past"]]
        self._past = deque(zip(*columns, strict=True), maxlen=self._past.maxlen)

    def _drive(
        self,
        places: Integers,
        demand: Floats,
        speeds: Floats,
        courses: Courses,
        frame: Integers,
    ) -> None:
        """Move the vehicles in `places` of (N, S) on from `frame`; `demand`: their accelerations [m/s²]."""
        films = self._films
        ego, slot = np.divmod(places, self.lag.shape[1])
        own, now, later = courses.take(ego), frame[ego], frame[ego] + 1
        sign, dt = own.sign, own.dt
        recorded_way = sign * (films.motion_of(own, 0, later, slot) - films.motion_of(own, 0, now, slot))
        recorded_speed = np.maximum(sign * films.motion_of(own, 2, later, slot), 0.0)
        lag, speed = self.lag[ego, slot], speeds[ego, slot]
        wanted = np.minimum(demand, free_acceleration(speed))
        leaves = (lag > 0.0) | (wanted < np.minimum(0.0, (recorded_speed - speed) / dt))
        # Catch up so that comfortable braking leads to the recorded place at the recorded speed.
        fastest = recorded_speed + np.sqrt(2 * COMFORTABLE_BRAKING * lag)
        new = np.maximum(np.minimum(speed + wanted * dt, fastest), speed - BRAKING_LIMIT * dt)
        new = np.maximum(new, 0.0)
        behind = lag + recorded_way - (speed + new) / 2 * dt
        back = (behind <= 0.0) & (new >= recorded_speed)
        piece = films.piece_of(own, later, slot)
        same = (piece != own.first_piece) & (films.table[piece, FIRST] < later)
        self.lag[ego, slot] = np.where(leaves & ~back & same, np.maximum(behind, _LEAST_LAG), 0.0)
        self.speed[ego, slot] = new


def _followers(cars: _Cars, lagging: Mask, reacts: Mask) -> tuple[Integers, Integers]:
    """Return the followers that lag, or whose leader is an ego or lags, and those nearest leaders.

    Egos that `reacts` (N,) does not mark count as nobody's leader.

    As places in the flattened scenes. Egos follow nobody.
    """
    slots = cars.s.shape[1]
    order = np.argsort(np.where(cars.there, cars.s, np.inf), axis=1, kind="stable")
    there, lags = (np.take_along_axis(array, order, axis=1) for array in (cars.there, lagging))
    y, reach = (np.take_along_axis(array, order, axis=1) for array in (cars.y, cars.width / 2))
    column, ego = np.arange(slots), order == 0
    leads = lags | (ego & reacts[:, None])
    # No other vehicle can be a follower.
    last = np.where(leads.any(axis=1), slots - 1 - leads[:, ::-1].argmax(axis=1), -1)
    waiting = there & ~ego & (lags | (column < last[:, None]))
    front = np.full(order.shape, -1)
    for ahead in range(1, min(_LOOKED_AT, slots - 1) + 1):
        if not waiting.any():
            break
        room = np.abs(y[:, ahead:] - y[:, :-ahead])
        room -= reach[:, ahead:]
        room -= reach[:, :-ahead]
        meets = room < SIDE_ROOM
        meets &= waiting[:, :-ahead]
        meets &= there[:, ahead:]
        np.copyto(front[:, :-ahead], column[ahead:], where=meets)
        waiting[:, :-ahead] &= ~meets
    scene, rear = (front >= 0).nonzero()
    leader = front[scene, rear]
    answers = lags[scene, rear] | leads[scene, leader]
    scene, rear, leader = scene[answers], rear[answers], leader[answers]
    return scene * slots + order[scene, rear], scene * slots + order[scene, leader]


def _demand(cars: _Cars, rear: Integers, front: Integers) -> Floats:
    """Return the IDM accelerations of the rear cars [m/s²]."""
    s, length, speed = cars.s.ravel(), cars.length.ravel(), cars.speed.ravel()
    gap = s[front] - s[rear] - (length[front] + length[rear]) / 2
    return idm_acceleration(gap, speed[rear], speed[front])
