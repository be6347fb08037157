"""The scenes in which an entry is searched hold the traffic around each place, and no other columns."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drlsl.driving import EnvConfig
from drlsl.driving.scene import Scene
from drlsl.driving.shield import Shield
from drlsl.driving.simulation import entry_loops, load_playbacks
from drlsl.driving.simulation.entry import Entries
from drlsl.lowering.backends import machine_code

SIZE = 4.6, 1.9


@cache
def entries_of(name: str, place: str, number: int) -> Entries:
    config = EnvConfig.model_validate({"recording": name, "entry": place})
    return Entries(load_playbacks([config])[0][number], Shield.default(tier="numpy"), SIZE)


def in_range(entries: Entries, scene: Scene, frame: int) -> list[tuple[Any, ...]]:
    """Return the vehicles in radar range of the ego of a scene, from the film."""
    playback, x, y = entries._playback, scene.ego.x, scene.ego.y
    film, row = playback.film, slice(frame, frame + 1)
    lanes, ids, numbers = film.lane(row)[0], film.vehicle(row)[0], film.numbers(row)[:, 0]
    reach = playback.road.radar_range
    return [
        (f"v{ids[slot]}", lanes[slot], *numbers[:, slot])
        for slot in np.flatnonzero(film.valid(row)[0])
        if (numbers[0, slot] - x) ** 2 + (numbers[1, slot] - y) ** 2 <= reach**2
    ]


def speed_at(entries: Entries, scene: Scene, frame: int, limit: float) -> float:
    """Return the mean speed of the nearest vehicles ahead and behind in the lane, the limit at most."""
    playback, row = entries._playback, slice(frame, frame + 1)
    film, sign = playback.film, playback.sign
    mine = film.valid(row)[0] & (film.lane(row)[0] == scene.ego.lane)
    x, _, vx, *_ = film.numbers(row)[:, 0, mine]
    gap = sign * (x - scene.ego.x)
    near = []
    for side in (gap >= 0, gap < 0):
        if (side & (abs(gap) <= playback.road.radar_range)).any():
            near.append(sign * vx[np.where(side, abs(gap), math.inf).argmin()])
    return min(max(sum(near) / len(near), 0.0), limit) if near else limit


@settings(max_examples=25, deadline=None)
@given(st.data())
@pytest.mark.parametrize(
    ("name", "place", "number"),
    [
        ("highway-test", "road", 0),
        ("highway-test", "road", 1),
        ("freeway", "road", 0),
        ("merge-test", "ramp", 0),
    ],
)
def test_scenes_hold_the_traffic_in_range_of_each_place(
    name: str, place: str, number: int, data: st.DataObject
) -> None:
    entries = entries_of(name, place, number)
    last = entries._playback.frames - 1
    frames = data.draw(st.lists(st.integers(0, last), min_size=1, max_size=3, unique=True).map(sorted))
    scenes, speeds = entries._scenes(np.array(frames))
    at, (rows, places) = np.repeat(frames, speeds.shape[1]), (len(scenes), speeds.shape[1])
    assert len(at) == rows
    for row in data.draw(st.lists(st.integers(0, rows - 1), min_size=1, max_size=9)):
        scene = scenes.scene(row)
        assert [tuple(one) for one in scene.vehicles] == in_range(entries, scene, int(at[row]))
        speed = speed_at(entries, scene, int(at[row]), float(entries._limit[row % places]))
        assert speeds.flat[row] == pytest.approx(speed, abs=1e-9)
        assert scene.ego.vx == entries._playback.sign * speeds.flat[row]


def test_a_scene_has_no_columns_for_vehicles_that_no_place_sees() -> None:
    entries = entries_of("highway-test", "road", 0)
    scenes, _ = entries._scenes(np.array([500]))
    assert scenes.valid[:, 1:].any(axis=0).all()
    assert scenes.valid.shape[1] < entries._playback.film.slots / 2


@settings(max_examples=25, deadline=None)
@given(st.lists(st.integers(0, 2999), min_size=1, max_size=4, unique=True).map(sorted))
def test_machine_code_writes_the_same_scenes(frames: list[int]) -> None:
    entries = entries_of("highway-test", "road", 1)
    films, wanted = entries._films, np.array(frames)
    found = [np.full((len(frames), films.slots), -1) for _ in range(2)]
    given_first = wanted, films.cells, *entries._seen
    most = [
        one(*given_first, array) for one, array in zip(both(entry_loops.slots_between), found, strict=True)
    ]
    assert most[0] == most[1]
    assert np.array_equal(found[0], found[1])
    shape = len(frames) * len(entries._x), most[0]
    written = []
    for function in both(entry_loops.entry_scenes):
        kinds = (float, int, int, bool)
        arrays = [
            np.zeros((6, *shape)),
            *(np.zeros(shape, dtype=kind) for kind in kinds[1:]),
            np.zeros(shape[0]),
        ]
        function(
            wanted,
            films.cells,
            films.table,
            found[0],
            entries._x,
            entries._centre,
            entries._lane_id,
            entries._limit,
            entries._sign,
            100.0,
            -1,
            *SIZE,
            *arrays,
        )
        written.append(arrays)
    for one, other in zip(*written, strict=True):
        np.testing.assert_array_equal(one, other)


def both(function: Any) -> tuple[Any, Any]:
    return function, machine_code(function)
