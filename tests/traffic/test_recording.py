"""A recording keeps its promises, or validate() says which one it breaks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from drlsl.errors import UserError
from drlsl.traffic import Direction, Lane, Recording, Tracks, VehicleClass, lanes_of_rows, pack
from drlsl.traffic.packed_frames import FIRST, LANE, LENGTH, NO_VEHICLE, PIECE, VEHICLE, WIDTH, Film

LANES = (
    Lane(1, Direction.RIGHT_TO_LEFT, 2.0, 4.0, 36.0),
    Lane(2, Direction.LEFT_TO_RIGHT, 10.0, 4.0, 36.0),
    Lane(3, Direction.LEFT_TO_RIGHT, 14.0, 4.0, 30.0),
)


def make() -> Recording:
    """Vehicle 7 in frames 0 to 2 of lane 2, vehicle 9 in frame 1 of lane 1 and again in frame 3."""
    frame = np.array([0, 1, 2, 1, 3])
    vehicle = np.array([7, 7, 7, 9, 9])
    x = np.array([10.0, 11.2, 12.4, 90.0, 85.0])
    y = np.array([10.0, 10.1, 10.2, 2.0, 2.1])
    vx = np.array([30.0, 30.0, 30.0, -28.0, -28.0])
    ones = np.ones(5)
    tracks = Tracks(x, y, vx, 0.1 * ones, 4.5 * ones, 1.8 * ones, frame, vehicle)
    return Recording(
        name="made by hand",
        frame_rate=25.0,
        lanes=LANES,
        x_min=0.0,
        x_max=100.0,
        film=pack(tracks, lanes_of_rows(y, LANES), name="made by hand"),
        vehicle_class={7: VehicleClass.CAR, 9: VehicleClass.TRUCK},
    )


def test_a_sound_recording_passes() -> None:
    recording = make()
    recording.validate()
    assert (recording.frame_count, recording.capacity, recording.duration) == (4, 2, 4 / 25)
    assert recording.directions == (Direction.LEFT_TO_RIGHT, Direction.RIGHT_TO_LEFT)
    assert [lane.id for lane in recording.lanes_of(Direction.LEFT_TO_RIGHT)] == [2, 3]
    assert recording.lane(3).speed_limit == 30.0


def test_a_frame_holds_the_vehicles_present() -> None:
    recording = make()
    one = recording.frame(1)
    assert dict(zip(one.vehicle.tolist(), one.lane.tolist(), strict=True)) == {7: 2, 9: 1}
    assert dict(zip(one.vehicle.tolist(), one.first.tolist(), strict=True)) == {7: 0, 9: 1}
    assert recording.frame(3).first.tolist() == [3]
    assert one.valid.all()


@pytest.mark.parametrize("index", [-1, 4])
def test_a_frame_that_is_not_there_raises(index: int) -> None:
    with pytest.raises(IndexError, match="frames 0 to 3"):
        make().frame(index)


def test_a_lane_that_is_not_there_raises() -> None:
    with pytest.raises(UserError, match="no lane 0; the lanes are 1 to 3"):
        make().lane(0)


def test_arrays_cannot_be_written() -> None:
    with pytest.raises(ValueError, match="read-only"):
        make().frames.x[0, 0] = 1.0


def test_empty_slots_show() -> None:
    frames = make().frames
    empty = ~frames.valid
    assert empty.any()
    assert np.isnan(frames.x[empty]).all()
    assert (frames.vehicle[empty] == NO_VEHICLE).all()


def broken(name: str, where: Any, value: Any) -> Recording:
    """With a wrong number in an array of the film; the pieces are nobody, those of 7, 9 and 9 again."""
    recording = make()
    array = np.array(getattr(recording.film, name))
    array[where] = value
    return replace(recording, film=replace(recording.film, **{name: array}))


def nobody() -> Film:
    film = make().film
    return Film(np.zeros_like(film.cells), film.pieces)


FAULTS: dict[str, tuple[Callable[[], Recording], str]] = {
    "frame rate": (lambda: replace(make(), frame_rate=0.0), "frame rate 0.0"),
    "a rate in 1/h": (lambda: replace(make(), frame_rate=36_000.0), "36000 frames a second, more than 1000"),
    "stretch": (lambda: replace(make(), x_max=0.0), "stretch of road"),
    "no lanes": (lambda: replace(make(), lanes=()), "no lane"),
    "lane ids": (lambda: replace(make(), lanes=LANES[1:]), "count 1, 2, 3"),
    "lane width": (lambda: replace(make(), lanes=(*LANES[:2], replace(LANES[2], width=0.0))), "lane 3 needs"),
    "lane limit": (
        lambda: replace(make(), lanes=(*LANES[:2], replace(LANES[2], speed_limit=-1.0))),
        "lane 3",
    ),
    "lane nan": (lambda: replace(make(), lanes=(*LANES[:2], replace(LANES[2], centre=np.nan))), "not finite"),
    "lanes overlap": (
        lambda: replace(make(), lanes=(*LANES[:2], replace(LANES[2], centre=13.0))),
        "2 and 3 overlap",
    ),
    "shape": (
        lambda: replace(make(), film=replace(make().film, cells=np.zeros((4, 4, 3), dtype=np.int32))),
        "`cells` has shape",
    ),
    "kind": (
        lambda: replace(make(), film=replace(make().film, cells=make().film.cells.astype(np.int64))),
        "`cells` is of int64",
    ),
    "columns": (
        lambda: replace(make(), film=replace(make().film, pieces=make().film.pieces[:, :4])),
        "rows of 5 numbers",
    ),
    "nobody": (lambda: broken("pieces", (0, VEHICLE), 3), "rows of 5 numbers, the first"),
    "no such piece": (lambda: broken("cells", (0, PIECE, 1), 9), "`piece` must be a row of the 4"),
    "hidden value": (lambda: broken("cells", (0, 0, 2), 5), "the numbers in empty slots 0"),
    "in the ego's place": (lambda: broken("cells", (0, PIECE, 0), 1), "slot 0 must be empty"),
    "vehicle": (lambda: broken("pieces", (1, VEHICLE), -7), "id must be at least 0"),
    "length": (lambda: broken("pieces", (1, LENGTH), 0), "length and width"),
    "width": (lambda: broken("pieces", (3, WIDTH), -1), "length and width"),
    "lane": (lambda: broken("pieces", (1, LANE), 4), "lanes 1 to 3"),
    "outside": (lambda: broken("cells", (0, 0, 1), 1_010_000), "outside"),
    "twice": (lambda: broken("cells", (1, PIECE, 2), 1), "7|9|twice"),
    "first": (lambda: broken("pieces", (1, FIRST), 1), "`first` does not match"),
    "empty": (lambda: replace(make(), film=nobody()), "no vehicle"),
    "class missing": (lambda: replace(make(), vehicle_class={7: VehicleClass.CAR}), r"ids \[9\]"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_each_broken_promise_is_named(name: str) -> None:
    make_broken, message = FAULTS[name]
    with pytest.raises(UserError, match=message) as caught:
        make_broken().validate()
    assert str(caught.value).startswith("made by hand: ")


def test_directions_point_the_right_way() -> None:
    assert Direction.LEFT_TO_RIGHT.sign == 1
    assert Direction.RIGHT_TO_LEFT.sign == -1
