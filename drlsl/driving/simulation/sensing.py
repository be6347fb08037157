"""Sensing faults: the rules see other vehicles noisily, incompletely and late.

Errors of place and speed are first-order Gauss-Markov processes, one for each number of each vehicle; a
vehicle is lost and found again as a two-state Markov process; the sensed state is as old as the latency or,
soon after the ego was placed, as old as its presence on the road. The ego knows its own state exactly.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy, deepcopy
from dataclasses import replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from drlsl.driving.config import SensingConfig
from drlsl.driving.scene import SceneBatch
from drlsl.driving.simulation.playback import Courses, Playbacks, lane_table
from drlsl.traffic import FIRST, NUMBERS, Floats, Integers, Mask

_SEEN: Final = (*NUMBERS, "id", "lane", "there")
"""The fields of each vehicle that are remembered for the latency."""


class Sensing:
    """The sensing of N egos; each ego's faults come from a generator of its own."""

    def __init__(self, config: SensingConfig, playbacks: Playbacks, radar_range: float, count: int) -> None:
        self._config = config
        self._radar_range = radar_range
        self._films = playbacks.films
        self._lanes = lane_table([road.lanes for road in playbacks.roads], np.nan)
        slots = self._films.slots
        self._rngs = [np.random.default_rng() for _ in range(count)]
        self._errors = np.zeros((4, count, slots))
        self._lost = np.zeros((count, slots), dtype=np.bool_)
        # Age of the oldest look that may be shown; the present is one more.
        oldest = round(config.latency / float(playbacks.courses.dt.min()))
        shape = (oldest + 1, count, slots)
        self._ring: dict[str, npt.NDArray[Any]] = {
            name: np.zeros(shape, dtype=np.float64 if place < 6 else np.int64 if place < 8 else np.bool_)
            for place, name in enumerate(_SEEN)
        }
        self._now = np.zeros(count, dtype=np.int64)
        self._looks = np.zeros(count, dtype=np.int64)

    def begin(self, ego: int, rng: np.random.Generator) -> None:
        """Begin an episode whose faults are a function of the state of `rng`, which is left unchanged."""
        twin = type(rng.bit_generator)(0)
        twin.state = rng.bit_generator.state
        seed = np.random.Generator(twin).integers(2**32, size=4)
        self._rngs[ego] = np.random.default_rng(seed.tolist())

    def forget(self, ego: int) -> None:
        """Forget the past of an ego that was placed anew."""
        self._looks[ego] = 0

    def perceive(self, scenes: SceneBatch, courses: Courses, frame: Integers, places: Integers) -> SceneBatch:
        """Return what the egos in `places` see in `scenes`, shape (P,), in `frame` of their courses."""
        pieces = self._films.pieces(courses, frame)
        fresh = self._films.table[:, FIRST].take(pieces) == frame[:, None]
        fresh |= self._looks[places][:, None] == 0
        self._drift(courses, fresh, places)
        self._remember(scenes, pieces != courses.first_piece[:, None], places)
        return self.shown(scenes, courses, places)

    def taken(self, egos: Integers) -> Sensing:
        """Return the sensing of `egos`, as copies, one for each time that an ego is named."""
        result = copy(self)
        result._rngs = [deepcopy(self._rngs[ego]) for ego in egos.tolist()]
        result._errors, result._lost = self._errors[:, egos], self._lost[egos]
        result._ring = {name: array[:, egos] for name, array in self._ring.items()}
        result._now, result._looks = self._now[egos], self._looks[egos]
        return result

    def get_state(self) -> dict[str, Any]:
        """Return the faults and the remembered past."""
        return {
            "errors": self._errors.copy(),
            "lost": self._lost.copy(),
            "ring": {name: array.copy() for name, array in self._ring.items()},
            "now": self._now.copy(),
            "looks": self._looks.copy(),
            "rngs": [rng.bit_generator.state for rng in self._rngs],
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Take over what `get_state` gave."""
        self._errors, self._lost = state["errors"].copy(), state["lost"].copy()
        self._ring = {name: array.copy() for name, array in state["ring"].items()}
        self._now, self._looks = state["now"].copy(), state["looks"].copy()
        for rng, rng_state in zip(self._rngs, state["rngs"], strict=True):
            rng.bit_generator.state = rng_state

    def _drift(self, courses: Courses, fresh: Mask, places: Integers) -> None:
        """Advance the faults by one time step; those of `fresh` vehicles begin anew."""
        config = self._config
        normal = np.zeros((4, *fresh.shape))
        uniform = np.ones(fresh.shape)
        for index, (ego, slots) in enumerate(zip(places.tolist(), courses.slots.tolist(), strict=True)):
            # One draw for each slot of the ego's own recording, whatever the others' recordings have.
            normal[:, index, :slots] = self._rngs[ego].standard_normal((4, slots))
            uniform[index, :slots] = self._rngs[ego].random(slots)
        dt = courses.dt[:, None]
        kept = np.exp(-dt / config.noise_time) if config.noise_time else np.zeros_like(dt)
        old = self._errors[:, places]
        self._errors[:, places] = np.where(fresh, normal, kept * old + np.sqrt(1.0 - kept * kept) * normal)
        if config.drop_rate:
            share = config.drop_rate
            found = np.minimum(np.minimum(dt / config.drop_time, (1.0 - share) / share), 1.0)
            lost = found * share / (1.0 - share)
            chance = np.where(fresh, share, np.where(self._lost[places], 1.0 - found, lost))
            self._lost[places] = uniform < chance

    def _remember(self, scenes: SceneBatch, recorded: Mask, places: Integers) -> None:
        """Add the present measurements to the memory."""
        config, errors = self._config, self._errors[:, places]
        y = scenes.y + config.position_noise * errors[1]
        lane = scenes.lane
        if config.position_noise:
            lane = _lane_of(y, *self._lanes, scenes.road)
        self._now[places] = (self._now[places] + 1) % len(self._ring["x"])
        now = self._now[places]
        for name, values in zip(
            _SEEN,
            (
                scenes.x + config.position_noise * errors[0],
                y,
                scenes.vx + config.speed_noise * errors[2],
                scenes.vy + config.speed_noise * errors[3],
                scenes.length,
                scenes.width,
                scenes.id,
                lane,
                recorded & ~self._lost[places],
            ),
            strict=True,
        ):
            self._ring[name][now, places] = values
        self._looks[places] += 1

    def shown(self, scenes: SceneBatch, courses: Courses, places: Integers) -> SceneBatch:
        """Return the scenes with the others as last perceived, as old as the latency."""
        age = np.minimum(np.rint(self._config.latency / courses.dt).astype(np.int64), self._looks[places] - 1)
        at = (self._now[places] - age) % len(self._ring["x"])
        seen: dict[str, Any] = {name: array[at, places] for name, array in self._ring.items()}
        there = seen.pop("there")
        for name, values in seen.items():
            values[:, 0] = getattr(scenes, name)[:, 0]
        dx, dy = seen["x"] - seen["x"][:, :1], seen["y"] - seen["y"][:, :1]
        valid = there & (dx * dx + dy * dy <= self._radar_range**2)
        valid[:, 0] = True
        return replace(scenes, valid=valid, **seen)


def _lane_of(y: Floats, ids: Integers, centre: Floats, width: Floats, road: Integers) -> Integers:
    """Return the id of the lane whose strip holds each y (P, S), on roads (P,) of the tables; 0 for none."""
    inside = np.abs(y[..., None] - centre[road, None]) <= width[road, None] / 2
    found = np.take_along_axis(ids[road], inside.argmax(axis=2), axis=1)
    return np.where(inside.any(axis=2), found, 0)
