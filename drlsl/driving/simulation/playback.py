"""Recordings laid out for driving: the directions of their roads, read by many egos at once."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import Final, Self

import numpy as np

from drlsl.driving.config import EntryPlace, EnvConfig
from drlsl.driving.scene import Road
from drlsl.driving.simulation.fault import Track
from drlsl.driving.simulation.films import Films, Reels
from drlsl.errors import UserError
from drlsl.traffic import (
    OFF_LANE,
    UNIT,
    Direction,
    Film,
    Floats,
    Integers,
    Lane,
    MergingLane,
    Recording,
    Traffic,
    load_recordings,
)


@dataclass(frozen=True, slots=True, eq=False)
class Playback:
    """One direction of a recording's road: `lanes` are those of the direction.

    `traffic`: what the recording says that its vehicles do about an ego. `ramp`: where the ego enters, if not
    on the road; the lane there is the one of `lanes` that ends.
    """

    film: Film
    road: Road
    direction: Direction
    lanes: tuple[Lane, ...]
    x_min: float
    x_max: float
    traffic: Traffic = Traffic.RECORDED
    ramp: MergingLane | None = None

    def __deepcopy__(self, memo: object) -> Self:
        """Return the playback itself: nothing in it changes."""
        return self

    @property
    def sign(self) -> int:
        """The sign of motion along x."""
        return self.direction.sign

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.film)

    @property
    def length(self) -> float:
        """Length of the recorded stretch of road [m]."""
        return self.x_max - self.x_min

    @property
    def entry_lanes(self) -> tuple[Lane, ...]:
        """The lanes in which the ego enters: the one that ends if it enters on a ramp, else all."""
        return self.lanes if self.ramp is None else tuple(one for one in self.lanes if one.end is not None)

    def at(self, along: Floats | float) -> Floats | float:
        """Return the x that is `along` [m] from the beginning of the stretch."""
        return self.x_min + along if self.sign > 0 else self.x_max - along

    def along(self, x: float) -> float:
        """Return how far x is from the beginning of the stretch [m]."""
        return x - self.x_min if self.sign > 0 else self.x_max - x

    def track(self, frame: int, slot: int, since: int) -> Track:
        """Return the track of the vehicle in `slot` up to `frame`, from `since` or where its track began."""
        film = self.film
        begin = max(film.first_of(frame, slot), since)
        x, y, vx = film.motion[begin : frame + 1, :3, slot].T * UNIT
        _, _, _, length, width = film.pieces[film.piece[frame, slot]].tolist()
        return Track(self.sign * x, y, self.sign * vx, length * UNIT, width * UNIT)


def playbacks_of(
    recordings: Iterable[Recording],
    radar_range: float,
    limits: Sequence[float] = (),
    entry: EntryPlace = "road",
) -> list[Playback]:
    """Return both directions of each recording, for egos that see `radar_range` [m] far.

    `limits`: speed limits of the lanes of a direction [m/s], from right to left, in place of the recording's.
    `entry`: where the ego enters; with "ramp", the merging lane of each direction is one of its lanes.

    Raises:
        UserError: a direction has another number of lanes, or not one merging lane.
    """
    result: list[Playback] = []
    for given in recordings:
        recording = _with_limits(given, limits) if limits else given
        film, road = recording.film, road_of(recording, radar_range)
        ramps: dict[Direction, MergingLane] = {}
        if entry == "ramp":
            ramps = {direction: _ramp_of(recording, direction) for direction in recording.directions}
            film, road = _with_ramps(recording, film, road, ramps.values())
        result.extend(
            Playback(
                film,
                road,
                direction,
                road.lanes_of(direction),
                recording.x_min,
                recording.x_max,
                recording.traffic,
                ramps.get(direction),
            )
            for direction in recording.directions
        )
    return result


def in_direction(playbacks: Sequence[Playback], config: EnvConfig) -> list[Playback]:
    """Return the playbacks for an ego that drives in the direction of `config`.

    Raises:
        UserError: there is none.
    """
    result = [one for one in playbacks if config.direction in ("both", one.direction.value)]
    if not result:
        raise UserError(
            f"no lane runs {config.direction} in {', '.join(config.recordings)}; choose the other direction "
            "or both"
        )
    return result


def load_playbacks(configs: Iterable[EnvConfig]) -> list[list[Playback]]:
    """Return the playbacks of each configuration's egos; each recording is laid out once.

    Raises:
        UserError: a recording cannot be read, or has no lane in the requested direction.
    """
    loaded: dict[tuple[str, float, tuple[float, ...], EntryPlace], list[Playback]] = {}
    result = []
    for config in configs:
        playbacks = []
        for name in config.recordings:
            key = name, config.radar_range, config.lane_limits, config.entry
            if key not in loaded:
                loaded[key] = playbacks_of(load_recordings(name), *key[1:])
            playbacks.extend(loaded[key])
        result.append(in_direction(playbacks, config))
    return result


def _with_limits(recording: Recording, limits: Sequence[float]) -> Recording:
    lanes = []
    for direction in recording.directions:
        from_the_right = sorted(recording.lanes_of(direction), key=lambda lane: -direction.sign * lane.centre)
        if len(from_the_right) != len(limits):
            raise UserError(
                f"lane_limits: {len(limits)} limits for the {len(from_the_right)} lanes that run "
                f"{direction.value} in {recording.name}"
            )
        lanes += [
            replace(lane, speed_limit=limit) for lane, limit in zip(from_the_right, limits, strict=True)
        ]
    return replace(recording, lanes=tuple(sorted(lanes, key=lambda lane: lane.id)))


def _ramp_of(recording: Recording, direction: Direction) -> MergingLane:
    """Return the merging lane of a direction.

    Raises:
        UserError: there is none, or there are several.
    """
    found = [lane for lane in recording.merging_lanes if lane.direction is direction]
    if len(found) != 1:
        raise UserError(
            f"entry ramp: {recording.name} has {len(found)} merging lanes that run {direction.value}; "
            "expected one, as in the recordings merge-train and merge-test"
        )
    return found[0]


def _with_ramps(
    recording: Recording, film: Film, road: Road, ramps: Iterable[MergingLane]
) -> tuple[Film, Road]:
    """Return film and road with merging lanes as lanes that end, after the others by their ids.

    That film, 20 bytes for each frame and slot, is not shared by processes.
    """
    lanes, everywhere = list(road.lanes), slice(None)
    elsewhere = film.valid(everywhere) & (film.lane(everywhere) == OFF_LANE)
    x, y, *_ = film.numbers(everywhere)
    for number, ramp in enumerate(ramps, start=len(lanes) + 1):
        sign = ramp.direction.sign
        road_lanes = recording.lanes_of(ramp.direction)
        right = road_lanes[-1 if sign > 0 else 0]
        lanes.append(Lane(number, ramp.direction, ramp.centre, ramp.width, right.speed_limit, ramp.end))
        inside = elsewhere & (sign * x <= sign * ramp.end) & (np.abs(y - ramp.centre) <= ramp.width / 2)
        film, elsewhere = film.with_lane(inside, number), elsewhere & ~inside
    lanes.sort(key=lambda lane: lane.centre)
    return film, replace(road, lanes=tuple(lanes))


def road_of(recording: Recording, radar_range: float) -> Road:
    """Return the road of `recording` for an ego that sees `radar_range` [m] far.

    Equal roads are one object: their facts are kept by road, and it is compared with itself at once.
    """
    return _road(recording.lanes, recording.dt, radar_range)


_road: Final = lru_cache(maxsize=256)(Road)


def lane_table(roads: Sequence[Sequence[Lane]], nowhere: float) -> tuple[Integers, Floats, Floats]:
    """Return ids, centres and widths [m] of some lanes for each road, shape (R, L).

    Where a road has no lane, its id is 0 and its centre and width are `nowhere`.
    """
    most = max(map(len, roads))
    ids = np.zeros((len(roads), most), dtype=np.int64)
    centre, width = np.full((2, len(roads), most), nowhere)
    for index, lanes in enumerate(roads):
        ids[index, : len(lanes)] = [lane.id for lane in lanes]
        centre[index, : len(lanes)] = [lane.centre for lane in lanes]
        width[index, : len(lanes)] = [lane.width for lane in lanes]
    return ids, centre, width


@dataclass(frozen=True, slots=True, eq=False)
class Courses(Reels):
    """The data of the playbacks that N egos drive in; one value for each ego.

    Besides those of `Reels`, of its recording's film: `dt` [s]; `sign` of motion along x;
    `road`, an index of the roads; `start`: the x where the stretch begins, `length` of it, `low` and `high`,
    the edges of the direction's lanes, `low_after` and `high_after` of those that go on where one ends, at
    `end`, counted along the direction and infinite if all go on [m]; `limit`: the highest speed limit of the
    direction [m/s]; `lanes`: the number of lanes. Of shape (N, L): `lane_id`, `width`, `centre`
    [m], infinite where there is no lane.
    """

    dt: Floats
    sign: Floats
    road: Integers
    start: Floats
    length: Floats
    low: Floats
    high: Floats
    low_after: Floats
    high_after: Floats
    end: Floats
    limit: Floats
    lanes: Integers
    lane_id: Integers
    centre: Floats
    width: Floats

    @property
    def across(self) -> tuple[Floats, Integers, Integers, Floats, Floats]:
        """The sign of motion and the lanes: their number, ids, centres and widths."""
        return self.sign, self.lanes, self.lane_id, self.centre, self.width

    def take(self, chosen: Integers) -> Courses:
        """Return the courses of the indexes `chosen`, shape (N,)."""
        return Courses(*(getattr(self, field.name).take(chosen, axis=0) for field in fields(self)))


class Playbacks:
    """Several playbacks and their `films`; `courses` has a value for each playback."""

    def __deepcopy__(self, memo: object) -> Self:
        """Return the playbacks themselves: nothing in them changes."""
        return self

    def __init__(self, playbacks: Sequence[Playback]) -> None:
        films = list(dict.fromkeys(playback.film for playback in playbacks))
        self.films = Films(films)
        self.all = tuple(playbacks)
        reels, reel = self.films.reels, np.array([films.index(one.film) for one in playbacks])
        self.roads = tuple(dict.fromkeys(one.road for one in playbacks))
        lane_id, centre, width = lane_table([one.lanes for one in playbacks], np.inf)
        self.courses = Courses(
            cells_begin=reels.cells_begin[reel],
            first_piece=reels.first_piece[reel],
            frames=reels.frames[reel],
            slots=reels.slots[reel],
            dt=np.array([one.road.time_step for one in playbacks]),
            sign=np.array([float(one.sign) for one in playbacks]),
            road=np.array([self.roads.index(one.road) for one in playbacks]),
            start=np.array([one.at(0.0) for one in playbacks]),
            length=np.array([one.length for one in playbacks]),
            **_edges(playbacks),
            limit=np.array([max(lane.speed_limit for lane in one.lanes) for one in playbacks]),
            lanes=np.array([len(one.lanes) for one in playbacks]),
            lane_id=lane_id,
            centre=centre,
            width=width,
        )


def _edges(playbacks: Sequence[Playback]) -> dict[str, Floats]:
    """Return where the lanes are, by the names of `Courses`."""
    rows = []
    for one in playbacks:
        goes_on = [lane for lane in one.lanes if lane.end is None]
        ends = [one.sign * lane.end for lane in one.lanes if lane.end is not None]
        rows.append((*_strip(one.lanes), *_strip(goes_on), min([np.inf, *ends])))
    names = ("low", "high", "low_after", "high_after", "end")
    return dict(zip(names, np.array(rows).T.copy(), strict=True))


def _strip(lanes: Iterable[Lane]) -> tuple[float, float]:
    """Return the edges of neighbouring lanes."""
    edges = [lane.centre + side * lane.width / 2 for lane in lanes for side in (-1, 1)]
    return min(edges), max(edges)
