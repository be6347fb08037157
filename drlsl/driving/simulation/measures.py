"""Measures of comfort, safety and consideration, taken in every frame of an episode."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Final

import numpy as np

from drlsl.driving.scene import SceneBatch
from drlsl.traffic import Floats, Integers, Mask

HARD_BRAKING: Final = 3.0
"""Braking [m/s²] beyond which it counts as hard."""

SHORT_TTC: Final = 4.0
"""Time to collision [s] below which it counts as short.

Source: Hydén, The development of a method for traffic safety evaluation (1987); ISO 15623, 6.2.
"""

HEADWAY_STEP: Final = 0.05
"""Width of a class of time headways [s]."""

HEADWAY_CLASSES: Final = 121
"""Number of classes of time headways; the last one holds all from 6 s on."""

_LEAST_SPEED: Final = 1.0
"""Speed [m/s] below which the ego has no time headway."""

_NOBODY: Final = -1


@dataclass(frozen=True, slots=True)
class EpisodeMeasures:
    """The measures of one episode; see `Measures`."""

    time: float
    jerk_square: float
    hard_braking: float
    short_ttc: float
    windows: float
    imposed: float
    imposed_hard: float
    headways: tuple[float, ...]


_SINGLE: Final = tuple(field.name for field in fields(EpisodeMeasures) if field.name != "headways")


@dataclass(frozen=True, slots=True, eq=False)
class Measures:
    """Totals of N episodes up to now; of shape (N,), times in seconds.

    `time` driven; `jerk_square`: the integral of the squared jerk [m²/s⁵]; `hard_braking`: time of braking
    harder than 3 m/s²; `short_ttc`: time with a time to collision below 4 s to the leader in the ego's lane;
    `windows`: how often a lane change began to be offered; `imposed`: the hardest braking of the follower in
    the ego's lane [m/s²]; `imposed_hard`: time of it braking harder than 3 m/s²; `headways` (N, 121): time in
    each class of 0.05 s of the time headway to the leader in the ego's lane.
    """

    time: Floats
    jerk_square: Floats
    hard_braking: Floats
    short_ttc: Floats
    windows: Floats
    imposed: Floats
    imposed_hard: Floats
    headways: Floats

    @classmethod
    def new(cls, count: int) -> Measures:
        """Return the totals of `count` episodes before their first frame."""
        return cls(**{name: np.zeros(count) for name in _SINGLE}, headways=np.zeros((count, HEADWAY_CLASSES)))

    def as_columns(self) -> dict[str, Floats]:
        """Return copies of the arrays by name."""
        return {field.name: getattr(self, field.name).copy() for field in fields(self)}


def measures_of(columns: Mapping[str, Floats], ego: int) -> EpisodeMeasures:
    """Return the measures of one episode from the columns of `Measures.as_columns`."""
    single = {name: float(columns[name][ego]) for name in _SINGLE}
    return EpisodeMeasures(**single, headways=tuple(columns["headways"][ego].tolist()))


def headway_quantile(headways: Floats, share: float) -> float | None:
    """Return the time headway [s] that is not exceeded for a `share` of the time; None without a leader.

    `headways`: the time in each class, shape (121,). The upper end of a class stands for it.
    """
    passed = np.cumsum(headways)
    if passed[-1] <= 0.0:
        return None
    return float((np.searchsorted(passed, share * passed[-1]) + 1) * HEADWAY_STEP)


class Meter:
    """Takes the measures of N egos, frame by frame."""

    def __init__(self, count: int) -> None:
        self.totals = Measures.new(count)
        self._offered = np.zeros(count, dtype=np.bool_)
        self._follower = np.full(count, _NOBODY)
        self._follower_speed = np.zeros(count)
        self._rows = np.arange(count)

    def begin(self, ego: int) -> None:
        """Begin an episode."""
        for field in fields(self.totals):
            getattr(self.totals, field.name)[ego] = 0.0
        self._offered[ego] = False
        self.forget(ego)

    def forget(self, ego: int) -> None:
        """Forget the follower of an ego that is placed anew."""
        self._follower[ego] = _NOBODY

    def add(
        self,
        playing: Mask,
        scenes: SceneBatch,
        mask: Mask,
        motion: tuple[Floats, Floats],
        *,
        sign: Floats,
        dt: Floats,
    ) -> None:
        """Add a frame to the episodes that `playing` marks: the true scenes and the offers after it.

        `mask` (N, 3): the actions offered. Of shape (N,): `motion`, the egos' acceleration [m/s²] and jerk
        [m/s³]; `sign` of motion along x; `dt` [s].
        """
        totals, (acceleration, jerk) = self.totals, motion
        step = np.where(playing, dt, 0.0)
        totals.time[:] += step
        totals.jerk_square[:] += step * jerk * jerk
        totals.hard_braking[:] += step * (acceleration < -HARD_BRAKING)
        offered = mask[:, 1:].any(axis=1)
        totals.windows[:] += playing & offered & ~self._offered
        self._offered = np.where(playing, offered, self._offered)
        ahead = sign[:, None] * (scenes.x - scenes.x[:, :1])
        lane = scenes.valid & (scenes.lane == scenes.lane[:, :1])
        lane[:, 0] = False
        self._add_leader(step, scenes, sign, np.where(lane & (ahead >= 0.0), ahead, np.inf))
        self._add_follower(step, scenes, sign, np.where(lane & (ahead < 0.0), -ahead, np.inf), dt)

    def _add_leader(self, step: Floats, scenes: SceneBatch, sign: Floats, ahead: Floats) -> None:
        slot = ahead.argmin(axis=1)
        distance = ahead[self._rows, slot]
        gap = distance - (scenes.length[self._rows, slot] + scenes.length[:, 0]) / 2
        speed = np.abs(scenes.vx[:, 0])
        closing = speed - sign * scenes.vx[self._rows, slot]
        there = np.isfinite(distance) & (step > 0.0)
        short = there & (gap < SHORT_TTC * closing)
        self.totals.short_ttc[:] += step * short
        follows = np.flatnonzero(there & (speed >= _LEAST_SPEED))
        headway = np.maximum(gap[follows], 0.0) / speed[follows]
        group = np.minimum(headway / HEADWAY_STEP, HEADWAY_CLASSES - 1).astype(np.int64)
        self.totals.headways[follows, group] += step[follows]

    def _add_follower(
        self, step: Floats, scenes: SceneBatch, sign: Floats, behind: Floats, dt: Floats
    ) -> None:
        slot = behind.argmin(axis=1)
        there = np.isfinite(behind[self._rows, slot])
        who: Integers = np.where(there, scenes.id[self._rows, slot], _NOBODY)
        speed = sign * scenes.vx[self._rows, slot]
        same = there & (who == self._follower) & (step > 0.0)
        braking = np.where(same, (self._follower_speed - speed) / dt, 0.0)
        self.totals.imposed[:] = np.maximum(self.totals.imposed, braking)
        self.totals.imposed_hard[:] += step * (braking > HARD_BRAKING)
        self._follower, self._follower_speed = who, speed
