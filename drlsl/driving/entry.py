"""Where the ego enters the road: a gap that the rules call safe."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from drlsl.driving.batch import EGO_ID, SceneBatch
from drlsl.driving.playback import NUMBERS, Playback
from drlsl.driving.shield import Shield
from drlsl.errors import UserError
from drlsl.traffic.road import Lane

Floats: TypeAlias = npt.NDArray[np.float64]
Integers: TypeAlias = npt.NDArray[np.int64]

OFFSET: Final = 60.0
"""How far into the recorded stretch the ego enters at least [m], so that it sees who follows."""

ZONE: Final = 80.0
"""Length of the part of the road where the ego enters [m]."""

PLACES: Final = 8
"""Places tried in each lane of one frame."""

PAUSE: Final = 0.5
"""Time between two frames that are searched for a gap [s]."""


@dataclass(frozen=True, slots=True)
class Entry:
    """A place to enter: frame, lane, x [m] and speed [m/s]."""

    frame: int
    lane: Lane
    x: float
    speed: float


@dataclass(frozen=True, slots=True, eq=False)
class _Places:
    """Places at one frame; of shape (P,): `lane`, an index of the playback's, `x` [m] and `speed` [m/s]."""

    frame: int
    lane: Integers
    x: Floats
    speed: Floats

    def centre(self, playback: Playback) -> Floats:
        return np.array([lane.centre for lane in playback.lanes])[self.lane]

    def lane_id(self, playback: Playback) -> Integers:
        return np.array([lane.id for lane in playback.lanes])[self.lane]

    def entry(self, playback: Playback, place: int) -> Entry:
        lane = playback.lanes[int(self.lane[place])]
        return Entry(self.frame, lane, float(self.x[place]), float(self.speed[place]))


def find_entry(
    playback: Playback,
    shield: Shield,
    rng: np.random.Generator,
    *,
    frame: int,
    size: tuple[float, float],
    lane: Lane | None = None,
) -> Entry:
    """A place early on the road, drawn among those that the rules call safe, at `frame` or soon after.

    The ego has the speed of the traffic there; `size` is its length and width [m]. `lane` is taken if there
    is a gap in it.

    Raises:
        UserError: no frame of the recording has such a gap.
    """
    step = max(1, round(PAUSE / playback.road.time_step))
    for start in range(frame, frame + playback.frames, step):
        places = _candidates(playback, start % playback.frames, rng)
        safe = np.flatnonzero(shield.entries_are_safe(_scenes(playback, places, size)))
        preferred = safe if lane is None else safe[places.lane_id(playback)[safe] == lane.id]
        choices = preferred if preferred.size else safe
        if choices.size:
            return places.entry(playback, int(choices[rng.integers(choices.size)]))
    raise UserError(
        f"no gap that the rules call safe in {playback.frames} frames of {playback.direction.value} traffic; "
        "use a recording with less traffic or rules that ask for less room"
    )


def _candidates(playback: Playback, frame: int, rng: np.random.Generator) -> _Places:
    """Places in every lane at one frame, each with the speed of the traffic around it."""
    begin = min(OFFSET, playback.length / 4)
    edges = np.linspace(begin, min(begin + ZONE, playback.length / 2), PLACES + 1)
    along = rng.uniform(edges[:-1], edges[1:], (len(playback.lanes), PLACES)).ravel()
    lanes = np.repeat(np.arange(len(playback.lanes)), PLACES)
    x = np.asarray(playback.at(along))
    return _Places(frame, lanes, x, _traffic_speed(playback, frame, lanes, x))


def _traffic_speed(playback: Playback, frame: int, lanes: Integers, x: Floats) -> Floats:
    """The mean speed of the nearest vehicles in front and behind, at most the limit; the limit if alone."""
    film = playback.film
    ids = np.array([lane.id for lane in playback.lanes])
    limits = np.array([lane.speed_limit for lane in playback.lanes])[lanes]
    offset = playback.sign * (film.numbers[0, frame] - x[:, None])
    speed = playback.sign * film.numbers[2, frame]
    seen = film.valid[frame] & (film.lane[frame] == ids[lanes][:, None])
    seen &= np.abs(offset) <= playback.road.radar_range
    total, found = np.zeros(len(x)), np.zeros(len(x))
    for side in (seen & (offset >= 0), seen & (offset < 0)):
        nearest = np.where(side, np.abs(offset), np.inf).argmin(axis=1)
        there = side.any(axis=1)
        total += np.where(there, speed[nearest], 0.0)
        found += there
    mean = np.where(found > 0, total / np.maximum(found, 1.0), limits)
    return np.asarray(np.minimum(np.maximum(mean, 0.0), limits))


def _scenes(playback: Playback, places: _Places, size: tuple[float, float]) -> SceneBatch:
    """The scenes with the ego at each place."""
    film, frame, count = playback.film, places.frame, len(places.x)
    slots = np.flatnonzero(film.valid[frame])
    shape = (count, slots.size + 1)
    numbers = np.empty((len(NUMBERS), *shape))
    numbers[:, :, 1:] = film.numbers[:, frame, slots][:, None, :]
    own: list[Floats | float] = [places.x, places.centre(playback), playback.sign * places.speed, 0.0, *size]
    for column, value in zip(numbers, own, strict=True):
        column[:, 0] = value
    vehicle, lane = np.empty((2, *shape), dtype=np.int64)
    vehicle[:, 0], vehicle[:, 1:] = EGO_ID, film.vehicle[frame, slots]
    lane[:, 0], lane[:, 1:] = places.lane_id(playback), film.lane[frame, slots]
    dx, dy = numbers[0] - numbers[0, :, :1], numbers[1] - numbers[1, :, :1]
    return SceneBatch.from_numbers(
        numbers,
        roads=(playback.road,),
        road=np.zeros(count, dtype=np.int64),
        target_lane=lane[:, 0],
        id=vehicle,
        lane=lane,
        valid=dx * dx + dy * dy <= playback.road.radar_range**2,
    )
