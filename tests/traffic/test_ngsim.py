"""NGSIM tables load as what they say, on a road made straight."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drlsl.errors import UserError
from drlsl.traffic import Direction, Recording, VehicleClass, load_recording
from drlsl.traffic.formats.ngsim import SPEED_LIMIT, WINDOW
from drlsl.traffic.slopes import slopes
from tests.traffic.writing import NGSIM, Row, write_ngsim_csv, write_ngsim_text

LANE_WIDTH = 3.6


def drive(
    vehicle: int,
    lane: int,
    *,
    begin: int = 0,
    frames: int = 200,
    speed: float = 15.0,
    x: float = 3.0,
    bend: Callable[[float], float] = lambda x: 0.0,
    length: float = 4.5,
) -> list[Row]:
    """A vehicle at constant speed on the centre of its lane, from x on."""
    rows = []
    for step in range(frames):
        along = x + speed * step / 10
        y = (lane - 0.5) * LANE_WIDTH + bend(along)
        rows.append(Row(begin + step, vehicle, along, y, vx=speed, lane=lane, length=length))
    return rows


def traffic(lanes: int = 3, **options: object) -> list[Row]:
    return [row for lane in range(1, lanes + 1) for row in drive(lane, lane, **options)]  # type: ignore[arg-type]


def by_vehicle(recording: Recording, vehicle: int) -> dict[str, np.ndarray]:
    here = recording.frames.vehicle == vehicle
    return {name: array[here] for name, array in recording.frames.arrays()}


@pytest.mark.parametrize("layout", ["text", "csv"])
def test_both_layouts_load_alike(tmp_path: Path, layout: str) -> None:
    writer = write_ngsim_text if layout == "text" else write_ngsim_csv
    recording = load_recording(writer(tmp_path / f"table.{layout}", traffic()))
    assert recording.frame_rate == 10.0
    assert recording.frame_count == 200
    assert len(recording.lanes) == 3
    assert {lane.speed_limit for lane in recording.lanes} == {SPEED_LIMIT}
    assert pytest.approx(29.06, abs=0.01) == SPEED_LIMIT
    assert recording.directions == (Direction.LEFT_TO_RIGHT,)
    for number in (1, 2, 3):
        track = by_vehicle(recording, number)
        assert track["x"] == pytest.approx(3.0 + 1.5 * np.arange(200))
        assert track["vx"] == pytest.approx(np.full(200, 15.0))
        assert track["vy"] == pytest.approx(np.zeros(200), abs=1e-6)
        assert set(track["lane"].tolist()) == {number}


def test_the_front_becomes_the_centre(tmp_path: Path) -> None:
    rows = drive(1, 1, length=4.0) + drive(2, 2, length=16.0)
    recording = load_recording(write_ngsim_csv(tmp_path / "t.csv", rows))
    assert by_vehicle(recording, 1)["x"][0] == pytest.approx(3.0)
    assert by_vehicle(recording, 2)["x"][0] == pytest.approx(3.0)
    assert (recording.x_min, recording.x_max) == pytest.approx((3.0 - 8.0, 3.0 + 1.5 * 199 + 8.0))
    assert recording.vehicle_class == {1: VehicleClass.CAR, 2: VehicleClass.TRUCK}


@settings(max_examples=15, deadline=None)
@given(st.data())
def test_order_repeats_and_gaps(data: st.DataObject) -> None:
    rows = traffic(frames=60)
    gone = data.draw(st.sets(st.integers(0, len(rows) - 1), max_size=10))
    kept = [row for index, row in enumerate(rows) if index not in gone]
    repeats = data.draw(st.integers(0, 20))
    written = kept + kept[:repeats]
    random.Random(data.draw(st.integers(0, 2**32))).shuffle(written)
    with TemporaryDirectory() as folder:
        recording = load_recording(write_ngsim_text(Path(folder) / "t.txt", written), cache=False)
    start = min(row.frame for row in kept)
    present = {(row.frame - start, row.vehicle) for row in kept}
    frames = recording.frames
    seen = {(int(t), int(frames.vehicle[t, k])) for t, k in zip(*np.nonzero(frames.valid), strict=True)}
    assert seen == present
    assert sum(item.rows for item in recording.dropped) == repeats
    for t, k in zip(*np.nonzero(frames.valid), strict=True):
        began = (t - 1, int(frames.vehicle[t, k])) not in present
        assert (frames.first[t, k] == t) == began


def sway(x: float) -> float:
    """A road that swings 4 m to the right and back over 300 m: more than a lane's width."""
    return 4.0 * math.sin(x / 300 * math.pi) ** 2


def test_a_bent_road_is_straightened(tmp_path: Path) -> None:
    rows = [row for n in range(12) for row in drive(n, n % 4 + 1, begin=12 * n, bend=sway)]
    recording = load_recording(write_ngsim_csv(tmp_path / "t.csv", rows))
    for number in range(12):
        track = by_vehicle(recording, number)
        lane = recording.lane(number % 4 + 1)
        assert set(track["lane"].tolist()) == {lane.id}
        assert np.abs(track["y"] - lane.centre).max() < 0.25
        assert np.abs(track["vy"]).max() < 0.3
    assert [lane.width for lane in recording.lanes] == pytest.approx([LANE_WIDTH] * 4, abs=0.1)
    assert any(note.startswith("road straightened: its axis wanders by 4") for note in recording.notes)


def test_a_short_lane_is_no_lane_of_the_road(tmp_path: Path) -> None:
    rows = traffic(3) + drive(9, 4, x=150.0, frames=40)
    recording = load_recording(write_ngsim_csv(tmp_path / "t.csv", rows))
    assert len(recording.lanes) == 3
    assert set(by_vehicle(recording, 9)["lane"].tolist()) == {0}


def test_a_thin_lane_between_two_others_is_one_of_the_road(tmp_path: Path) -> None:
    rows = drive(1, 1) + drive(2, 2, x=120.0, frames=100) + drive(3, 3)
    recording = load_recording(write_ngsim_csv(tmp_path / "t.csv", rows))
    assert len(recording.lanes) == 3


def test_flickering_lane_ids_give_way_to_geometry(tmp_path: Path) -> None:
    rows = [
        Row(**{**vars(row), "lane": row.lane % 3 + 1}) if row.frame % 7 == 0 else row for row in traffic()
    ]
    recording = load_recording(write_ngsim_csv(tmp_path / "t.csv", rows))
    for number in (1, 2, 3):
        assert set(by_vehicle(recording, number)["lane"].tolist()) == {number}


def test_a_recorded_speed_that_positions_contradict_is_set_aside(tmp_path: Path) -> None:
    rows = traffic(2) + [Row(**{**vars(row), "vx": 22.0}) for row in drive(3, 3)]
    recording = load_recording(write_ngsim_csv(tmp_path / "t.csv", rows))
    assert by_vehicle(recording, 3)["vx"] == pytest.approx(np.full(200, 15.0))
    assert "1 vehicle's vx from positions, which contradict v_Vel" in recording.notes


def test_a_recorded_speed_near_the_positions_stays(tmp_path: Path) -> None:
    rows = traffic(2) + [Row(**{**vars(row), "vx": 15.5}) for row in drive(3, 3)]
    recording = load_recording(write_ngsim_csv(tmp_path / "t.csv", rows))
    assert by_vehicle(recording, 3)["vx"] == pytest.approx(np.full(200, 15.5))


def test_rows_without_a_size_are_dropped_and_reported(tmp_path: Path) -> None:
    rows = [*traffic(), Row(5, 40, 50.0, 1.8, length=0.0)]
    recording = load_recording(write_ngsim_csv(tmp_path / "t.csv", rows))
    assert 40 not in recording.vehicle_class
    assert [(item.reason, item.rows) for item in recording.dropped] == [
        ("vehicle's length or width is not above 0", 1)
    ]


def test_header_names_in_any_case_and_numbers_with_commas(tmp_path: Path) -> None:
    path = write_ngsim_csv(tmp_path / "t.csv", traffic(), header=NGSIM.upper())
    lines = path.read_text().splitlines()
    cells = lines[1].split(",")
    cells[3] = f'"{int(cells[3]):,}"'
    path.write_text("\n".join([lines[0], ",".join(cells), *lines[2:], ""]))
    assert load_recording(path).frame_count == 200


def test_one_of_several_sites_is_chosen(tmp_path: Path) -> None:
    us101 = write_ngsim_csv(tmp_path / "a.csv", traffic(3), site="us-101").read_text()
    i80 = write_ngsim_csv(tmp_path / "b.csv", traffic(2), site="i-80").read_text()
    street = write_ngsim_csv(tmp_path / "c.csv", traffic(2), site="peachtree").read_text()
    path = tmp_path / "all.csv"
    path.write_text(us101 + "".join(text.split("\n", 1)[1] for text in (i80, street)))
    with pytest.raises(
        UserError, match=f"holds i-80, peachtree, us-101; choose one, for example {path}#i-80"
    ):
        load_recording(path)
    with pytest.raises(UserError, match="no part 'us-102'; it holds i-80, peachtree, us-101"):
        load_recording(f"{path}#us-102")
    with pytest.raises(UserError, match="peachtree is not a freeway"):
        load_recording(f"{path}#peachtree")
    assert len(load_recording(f"{path}#us-101").lanes) == 3
    assert len(load_recording(f"{path}#i-80").lanes) == 2


def test_one_of_several_periods_is_chosen(tmp_path: Path) -> None:
    from tests.traffic.writing import ngsim_cells

    early = [ngsim_cells(row) for row in traffic(2)]
    late = [ngsim_cells(row, start=1_118_847_880_000) for row in traffic(3)]
    path = tmp_path / "t.csv"
    path.write_text(
        "\n".join([NGSIM + ",Location", *(",".join([*row, "us-101"]) for row in late + early), ""])
    )
    with pytest.raises(UserError, match="holds us-101/1, us-101/2"):
        load_recording(path)
    assert len(load_recording(f"{path}#us-101/1").lanes) == 2
    assert len(load_recording(f"{path}#us-101/2").lanes) == 3


def test_lane_ids_that_are_no_lanes_are_refused(tmp_path: Path) -> None:
    rows = traffic(2) + [
        Row(**{**vars(row), "lane": 3, "vehicle": 3, "y": row.y + 1.0}) for row in drive(2, 2)
    ]
    with pytest.raises(UserError, match=r"lanes 2 and 3 lie 1\.0 m apart"):
        load_recording(write_ngsim_csv(tmp_path / "t.csv", rows))


@given(
    st.lists(st.floats(-100, 100), min_size=1, max_size=40),
    st.sets(st.integers(1, 39), max_size=4),
)
def test_slopes_are_those_of_least_squares(values: list[float], borders: set[int]) -> None:
    track = np.array(values)
    starts = np.array([0, *sorted(border for border in borders if border < len(track))])
    found = slopes(track, starts, WINDOW)
    for start, end in zip(starts, [*starts[1:], len(track)], strict=True):
        for row in range(start, end):
            low, high = max(start, row - WINDOW // 2), min(end, row + WINDOW // 2 + 1)
            expected = np.polyfit(np.arange(low, high), track[low:high], 1)[0] if high - low > 1 else 0.0
            assert found[row] == pytest.approx(expected, abs=1e-6)
