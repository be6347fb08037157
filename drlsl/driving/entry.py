"""Where the ego enters the road: a gap that the rules call safe."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from drlsl.driving.batch import EGO_ID, SceneBatch
from drlsl.driving.playback import Playback
from drlsl.driving.shield import Shield
from drlsl.errors import UserError
from drlsl.traffic.road import Lane

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
        candidates = _candidates(playback, start % playback.frames, rng)
        safe = shield.entries_are_safe(_scenes(playback, candidates, size))
        entries = [entry for entry, is_safe in zip(candidates, safe, strict=True) if is_safe]
        preferred = [entry for entry in entries if lane is not None and entry.lane.id == lane.id] or entries
        if preferred:
            return preferred[int(rng.integers(len(preferred)))]
    raise UserError(
        f"no gap that the rules call safe in {playback.frames} frames of {playback.direction.value} traffic; "
        "use a recording with less traffic or rules that ask for less room"
    )


def _candidates(playback: Playback, frame: int, rng: np.random.Generator) -> list[Entry]:
    """Places in every lane at one frame, each with the speed of the traffic around it."""
    begin = min(OFFSET, playback.length / 4)
    end = min(begin + ZONE, playback.length / 2)
    edges = np.linspace(begin, end, PLACES + 1)
    return [
        Entry(frame, lane, playback.at(along), _traffic_speed(playback, frame, lane, playback.at(along)))
        for lane in playback.lanes
        for along in rng.uniform(edges[:-1], edges[1:]).tolist()
    ]


def _traffic_speed(playback: Playback, frame: int, lane: Lane, x: float) -> float:
    """The mean speed of the nearest vehicles in front and behind, at most the limit; the limit if alone."""
    in_lane = playback.valid[frame] & (playback.lane[frame] == lane.id)
    offset = playback.sign * (playback.numbers[0, frame] - x)
    speed = playback.sign * playback.numbers[2, frame]
    speeds = []
    for side in (in_lane & (offset >= 0), in_lane & (offset < 0)):
        slots = np.flatnonzero(side & (np.abs(offset) <= playback.road.radar_range))
        if slots.size:
            speeds.append(float(speed[slots[np.argmin(np.abs(offset[slots]))]]))
    wanted = sum(speeds) / len(speeds) if speeds else lane.speed_limit
    return min(max(wanted, 0.0), lane.speed_limit)


def _scenes(playback: Playback, entries: list[Entry], size: tuple[float, float]) -> SceneBatch:
    """The scenes with the ego at each entry; all entries are of one frame."""
    frame, count = entries[0].frame, len(entries)
    slots = np.flatnonzero(playback.valid[frame])
    shape = (count, slots.size + 1)
    numbers = np.empty((6, *shape))
    numbers[:, :, 1:] = playback.numbers[:, frame, slots][:, None, :]
    numbers[:, :, 0] = [
        [entry.x for entry in entries],
        [entry.lane.centre for entry in entries],
        [playback.sign * entry.speed for entry in entries],
        [0.0] * count,
        [size[0]] * count,
        [size[1]] * count,
    ]
    lanes = np.array([entry.lane.id for entry in entries])
    x, y = numbers[:2]
    own = np.full((count, 1), EGO_ID)
    return SceneBatch.from_numbers(
        numbers,
        roads=(playback.road,),
        road=np.zeros(count, dtype=np.int64),
        target_lane=lanes,
        id=np.concatenate(
            (own, np.broadcast_to(playback.vehicle[frame, slots], (count, slots.size))), axis=1
        ),
        lane=np.concatenate(
            (lanes[:, None], np.broadcast_to(playback.lane[frame, slots], (count, slots.size))), axis=1
        ),
        valid=np.hypot(x - x[:, :1], y - y[:, :1]) <= playback.road.radar_range,
    )
