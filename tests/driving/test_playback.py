"""Recordings laid out for driving: whose track is whose, and how long it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from drlsl.driving import EnvConfig
from drlsl.driving.simulation import Playback, load_playbacks, playbacks_of
from drlsl.errors import UserError
from drlsl.traffic import Direction, load_recording
from tests.driving.recordings import Drive, recording
from tests.traffic.writing import Row, write_highd


@pytest.fixture(scope="module")
def playback() -> Playback:
    made = recording(
        [Drive(3, 10.0, 20.0, end=50), Drive(4, 30.0, 10.0, begin=60, end=90), Drive(5, 5.0, 1.0, begin=95)],
        frames=100,
    )
    assert made.capacity == 1, "one vehicle at a time: one slot, used by one vehicle after the other"
    return next(one for one in playbacks_of([made], 100.0) if one.direction is Direction.LEFT_TO_RIGHT)


def test_a_track_is_of_one_vehicle(playback: Playback) -> None:
    track = playback.track(80, 1, since=0)
    assert len(track.s) == 21
    assert track.s.tolist() == pytest.approx((30.0 + 10.0 * np.arange(21) / 25.0).tolist())
    assert set(track.speed) == {10.0}


def test_a_track_begins_no_earlier_than_asked(playback: Playback) -> None:
    assert len(playback.track(80, 1, since=75).s) == 6


@pytest.mark.parametrize("direction", list(Direction))
def test_the_stretch_begins_where_its_traffic_enters(direction: Direction) -> None:
    made = recording([Drive(1, 400.0, 1.0), Drive(3, 5.0, 1.0)], frames=5)
    one = next(one for one in playbacks_of([made], 100.0) if one.direction is direction)
    places = [one.at(along) for along in (0.0, 100.0, 420.0)]
    assert places == ([0.0, 100.0, 420.0] if direction is Direction.LEFT_TO_RIGHT else [420.0, 320.0, 0.0])


@pytest.mark.parametrize("direction", [Direction.LEFT_TO_RIGHT, Direction.RIGHT_TO_LEFT])
def test_limits_of_lanes_count_from_the_right(direction: Direction) -> None:
    read = load_recording("highway-test")
    [playback] = [
        one for one in playbacks_of([read], 100.0, (20.0, 25.0, 30.0)) if one.direction is direction
    ]
    # y points down: the right lane of traffic to the right has the largest y.
    from_the_right = sorted(playback.lanes, key=lambda lane: -direction.sign * lane.centre)
    assert [lane.speed_limit for lane in from_the_right] == [20.0, 25.0, 30.0]
    assert set(playback.lanes) <= set(playback.road.lanes)
    assert [lane.id for lane in playback.road.lanes] == [lane.id for lane in read.lanes]


def test_limits_for_another_number_of_lanes_are_refused() -> None:
    with pytest.raises(UserError, match="2 limits for the 5 lanes that run left_to_right in"):
        playbacks_of([load_recording("freeway")], 100.0, (20.0, 25.0))


def test_a_data_set_is_driven_in_all_its_recordings(tmp_path: Path) -> None:
    for part in ("01", "02", "03"):
        write_highd(tmp_path / "set" / "data", [Row(1, 1, 50.0, 22.0), Row(2, 1, 51.2, 22.0)], part=part)
    config = EnvConfig(recording=str(tmp_path / "set"))
    [playbacks] = load_playbacks([config])
    assert len(playbacks) == 3
    [some] = load_playbacks([EnvConfig(recording=(f"{tmp_path / 'set'}#0[12]", "freeway"))])
    assert len(some) == 3


def test_equal_roads_of_recordings_are_one_object() -> None:
    one, other = (playbacks_of([recording([Drive(3, 10.0, 20.0)], frames=50)], 100.0)[0] for _ in range(2))
    assert one.road is other.road
    assert playbacks_of([recording([Drive(3, 10.0, 20.0)], frames=50)], 50.0)[0].road != one.road
