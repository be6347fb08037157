"""The egos: their places, their target lanes, their controllers and their past tracks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from drlsl.driving.scene import Action, taken_rows
from drlsl.driving.simulation.ego_loops import NO_ONE, drive, find_targets, steer
from drlsl.driving.simulation.entry import Entry
from drlsl.driving.simulation.fault import Track
from drlsl.driving.simulation.playback import Courses
from drlsl.errors import UserError
from drlsl.lowering.backends import machine_code
from drlsl.traffic import Floats, Integers, Mask


@dataclass(slots=True)
class Places:
    """The places of N egos: arrays of shape (N,) in road coordinates; `speed` is along the heading.

    They change in place.
    """

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

    def turn(self) -> int:
        """Go on to the next row, in which the egos are to write; return its index."""
        self.now = (self.now + 1) % len(self.rows)
        return self.now

    def taken(self, egos: Integers) -> Past:
        """Return the tracks of `egos`, as copies."""
        return Past(self.rows.take(egos, axis=2), self.kept[egos], self.now)

    def track(self, index: int, sign: int, size: tuple[float, float]) -> Track:
        """Return one ego's track, oldest first."""
        kept = min(int(self.kept[index]), len(self.rows))
        x, y, speed = self.rows[(self.now + 1 - kept + np.arange(kept)) % len(self.rows), :, index].T
        return Track(sign * x, y, speed, *size)


@dataclass(slots=True)
class Control:
    """The memory of the controllers of N egos, shape (N,).

    The integrals of speed [m] and of the place across the road [m s], and the last acceleration [m/s²].
    """

    speed_integral: Floats
    lane_integral: Floats
    acceleration: Floats

    @classmethod
    def new(cls, count: int) -> Control:
        """Return controllers at rest."""
        return cls(*(np.zeros(count) for _ in fields(cls)))

    def reset(self, ego: int) -> None:
        """Forget the past of an ego: it drives at a constant speed."""
        self.speed_integral[ego] = self.lane_integral[ego] = self.acceleration[ego] = 0.0


class Egos:
    """N egos and their controllers. After its episode, an ego's state is undefined."""

    def __init__(self, count: int, size: tuple[float, float], memory: int) -> None:
        """Make `count` egos of a `size`, length and width [m], each with `memory` rows of its track."""
        self.at = Places.new(count)
        self.past = Past.new(count, memory)
        self.size = size
        self._control = Control.new(count)

    def place(self, ego: int, entry: Entry) -> None:
        """Put an ego at an entry, with its controllers and its past reset."""
        at = self.at
        at.frame[ego], at.x[ego], at.speed[ego] = entry.frame, entry.x, entry.speed
        at.y[ego] = at.target_y[ego] = entry.lane.centre
        at.vy[ego], at.target_lane[ego] = 0.0, entry.lane.id
        self._control.reset(ego)
        self.past.begin(ego, at)

    def steer(self, actions: Integers, lane_to_keep: Integers, courses: Courses) -> Mask:
        """Set the lanes to steer for; return the mask of the egos that start a lane change, shape (N,).

        Raises:
            UserError: a lane to keep is not one of the ego's direction.
        """
        at, changed = self.at, np.empty(len(actions), dtype=np.bool_)
        stray = machine_code(steer)(
            actions, lane_to_keep, at.y, at.ended, at.target_lane, at.target_y, *courses.across, changed
        )
        _check_known(stray, lane_to_keep)
        return changed

    def targets(self, lane_to_keep: Integers, courses: Courses, places: Integers) -> Floats:
        """Return the y [m] that each action would steer for, shape (P, 3), for the egos in `places`.

        NaN for a lane change that would be ignored. On a side without a lane, it is beyond the road.

        Raises:
            UserError: a lane to keep, of shape (P,), is not one of the ego's direction.
        """
        at, found = self.at, np.empty((len(places), len(Action)))
        stray = machine_code(find_targets)(
            places, lane_to_keep, at.y, at.target_lane, at.target_y, *courses.across, found
        )
        _check_known(stray, lane_to_keep)
        return found

    def drive(self, target_speed: Floats, comfortable_acceleration: Floats, courses: Courses) -> None:
        """Run the controllers and move the egos and the recording on by one frame.

        `target_speed` [m/s] and `comfortable_acceleration` [m/s²], of shape (N,), are the rules' answers.
        """
        at, control, past = self.at, self._control, self.past
        machine_code(drive)(
            target_speed,
            comfortable_acceleration,
            at.x,
            at.y,
            at.speed,
            at.vy,
            at.target_y,
            at.frame,
            at.distance,
            control.speed_integral,
            control.lane_integral,
            control.acceleration,
            courses.sign,
            courses.dt,
            past.rows,
            past.turn(),
            past.kept,
        )

    def taken(self, egos: Integers) -> Egos:
        """Return copies of `egos`, one for each time that an ego is named."""
        result = Egos(len(egos), self.size, 0)
        result.at = taken_rows(self.at, egos)
        result.past = self.past.taken(egos)
        result._control = taken_rows(self._control, egos)
        return result

    def get_state(self) -> dict[str, Any]:
        """Return the places of the egos, and the memory of them and their controllers."""
        return {
            "at": {field.name: getattr(self.at, field.name).copy() for field in fields(self.at)},
            "past": {"rows": self.past.rows.copy(), "kept": self.past.kept.copy(), "now": self.past.now},
            "integrals": [self._control.speed_integral.copy(), self._control.lane_integral.copy()],
            "acceleration": self._control.acceleration.copy(),
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Take over what `get_state` gave; accelerations that an earlier version did not have count as 0."""
        self.at = Places(**{name: array.copy() for name, array in state["at"].items()})
        past = state["past"]
        self.past = Past(past["rows"].copy(), past["kept"].copy(), past["now"])
        speed, lane = state["integrals"]
        last = state.get("acceleration", np.zeros_like(speed))
        self._control = Control(speed.copy(), lane.copy(), last.copy())


def _check_known(stray: int, lane_to_keep: Integers) -> None:
    """Check that no lane to keep is `stray`, the place of one that the road does not have.

    Raises:
        UserError: one is.
    """
    if stray != NO_ONE:
        raise UserError(
            f"lane_to_keep/1 names lane {lane_to_keep[stray]}, which the road does not have in the ego's "
            "direction"
        )
