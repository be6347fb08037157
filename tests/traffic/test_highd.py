"""highD folders load as what they say."""

from __future__ import annotations

import gzip
import lzma
import random
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drlsl.errors import UserError
from drlsl.traffic import Direction, VehicleClass, load_recording
from drlsl.traffic.map_tracks import UNLIMITED_SPEED
from tests.traffic.writing import Row, write_highd

UPPER = (8.0, 12.0, 16.0)
LOWER = (20.0, 23.5, 27.0, 31.0)


def centimetres(low: int, high: int) -> st.SearchStrategy[float]:
    return st.integers(low, high).map(lambda value: value / 100)


@st.composite
def some_rows(draw: st.DrawFn) -> list[Row]:
    present = draw(st.sets(st.tuples(st.integers(1, 8), st.integers(1, 5)), min_size=1, max_size=20))
    return [
        Row(
            frame,
            vehicle,
            x=draw(centimetres(0, 42_000)),
            y=draw(centimetres(700, 3_200)),
            vx=draw(centimetres(-4_000, 4_000)),
            vy=draw(centimetres(-100, 100)),
            length=draw(centimetres(300, 1_800)),
            width=draw(centimetres(150, 260)),
        )
        for frame, vehicle in sorted(present)
    ]


@settings(max_examples=60, deadline=None)
@given(some_rows(), st.integers(0, 2**32), st.integers(0, 5))
def test_what_is_written_is_loaded(rows: list[Row], seed: int, repeats: int) -> None:
    shuffled = rows + rows[:repeats]
    random.Random(seed).shuffle(shuffled)
    with TemporaryDirectory() as folder:
        recording = load_recording(
            write_highd(Path(folder) / "h", shuffled, upper=UPPER, lower=LOWER), cache=False
        )
    frames = recording.frames
    start = min(row.frame for row in rows)
    places = {
        (int(t), int(frames.vehicle[t, k])): (t, k) for t, k in zip(*np.nonzero(frames.valid), strict=True)
    }
    assert places.keys() == {(row.frame - start, row.vehicle) for row in rows}
    for row in rows:
        place = places[row.frame - start, row.vehicle]
        for name in ("x", "y", "vx", "vy", "length", "width"):
            assert getattr(frames, name)[place] == pytest.approx(getattr(row, name), abs=1e-9)
        strips = [*pairwise(UPPER), *pairwise(LOWER)]
        holding = [n for n, (top, bottom) in enumerate(strips, 1) if top - 1e-6 <= row.y <= bottom + 1e-6]
        assert frames.lane[place] == (holding[-1] if holding else 0)
    assert sum(item.rows for item in recording.dropped) == len(shuffled) - len(rows)


def test_lanes_are_the_strips_between_markings(tmp_path: Path) -> None:
    recording = load_recording(write_highd(tmp_path / "h", [Row(1, 1, 50, 10)], upper=UPPER, lower=LOWER))
    assert [lane.id for lane in recording.lanes] == [1, 2, 3, 4, 5]
    assert [lane.centre for lane in recording.lanes] == [10.0, 14.0, 21.75, 25.25, 29.0]
    assert [lane.width for lane in recording.lanes] == [4.0, 4.0, 3.5, 3.5, 4.0]
    assert [lane.direction for lane in recording.lanes] == [Direction.RIGHT_TO_LEFT] * 2 + [
        Direction.LEFT_TO_RIGHT
    ] * 3


@pytest.mark.parametrize(("upper", "lower"), [((), LOWER), (UPPER, ())])
def test_a_road_may_have_one_direction(
    tmp_path: Path, upper: tuple[float, ...], lower: tuple[float, ...]
) -> None:
    recording = load_recording(write_highd(tmp_path / "h", [Row(1, 1, 50, 10)], upper=upper, lower=lower))
    assert len(recording.directions) == 1
    assert len(recording.lanes) == max(len(upper), len(lower)) - 1


def test_no_speed_limit_becomes_the_advisory_speed(tmp_path: Path) -> None:
    free = load_recording(write_highd(tmp_path / "free", [Row(1, 1, 50, 22)], speed_limit=-1.0))
    limited = load_recording(write_highd(tmp_path / "limited", [Row(1, 1, 50, 22)], speed_limit=33.33))
    assert {lane.speed_limit for lane in free.lanes} == {UNLIMITED_SPEED}
    assert {lane.speed_limit for lane in limited.lanes} == {33.33}


def test_classes_and_frame_rate(tmp_path: Path) -> None:
    rows = [Row(1, 1, 50, 22), Row(1, 2, 90, 22, length=15.0)]
    recording = load_recording(write_highd(tmp_path / "h", rows, trucks=[2], frame_rate=10.0))
    assert recording.vehicle_class == {1: VehicleClass.CAR, 2: VehicleClass.TRUCK}
    assert recording.frame_rate == 10.0


def test_the_stretch_runs_from_box_to_box(tmp_path: Path) -> None:
    rows = [Row(1, 1, 50, 22, length=4.0), Row(1, 2, 90, 22, length=15.0)]
    recording = load_recording(write_highd(tmp_path / "h", rows))
    assert (recording.x_min, recording.x_max) == (48.0, 97.5)


def test_a_gap_in_a_track_is_a_new_appearance(tmp_path: Path) -> None:
    rows = [Row(frame, 1, 50.0 + frame, 22) for frame in (4, 5, 8)]
    frames = load_recording(write_highd(tmp_path / "h", rows)).frames
    assert frames.first[frames.valid].tolist() == [0, 0, 4]
    assert frames.valid[:, 0].tolist() == [True, True, False, False, True]


def test_odd_rows_are_noted(tmp_path: Path) -> None:
    rows = [Row(1, 1, 50, 22, vx=-30.0), Row(1, 2, 80, 5)]
    notes = load_recording(write_highd(tmp_path / "h", rows)).notes
    assert "1 row has its centre in no lane (lane 0)" in notes
    assert "1 row moves against the lane's direction faster than 1 m/s" in notes


@pytest.mark.parametrize(("suffix", "opener"), [(".gz", gzip.open), (".xz", lzma.open)])
def test_compressed_files_load(tmp_path: Path, suffix: str, opener: object) -> None:
    folder = write_highd(tmp_path / "h", [Row(1, 1, 50, 22)])
    for path in list(folder.iterdir()):
        with opener(f"{path}{suffix}", "wb") as file:  # type: ignore[operator]  # both open alike
            file.write(path.read_bytes())
        path.unlink()
    assert load_recording(folder).frame(0).x.tolist() == [50.0]


def test_one_of_several_recordings_is_chosen(tmp_path: Path) -> None:
    for part, x in (("01", 50.0), ("07", 60.0)):
        write_highd(tmp_path, [Row(1, 1, x, 22)], part=part)
    with pytest.raises(UserError, match=f"holds recordings 01, 07; choose one, as in {tmp_path}#01"):
        load_recording(tmp_path)
    with pytest.raises(UserError, match="no recording 02; it holds 01, 07"):
        load_recording(f"{tmp_path}#02")
    assert load_recording(f"{tmp_path}#07").frame(0).x.tolist() == [60.0]
    assert load_recording(tmp_path / "07_tracks.csv").frame(0).x.tolist() == [60.0]


def test_a_hash_in_a_folder_name_is_no_choice(tmp_path: Path) -> None:
    folder = write_highd(tmp_path / "a#b", [Row(1, 1, 50, 22)])
    assert load_recording(folder).frame(0).x.tolist() == [50.0]
