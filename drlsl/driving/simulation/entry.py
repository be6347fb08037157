"""The ego's entry to the road: a gap that the rules call safe."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from drlsl.driving.config import TRACK_LENGTH, EnvConfig
from drlsl.driving.scene import EGO_ID, SceneBatch
from drlsl.driving.shield import Shield
from drlsl.driving.simulation.playback import Playback
from drlsl.errors import UserError
from drlsl.traffic import LANE, RAMP_LIMIT, UNIT, Floats, Integers, Lane, Mask

OFFSET: Final = 60.0
"""Least distance of an entry from the beginning of the stretch [m], so that the ego sees its follower."""

ZONE: Final = 80.0
"""Length of the part of the road where the ego enters [m]."""

PLACES: Final = 16
"""Places in each lane."""

PAUSE: Final = 0.5
"""Time between two frames that are searched for a gap [s]."""

AHEAD: Final = 4
"""Frames of a search per query of the rules."""

KEPT: Final = 1 << 19
"""Frames of all recordings together, about which the answers of the rules are kept: some 250 MB at most."""

RAMP_ZONE: Final = 40.0
"""Length of the part of a merging lane where the ego enters, from its beginning [m]."""

SLOW: Final = 10.0
"""Percentage of the recorded speeds that are slower than the ego is expected to be."""


@dataclass(frozen=True, slots=True)
class Entry:
    """A place to enter: frame, lane, x [m] and speed [m/s]."""

    frame: int
    lane: Lane
    x: float
    speed: float


def room_to_drive(playback: Playback, ego_length: float) -> float:
    """Return the metres that an ego can drive from any entry to the end of the stretch."""
    _, last = _zone(playback)
    return playback.length - last - ego_length / 2


def track_length(playback: Playback, config: EnvConfig) -> float:
    """Return the length of an episode [m]: as configured, else the longer of the paper's and the stretch.

    From a ramp it is the rest of the stretch: one merge.
    """
    if config.track_length is not None:
        return config.track_length
    room = room_to_drive(playback, config.ego_length)
    return max(TRACK_LENGTH, room) if playback.ramp is None else room


def beginnings(playback: Playback, config: EnvConfig) -> int:
    """Return the number of frames, from the first on, in which an episode may begin.

    Where the stretch holds the paper's episode in one piece, or the ego enters on a ramp, an episode that
    fits into it begins early enough that an ego at the speed of slow traffic, the lowest tenth, reaches its
    end before the recording ends. A recording that is too short for that, and every other one, is used from
    any frame.
    """
    room, track = room_to_drive(playback, config.ego_length), track_length(playback, config)
    if (room < TRACK_LENGTH and playback.ramp is None) or track > room:
        return playback.frames
    pace = float(np.percentile(playback.sign * _speeds(playback), SLOW))
    frames = playback.frames - math.ceil(track / (max(pace, 1.0) * playback.road.time_step))
    return frames if frames > 0 else playback.frames


def _speeds(playback: Playback) -> Floats:
    """Return the velocities along x of all vehicles in the playback's lanes, in every frame."""
    film = playback.film
    own = np.isin(film.pieces[:, LANE], [lane.id for lane in playback.lanes])
    return np.asarray(film.motion[:, 2][own[film.piece]] * UNIT, dtype=np.float64)


def _zone(playback: Playback) -> tuple[float, float]:
    """Return where the part of the stretch begins and ends in which the ego enters [m]."""
    if playback.ramp is not None:
        begin, end = playback.along(playback.ramp.begin), playback.along(playback.ramp.end)
        return begin, min(begin + RAMP_ZONE, (begin + end) / 2)
    begin = min(OFFSET, playback.length / 4)
    return begin, min(begin + ZONE, playback.length / 2)


@dataclass(frozen=True, slots=True, eq=False)
class _There:
    """The vehicles in some frames of a film: `numbers` (6, F, S), the rest of shape (F, S)."""

    numbers: Floats
    vehicle: Integers
    lane: Integers
    valid: Mask


class Entries:
    """The places early in a playback's stretch, and the frames in which the rules call them safe to enter.

    The rules are queried about a frame when it is first searched, and their answers are kept. An ego enters
    with the speed of the traffic around it.
    """

    def __init__(
        self, playback: Playback, shield: Shield, size: tuple[float, float], kept: int = KEPT
    ) -> None:
        """Prepare the search of entries for an ego of a `size`, length and width [m].

        The answers about `kept` frames are kept.
        """
        begin, end = _zone(playback)
        along = begin + (np.arange(PLACES) + 0.5) * (end - begin) / PLACES
        self._lanes = playback.entry_lanes
        self._playback = playback
        self._shield = shield
        self._size = size
        self._step = max(1, round(PAUSE / playback.road.time_step))
        self._lane = np.repeat(np.arange(len(self._lanes)), PLACES)
        self._lane_id = np.array([lane.id for lane in self._lanes])[self._lane]
        self._centre = np.array([lane.centre for lane in self._lanes])[self._lane]
        fastest = np.inf if playback.ramp is None else RAMP_LIMIT
        self._limit = np.array([min(lane.speed_limit, fastest) for lane in self._lanes])[self._lane]
        self._x = np.tile(playback.at(along), len(self._lanes))
        self._kept = kept
        self._known: dict[int, tuple[Integers, Floats]] = {}
        """By frame: the places that are safe, and the speed [m/s] in each."""

    def find(self, rng: np.random.Generator, *, frame: int, lane: Lane | None = None) -> Entry:
        """Return a place drawn among the safe ones at `frame` or soon after, if possible in `lane`.

        Raises:
            UserError: no frame of the recording has a safe place.
        """
        playback = self._playback
        for start in range(frame, frame + playback.frames, self._step):
            at = start % playback.frames
            if at not in self._known:
                # Most frames have a safe place: ask about more only if the first one has none.
                ahead = range(start, start + (1 if start == frame else AHEAD) * self._step, self._step)
                self._ask([later % playback.frames for later in ahead])
            safe, speed = self._known[at]
            choices = np.arange(len(safe))
            if lane is not None and (preferred := np.flatnonzero(self._lane_id[safe] == lane.id)).size:
                choices = preferred
            if choices.size:
                chosen = int(choices[rng.integers(choices.size)])
                place = int(safe[chosen])
                lane = self._lanes[int(self._lane[place])]
                return Entry(at, lane, float(self._x[place]), float(speed[chosen]))
        raise UserError(
            f"no gap that the rules call safe in {playback.frames} frames of {playback.direction.value} "
            "traffic; use a recording with less traffic or rules that ask for less room"
        )

    def _ask(self, wanted: Sequence[int]) -> None:
        """Query the rules about some frames."""
        frames = np.unique([frame for frame in wanted if frame not in self._known])
        film = self._playback.film
        there = _There(film.numbers(frames), film.vehicle(frames), film.lane(frames), film.valid(frames))
        speed = self._traffic_speed(there)
        safe = np.array(self._shield.entries_are_safe(self._scenes(there, speed))).reshape(speed.shape)
        for frame, here, speeds in zip(frames.tolist(), safe, speed, strict=True):
            places = here.nonzero()[0]
            self._known[frame] = places, speeds[places]
        while len(self._known) > max(self._kept, len(frames)):
            del self._known[next(iter(self._known))]

    def _traffic_speed(self, there: _There) -> Floats:
        """Return the mean speed of the nearest leader and follower, at most the limit; the limit if alone.

        Of shape (F, P).
        """
        sign = self._playback.sign
        x, _, vx, *_ = there.numbers
        offset = sign * (x[:, None, :] - self._x[:, None])
        seen = there.valid[:, None, :] & (there.lane[:, None, :] == self._lane_id[:, None])
        seen &= np.abs(offset) <= self._playback.road.radar_range
        speed = sign * vx
        total, found = np.zeros(offset.shape[:2]), np.zeros(offset.shape[:2])
        for side in (seen & (offset >= 0), seen & (offset < 0)):
            nearest = np.where(side, np.abs(offset), np.inf).argmin(axis=2)
            any_there = side.any(axis=2)
            total += np.where(any_there, np.take_along_axis(speed, nearest, axis=1), 0.0)
            found += any_there
        mean = np.where(found > 0, total / np.maximum(found, 1.0), self._limit)
        return np.asarray(np.minimum(np.maximum(mean, 0.0), self._limit))

    def _scenes(self, there: _There, speed: Floats) -> SceneBatch:
        """Return the scenes with the ego at every place in some frames, at `speed`, shape (F, P)."""
        playback, (count, places) = self._playback, speed.shape
        numbers = np.repeat(there.numbers, places, axis=1)
        vehicle, lane = np.repeat(there.vehicle, places, axis=0), np.repeat(there.lane, places, axis=0)
        x, y = np.tile(self._x, count), np.tile(self._centre, count)
        own: list[Floats | float] = [x, y, playback.sign * speed.ravel(), 0.0, *self._size]
        for column, value in zip(numbers, own, strict=True):
            column[:, 0] = value
        vehicle[:, 0], lane[:, 0] = EGO_ID, np.tile(self._lane_id, count)
        dx, dy = numbers[0] - x[:, None], numbers[1] - y[:, None]
        valid = np.repeat(there.valid, places, axis=0) & (dx * dx + dy * dy <= playback.road.radar_range**2)
        valid[:, 0] = True
        return SceneBatch.from_numbers(
            numbers,
            roads=(playback.road,),
            road=np.zeros(count * places, dtype=np.int64),
            target_lane=lane[:, 0],
            id=vehicle,
            lane=lane,
            valid=valid,
        )
