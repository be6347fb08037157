"""The fault of a contact: recorded vehicles do not see the ego, so contacts are judged.

The ego is at fault unless one of four written rules excuses it; every doubt is the ego's fault.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Final

import numpy as np

from drlsl.driving.simulation.controllers import LATERAL_ACCELERATION_LIMIT
from drlsl.traffic import Floats, Lane, Mask

BRAKING: Final = 6.0
"""The braking that a driver must be able to answer with [m/s²]. Source: UN R157, 5.2.5.2."""

REACTION: Final = 0.35
"""The time before that braking begins [s]. Source: UN R157, 5.2.5.2."""

INTRUSION: Final = 0.3
"""Distance over the line from which on a vehicle has come into a lane [m]. Source: UN R157, 5.2.5.2."""

LINE_TOLERANCE: Final = 0.05
"""Distance by which a body may cross the lane's edge and still count as wholly inside [m]."""


class Verdict(Enum):
    """The reason why a contact is not the ego's fault, or that it is."""

    AT_FAULT = "at_fault"
    STRUCK_FROM_BEHIND = "struck_from_behind"
    CUT_OFF = "cut_off"
    STRUCK_FROM_THE_SIDE = "struck_from_the_side"
    OUT_OF_NOWHERE = "out_of_nowhere"


@dataclass(frozen=True, slots=True)
class Track:
    """A vehicle's past up to the contact, oldest first, one row a frame; all arrays of shape (T,).

    `s` [m]: the centre along the road in the ego's direction of travel; `y` [m]: across the road; `speed`
    [m/s]: along s.
    """

    s: Floats
    y: Floats
    speed: Floats
    length: float
    width: float

    def last(self, count: int) -> Track:
        """Return the newest `count` rows."""
        return Track(self.s[-count:], self.y[-count:], self.speed[-count:], self.length, self.width)


def judge(ego: Track, other: Track, lanes: Sequence[Lane], dt: float, *, other_appeared: bool) -> Verdict:
    """Return the verdict on a contact in the newest frame of both tracks.

    `ego` begins where it was placed on the road, `other` where its unbroken track began, or at the ego's
    first row if that is later; `other_appeared`: the former, so the ego was on the road when the other's
    track began. `lanes`: those of the ego's direction. `dt` [s]: time between rows.
    """
    count = min(len(ego.s), len(other.s))
    seen = _Encounter(ego.last(count), other.last(count), tuple(lanes), dt, other_appeared)
    if seen.struck_from_behind():
        return Verdict.STRUCK_FROM_BEHIND
    if seen.cut_off():
        return Verdict.CUT_OFF
    if seen.struck_from_the_side():
        return Verdict.STRUCK_FROM_THE_SIDE
    if seen.out_of_nowhere():
        return Verdict.OUT_OF_NOWHERE
    return Verdict.AT_FAULT


def time_to_avoid(closing: float) -> float:
    """Return the time to collision [s] needed at a closing speed [m/s] to avoid the contact by braking.

    Source: UN R157, 5.2.5.2.
    """
    return closing / (2 * BRAKING) + REACTION


def _lane_at(y: float, lanes: Sequence[Lane]) -> Lane:
    return min(lanes, key=lambda lane: abs(lane.centre - y))


def _touches(track: Track, lane: Lane) -> Mask:
    return np.asarray(np.abs(track.y - lane.centre) < (lane.width + track.width) / 2)


def _intrudes(track: Track, lane: Lane) -> Mask:
    return np.asarray(np.abs(track.y - lane.centre) < (lane.width + track.width) / 2 - INTRUSION)


def _inside(track: Track, lane: Lane) -> Mask:
    room = (lane.width - track.width) / 2 + LINE_TOLERANCE
    return np.asarray(np.abs(track.y - lane.centre) <= room)


def _since(holds: Mask) -> int | None:
    """Return the first row of the unbroken run of True that ends in the newest row; None without one."""
    if not holds[-1]:
        return None
    breaks = np.flatnonzero(~holds)
    return int(breaks[-1]) + 1 if breaks.size else 0


@dataclass(frozen=True, slots=True)
class _Encounter:
    """Two tracks of equal length, up to a contact."""

    ego: Track
    other: Track
    lanes: tuple[Lane, ...]
    dt: float
    other_appeared: bool

    def _gap(self) -> Floats:
        """Return the distances from bumper to bumper, negative where the two overlap along the road."""
        apart = np.abs(self.other.s - self.ego.s)
        return np.asarray(apart - (self.ego.length + self.other.length) / 2)

    def _came_from(self) -> float:
        """Return where the other was when last apart along the road: +1 ahead, -1 behind, 0 never."""
        apart = np.flatnonzero(self._gap() > 0)
        return float(np.sign(self.other.s[apart[-1]] - self.ego.s[apart[-1]])) if apart.size else 0.0

    def _met_sideways(self) -> bool:
        """Return whether the two were alongside, their sides apart, in the frame before the contact."""
        return len(self.ego.s) > 1 and bool(self._gap()[-2] <= 0)

    def _left_time(self, row: int, *, rear: Track, front: Track) -> bool:
        """Return whether at `row` the time to collision let the rear vehicle brake behind the front one."""
        closing = float(rear.speed[row] - front.speed[row])
        gap = float(self._gap()[row])
        if gap <= 0:
            return False
        return closing <= 0 or gap / closing >= time_to_avoid(closing)

    def _other_had_time(self, row: int) -> bool:
        """Return whether at `row` the other was behind, with time to brake for the ego."""
        behind = bool(self.other.s[row] < self.ego.s[row])
        return behind and self._left_time(row, rear=self.other, front=self.ego)

    def _ego_kept_lane_since_before(self, row: int) -> bool:
        """Return whether the ego was wholly in its present lane from before `row` on."""
        inside = _since(_inside(self.ego, _lane_at(float(self.ego.y[-1]), self.lanes)))
        return inside is not None and inside < row

    def struck_from_behind(self) -> bool:
        """Return whether the other came from behind, with time to brake for an ego in its way."""
        if self._met_sideways() or self._came_from() >= 0:
            return False
        shared = self._shared_lanes()
        in_good_time = bool(shared) and all(self._was_in_good_time(lane) for lane in shared)
        return in_good_time or self._followed_at_its_last_chance()

    def _followed_at_its_last_chance(self) -> bool:
        """Return whether both were wholly in one lane when the other, behind, last had time to brake.

        Later movements do not matter: the other did not brake for the ego ahead in its lane.
        """
        for row in reversed(range(len(self.ego.s))):
            if self._other_had_time(row):
                return any(
                    _inside(self.ego, lane)[row] and _inside(self.other, lane)[row] for lane in self.lanes
                )
        return False

    def _shared_lanes(self) -> list[Lane]:
        """Return the lanes that both have come into at the contact, or else the lanes that both touch."""
        for is_in in (_intrudes, _touches):
            shared = [
                lane for lane in self.lanes if is_in(self.ego, lane)[-1] and is_in(self.other, lane)[-1]
            ]
            if shared:
                return shared
        return []

    def _was_in_good_time(self, lane: Lane) -> bool:
        """Return whether the ego was in `lane` before the other came in behind, or left it time to brake."""
        entered, inside = _since(_touches(self.ego, lane)), _since(_inside(self.ego, lane))
        if self.other_appeared and inside == 0:
            return True
        moved_in = _since(_intrudes(self.other, lane))
        if moved_in and entered is not None and entered < moved_in and _inside(self.ego, lane)[moved_in]:
            return True
        rows = [row for row in (entered, inside) if row is not None]
        return any(map(self._other_had_time, rows))

    def _other_entered(self) -> int | None:
        """Return the row in which the other came into the ego's lane; None if it was always inside."""
        entered = _since(_intrudes(self.other, _lane_at(float(self.ego.y[-1]), self.lanes)))
        return entered if entered else None

    def cut_off(self) -> bool:
        """Return whether the ego kept its lane and the other entered it ahead, too late to brake for."""
        entered = self._other_entered()
        if entered is None or self._came_from() <= 0 or not self._ego_kept_lane_since_before(entered):
            return False
        return not self._left_time(entered, rear=self.ego, front=self.other)

    def struck_from_the_side(self) -> bool:
        """Return whether the ego kept its lane and the other, alongside, moved sideways into it.

        Likewise if the other swerved past the ego in that lane, where it had been behind with time to brake.
        """
        if not self._met_sideways():
            return False
        entered = self._other_entered()
        if entered is None:
            return self._came_from() < 0 and self._swerved_past()
        return self._ego_kept_lane_since_before(entered)

    def _swerved_past(self) -> bool:
        """Return whether the other was once wholly in the ego's lane behind it; the ego kept that lane."""
        lane = _lane_at(float(self.ego.y[-1]), self.lanes)
        return any(
            self._other_had_time(row)
            and bool(_inside(self.other, lane)[row])
            and self._ego_kept_lane_since_before(row + 1)
            for row in range(len(self.ego.s))
        )

    def out_of_nowhere(self) -> bool:
        """Return whether the other appeared inside a stopping distance, along or across the road."""
        return self.other_appeared and (self._appeared_in_the_way() or self._appeared_beside())

    def _appeared_in_the_way(self) -> bool:
        """Return whether whichever of the two was behind could not stop, nor has had the time to."""
        rear = self.other if self.other.s[0] < self.ego.s[0] else self.ego
        return self._surprised(float(self._gap()[0]), float(rear.speed[0]), BRAKING)

    def _appeared_beside(self) -> bool:
        """Return whether the other appeared alongside an ego that moved towards it and could not stop.

        One that moves away has both the distance and the time.
        """
        if len(self.ego.s) < 2 or self._gap()[0] > 0:
            return False
        offset = float(self.other.y[0] - self.ego.y[0])
        towards = float(np.sign(offset) * (self.ego.y[1] - self.ego.y[0])) / self.dt
        apart = abs(offset) - (self.ego.width + self.other.width) / 2
        return self._surprised(apart, towards, LATERAL_ACCELERATION_LIMIT)

    def _surprised(self, distance: float, speed: float, braking: float) -> bool:
        """Return whether there was neither the distance [m] nor, since the other appeared, the time to stop.

        `speed` [m/s] is what the one that had to stop had, `braking` [m/s²] what it stops with.
        """
        stopping_time = REACTION + speed / braking
        stopping_distance = speed * REACTION + speed * speed / (2 * braking)
        since = (len(self.ego.s) - 1) * self.dt
        return distance <= stopping_distance and since <= stopping_time
