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
from drlsl.driving.simulation.entry_loops import entry_scenes, slots_between
from drlsl.driving.simulation.films import Films
from drlsl.driving.simulation.playback import Playback
from drlsl.errors import UserError
from drlsl.lowering.backends import machine_code
from drlsl.traffic import LANE, NUMBERS, RAMP_LIMIT, UNIT, Floats, Integers, Lane

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

SLACK: Final = 1.0
"""Metres beyond the radar range in which vehicles are looked at, so that rounding leaves none out."""

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
        reach = playback.road.radar_range + SLACK
        self._seen = float(self._x.min()) - reach, float(self._x.max()) + reach
        self._sign, self._roads = float(playback.sign), (playback.road,)
        self._films = Films([playback.film])
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
            preferred = () if lane is None else np.flatnonzero(self._lane_id[safe] == lane.id)
            if len(preferred) or len(safe):
                drawn = int(rng.integers(len(preferred) or len(safe)))
                chosen = int(preferred[drawn]) if len(preferred) else drawn
                place = int(safe[chosen])
                found = self._lanes[int(self._lane[place])]
                return Entry(at, found, float(self._x[place]), float(speed[chosen]))
        raise UserError(
            f"no gap that the rules call safe in {playback.frames} frames of {playback.direction.value} "
            "traffic; use a recording with less traffic or rules that ask for less room"
        )

    def _ask(self, wanted: Sequence[int]) -> None:
        """Query the rules about some frames."""
        frames = np.array(sorted({frame for frame in wanted if frame not in self._known}))
        scenes, speed = self._scenes(frames)
        safe = self._shield.entries_are_safe(scenes).reshape(speed.shape)
        for frame, here, speeds in zip(frames.tolist(), safe, speed, strict=True):
            places = here.nonzero()[0]
            self._known[frame] = places, speeds[places]
        while len(self._known) > max(self._kept, len(frames)):
            del self._known[next(iter(self._known))]

    def _scenes(self, frames: Integers) -> tuple[SceneBatch, Floats]:
        """Return the scenes with the ego at every place in some frames, and its speed there, shape (F, P)."""
        films, road = self._films, self._playback.road
        found = np.empty((len(frames), films.slots), dtype=np.int64)
        most = machine_code(slots_between)(frames, films.cells, *self._seen, found)
        shape = len(frames) * len(self._x), most
        numbers, whole = np.empty((len(NUMBERS), *shape)), np.empty((2, *shape), dtype=np.int64)
        (vehicle, lane), valid = whole, np.empty(shape, dtype=np.bool_)
        speed = np.empty(shape[0])
        machine_code(entry_scenes)(
            frames,
            films.cells,
            films.table,
            found,
            self._x,
            self._centre,
            self._lane_id,
            self._limit,
            self._sign,
            road.radar_range,
            EGO_ID,
            *self._size,
            numbers,
            vehicle,
            lane,
            valid,
            speed,
        )
        scenes = SceneBatch.from_numbers(
            numbers,
            roads=self._roads,
            road=np.zeros(shape[0], dtype=np.int64),
            target_lane=lane[:, 0],
            id=vehicle,
            lane=lane,
            valid=valid,
        )
        return scenes, speed.reshape(len(frames), -1)
