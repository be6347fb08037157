"""The egos: their places, their target lanes, their controllers and their past tracks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from drlsl.driving.scene import CENTRE_TOLERANCE, Action, taken_rows
from drlsl.driving.simulation.controllers import LaneController, SpeedController, move, move_forward
from drlsl.driving.simulation.entry import Entry
from drlsl.driving.simulation.fault import Track
from drlsl.driving.simulation.playback import Courses
from drlsl.errors import UserError
from drlsl.traffic import Floats, Integers, Mask


@dataclass(slots=True)
class Places:
    """The places of N egos: arrays of shape (N,) in road coordinates; `speed` is along the heading."""

    x: Floats
    y: Floats
    speed: Floats
    vy: Floats
    target_lane: Integers
    target_y: Floats
    playback: Integers
    frame: Integers
    distance: Floats
    ended: Mask

    @classmethod
    def new(cls, count: int) -> Places:
        """Return egos that are nowhere yet."""
        x, y, speed, vy, target_y, distance = (np.zeros(count) for _ in range(6))
        target_lane, playback, frame = (np.zeros(count, dtype=np.int64) for _ in range(3))
        ended = np.ones(count, dtype=np.bool_)
        return cls(x, y, speed, vy, target_lane, target_y, playback, frame, distance, ended)


@dataclass(slots=True)
class Past:
    """The newest rows of every ego's track, x, y and speed, in a ring of shape (T, 3, N).

    All egos write in the same row. `kept` (N,): the number of valid rows of each ego.
    """

    rows: Floats
    kept: Integers
    now: int = 0

    @classmethod
    def new(cls, count: int, length: int) -> Past:
        """Return an empty past."""
        return cls(np.zeros((length, 3, count)), np.zeros(count, dtype=np.int64))

    def begin(self, ego: int, at: Places) -> None:
        """Restart an ego's track at the present."""
        self.rows[self.now, :, ego] = at.x[ego], at.y[ego], at.speed[ego]
        self.kept[ego] = 1

    def write(self, at: Places) -> None:
        """Add the present to every track."""
        self.now = (self.now + 1) % len(self.rows)
        row = self.rows[self.now]
        row[0], row[1], row[2] = at.x, at.y, at.speed
        self.kept += 1

    def taken(self, egos: Integers) -> Past:
        """Return the tracks of `egos`, as copies."""
        return Past(self.rows[:, :, egos], self.kept[egos], self.now)

    def motion(self, dt: Floats) -> tuple[Floats, Floats]:
        """Return acceleration [m/s²] and jerk [m/s³] along the road, shape (N,); 0 where not yet known."""
        speed, before, earlier = (self.rows[(self.now - back) % len(self.rows), 2] for back in range(3))
        change = np.where(self.kept >= 2, speed - before, 0.0) / dt
        jerk = np.where(self.kept >= 3, change - (before - earlier) / dt, 0.0) / dt
        return change, jerk

    def track(self, index: int, sign: int, size: tuple[float, float]) -> Track:
        """Return one ego's track, oldest first."""
        kept = min(int(self.kept[index]), len(self.rows))
        x, y, speed = self.rows[(self.now + 1 - kept + np.arange(kept)) % len(self.rows), :, index].T
        return Track(sign * x, y, speed, *size)


class Egos:
    """N egos and their controllers. After its episode, an ego's state is undefined."""

    def __init__(self, count: int, size: tuple[float, float], memory: int) -> None:
        """Make `count` egos of a `size`, length and width [m], each with `memory` rows of its track."""
        self.at = Places.new(count)
        self.past = Past.new(count, memory)
        self.size = size
        self._speed_control = SpeedController.for_egos(count)
        self._lane_control = LaneController.for_egos(count)

    def place(self, ego: int, entry: Entry) -> None:
        """Put an ego at an entry, with its controllers and its past reset."""
        at = self.at
        at.frame[ego], at.x[ego], at.speed[ego] = entry.frame, entry.x, entry.speed
        at.y[ego] = at.target_y[ego] = entry.lane.centre
        at.vy[ego], at.target_lane[ego] = 0.0, entry.lane.id
        self._speed_control.reset(ego)
        self._lane_control.reset(ego)
        self.past.begin(ego, at)

    def steer(self, actions: npt.NDArray[np.integer], lane_to_keep: Integers, courses: Courses) -> Mask:
        """Set the lanes to steer for; return the mask of the egos that start a lane change, shape (N,).

        Raises:
            UserError: a lane to keep is not one of the ego's direction.
        """
        at = self.at
        changed = np.zeros(len(actions), dtype=np.bool_)
        # Both are nearly always empty.
        who = actions.nonzero()[0]
        if who.size:
            who = who[self._settled()[who] & ~at.ended[who]]
            changed[who] = True
            at.target_lane[who], at.target_y[who] = _lane_beside(
                courses.take(who), at.target_lane[who], _turn(actions[who])
            )
        who = (lane_to_keep != at.target_lane).nonzero()[0]
        if who.size:
            who = who[~changed[who] & ~at.ended[who]]
            at.target_y[who] = _centre(courses.take(who), lane_to_keep[who])
            at.target_lane[who] = lane_to_keep[who]
        return changed

    def targets(self, lane_to_keep: Integers, courses: Courses, places: Integers) -> Floats:
        """Return the y [m] that each action would steer for, shape (P, 3), for the egos in `places`.

        NaN for a lane change that would be ignored. On a side without a lane, it is beyond the road.
        """
        at, courses = self.at, courses.take(places)
        lane, y = at.target_lane[places], at.target_y[places]
        result = np.full((len(places), len(Action)), np.nan)
        result[:, Action.LANE_KEEPING] = y
        other = lane_to_keep != lane
        if other.any():
            result[other, Action.LANE_KEEPING] = _centre(
                courses.take(other.nonzero()[0]), lane_to_keep[other]
            )
        settled = self._settled()[places]
        for action in (Action.LEFT_LANE_CHANGE, Action.RIGHT_LANE_CHANGE):
            _, beside = _lane_beside(courses, lane, _turn(np.array(action)))
            result[settled, action] = beside[settled]
        return result

    def drive(self, target_speed: Floats, comfortable_acceleration: Floats, courses: Courses) -> None:
        """Run the controllers and move the egos and the recording on by one frame.

        `target_speed` [m/s] and `comfortable_acceleration` [m/s²], of shape (N,), are the rules' answers.
        """
        at, dt = self.at, courses.dt
        ax = self._speed_control.acceleration(at.speed, target_speed, comfortable_acceleration, dt)
        ay = self._lane_control.acceleration(at.y, at.vy, at.target_y, dt)
        along, at.speed = move_forward(at.speed, ax, dt)
        at.x = at.x + courses.sign * along
        at.y, at.vy = move(at.y, at.vy, ay, dt)
        at.frame = at.frame + 1
        at.distance += along
        self.past.write(at)

    def off_road(self, courses: Courses) -> Mask:
        """Return whether any part of an ego is beyond the lanes of its direction, shape (N,)."""
        half = self.size[1] / 2
        return np.asarray((self.at.y - half < courses.low) | (self.at.y + half > courses.high))

    def taken(self, egos: Integers) -> Egos:
        """Return copies of `egos`, one for each time that an ego is named."""
        result = Egos(len(egos), self.size, 0)
        result.at = taken_rows(self.at, egos)
        result.past = self.past.taken(egos)
        result._speed_control = taken_rows(self._speed_control, egos)
        result._lane_control = taken_rows(self._lane_control, egos)
        return result

    def get_state(self) -> dict[str, Any]:
        """Return the places of the egos, and the memory of them and their controllers."""
        return {
            "at": {field.name: getattr(self.at, field.name).copy() for field in fields(self.at)},
            "past": {"rows": self.past.rows.copy(), "kept": self.past.kept.copy(), "now": self.past.now},
            "integrals": [self._speed_control.integral.copy(), self._lane_control.integral.copy()],
            "acceleration": self._speed_control.last.copy(),
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Take over what `get_state` gave; accelerations that an earlier version did not have count as 0."""
        self.at = Places(**{name: array.copy() for name, array in state["at"].items()})
        past = state["past"]
        self.past = Past(past["rows"].copy(), past["kept"].copy(), past["now"])
        speed, lane = state["integrals"]
        last = state.get("acceleration", np.zeros_like(speed))
        self._speed_control = SpeedController(speed.copy(), last.copy())
        self._lane_control = LaneController(lane.copy())

    def _settled(self) -> Mask:
        """Return the mask of the egos that would start a lane change, shape (N,)."""
        return np.asarray(np.abs(self.at.target_y - self.at.y) <= CENTRE_TOLERANCE)


def _turn(actions: npt.NDArray[np.integer]) -> npt.NDArray[np.integer]:
    """Return +1 for a lane change to the left, -1 to the right."""
    return np.where(actions == Action.LEFT_LANE_CHANGE, 1, -1)


def _lane_beside(courses: Courses, lane: Integers, turn: npt.NDArray[np.integer]) -> tuple[Integers, Floats]:
    """Return the next lane to a side and its centre [m]; without one, the same lane and where it would be."""
    rows = np.arange(len(lane))
    here = (courses.lane_id == lane[:, None]).argmax(axis=1)
    # y points downward: for an ego heading right, left is down the list of lanes.
    step = -turn * courses.sign.astype(np.int64)
    there = np.minimum(np.maximum(here + step, 0), courses.lanes - 1)
    beyond = courses.centre[rows, here] + step * courses.width[rows, here]
    y = np.where(there == here, beyond, courses.centre[rows, there])
    return courses.lane_id[rows, there], y


def _centre(courses: Courses, lane: Integers) -> Floats:
    """Return the centres [m] of lanes of the direction.

    Raises:
        UserError: one is not a lane of the direction.
    """
    named = courses.lane_id == lane[:, None]
    unknown = ~named.any(axis=1)
    if unknown.any():
        raise UserError(
            f"lane_to_keep/1 names lane {lane[unknown][0]}, which the road does not have in the ego's "
            "direction"
        )
    return np.asarray(courses.centre[named])
