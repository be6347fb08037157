"""Repairs and cuts that are asked for, their counts, and what is written of them."""

from __future__ import annotations

import importlib.util
import math
import os
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from drlsl.cli.data import app
from drlsl.errors import UserError
from drlsl.traffic import Recording, cut, fill_gaps, highd_content, load_recording, smooth, thin, write_highd
from drlsl.traffic.edit import rows_of
from tests.traffic.test_cache import assert_equal
from tests.traffic.wild import rows_of as steady_rows
from tests.traffic.writing import Row
from tests.traffic.writing import write_highd as write_rows

RATE = 25.0
runner = CliRunner()
needs_pyarrow = pytest.mark.skipif(
    importlib.util.find_spec("pyarrow") is None, reason="needs the extra parquet"
)


def accelerating(frames: int = 200) -> list[Row]:
    """One vehicle that speeds up and changes lanes, smoothly."""
    time = np.arange(frames) / RATE
    x, vx = 50.0 + 20.0 * time + 0.5 * time**2, 20.0 + time
    y = 22.0 + 2.0 * (1 - np.cos(np.pi * time / time[-1]))
    vy = 2.0 * np.pi / time[-1] * np.sin(np.pi * time / time[-1])
    return [Row(n + 1, 1, float(x[n]), float(y[n]), float(vx[n]), float(vy[n])) for n in range(frames)]


def recording_of(folder: Path, rows: list[Row]) -> Recording:
    return load_recording(write_rows(folder, rows), cache=False)


def test_a_filled_gap_is_close_to_what_was_driven(tmp_path: Path) -> None:
    rows = accelerating()
    whole = rows_of(recording_of(tmp_path / "whole", rows))
    holed = recording_of(tmp_path / "holed", [row for row in rows if not 60 < row.frame <= 110])
    filled = fill_gaps(holed, 2.0)
    tracks = rows_of(filled)
    assert len(tracks) == len(whole)
    assert np.abs(tracks.x - whole.x).max() < 0.01
    assert np.abs(tracks.y - whole.y).max() < 0.05
    assert np.abs(tracks.vx - whole.vx).max() < 0.05
    assert (filled.frames.first[filled.frames.valid] == 0).all()
    assert "1 gap of at most 2 s filled in tracks with 50 rows" in filled.notes


def test_long_gaps_and_those_of_two_vehicles_are_left(tmp_path: Path) -> None:
    rows = [row for row in accelerating() if not 60 < row.frame <= 110]
    other = [Row(frame, 2, (40.0 if frame < 50 else 300.0) + frame, 26.0, vx=25.0) for frame in range(1, 90)]
    holed = recording_of(tmp_path, rows + [row for row in other if not 40 < row.frame <= 60])
    filled = fill_gaps(holed, 1.5)
    assert (
        "0 gaps of at most 1.5 s filled in tracks with 0 rows; "
        "left: 1 longer, 1 that no vehicle can have driven" in (filled.notes)
    )
    assert len(rows_of(filled)) == len(rows_of(holed))


def test_nothing_is_changed_but_what_was_asked_for(tmp_path: Path) -> None:
    made = load_recording("freeway")
    same = fill_gaps(made, 1.0)
    for (name, left), (_, right) in zip(made.frames.arrays(), same.frames.arrays(), strict=True):
        assert np.array_equal(left, right, equal_nan=left.dtype.kind == "f"), name


def test_cutting_and_thinning(tmp_path: Path) -> None:
    made = load_recording("highway-test")
    part = cut(made, seconds=(10.0, 20.0), metres=(100.0, 300.0))
    assert part.frame_count == 250
    tracks = rows_of(part)
    assert (tracks.x - tracks.length / 2).min() >= 100.0
    assert (tracks.x + tracks.length / 2).max() <= 300.0
    slower = thin(made, 5)
    assert slower.frame_rate == 5.0
    assert np.array_equal(np.sort(slower.frames.x[3]), np.sort(made.frames.x[15]), equal_nan=True) or (
        np.nansum(slower.frames.x[3]) == pytest.approx(np.nansum(made.frames.x[15]))
    )
    with pytest.raises(UserError, match="nothing is left"):
        cut(made, seconds=(1e4, 1e5))


def test_speeds_from_positions(tmp_path: Path) -> None:
    rows = [Row(**{**vars(row), "vx": row.vx + 0.3 * (-1) ** row.frame}) for row in accelerating()]
    made = smooth(recording_of(tmp_path, rows), 0.4)
    assert np.abs(rows_of(made).vx - np.array([row.vx for row in accelerating()])).max() < 0.2
    assert any("velocities from positions over 11 frames" in note for note in made.notes)


def test_converted_to_highd_and_read_again(tmp_path: Path) -> None:
    rows = steady_rows(RATE, {10.0: -1, 14.0: -1, 22.0: 1, 26.0: 1}, frames=60)
    rows = [row for row in rows if not (row.vehicle == 3 and 20 <= row.frame < 30)]
    made = load_recording(
        write_rows(tmp_path / "h", rows, upper=(8.0, 12.0, 16.0), speed_limit=27.78), cache=False
    )
    out = write_highd(highd_content(made), tmp_path / "out")
    again = load_recording(out, cache=False)
    assert [lane.centre for lane in again.lanes] == [lane.centre for lane in made.lanes]
    assert len(again.vehicle_class) == len(made.vehicle_class) + 1, (
        "the vehicle that came back is another one"
    )
    assert np.nanmax(np.abs(np.sort(again.frames.x, axis=1) - np.sort(made.frames.x, axis=1))) <= 0.0051
    assert "locationId" in (out / "01_recordingMeta.csv").read_text()


@needs_pyarrow
@pytest.mark.parametrize("name", ["freeway", "overtake-test"])
def test_parquet_and_back_is_exact(tmp_path: Path, name: str) -> None:
    made, out = load_recording(name), tmp_path / f"{name}.parquet"
    result = CliRunner().invoke(app, ["convert", name, "--out", str(out)], catch_exceptions=False)
    assert result.exit_code == 0
    again = load_recording(out, cache=False)
    assert_equal(made, again)
    assert (made.merging_lanes, made.traffic) == (again.merging_lanes, again.traffic)


@needs_pyarrow
def test_a_bad_parquet_file(tmp_path: Path) -> None:
    path = tmp_path / "t.parquet"
    path.write_bytes(b"PAR1" + bytes(100) + b"PAR1")
    with pytest.raises(UserError, match=r"t\.parquet: cannot be read"):
        load_recording(path, cache=False)


def test_convert_several_and_repair(tmp_path: Path) -> None:
    for number in (1, 2):
        rows = [row for row in accelerating() if not 60 < row.frame <= 70]
        write_rows(tmp_path / "set", rows, part=f"0{number}")
    arguments = ["convert", str(tmp_path / "set"), "--out", str(tmp_path / "out"), "--fill-gaps", "1"]
    result = CliRunner().invoke(app, arguments, catch_exceptions=False)
    assert result.output.count("1 gap of at most 1 s filled in tracks with 10 rows") == 2
    assert [one.name for one in sorted((tmp_path / "out").iterdir())] == ["set-01", "set-02"]
    with pytest.raises(UserError, match="exists already"):
        CliRunner().invoke(app, arguments, catch_exceptions=False)


@pytest.mark.parametrize("every", [2, 3, 7, 10_000])
def test_frame_rates_outlast_the_layout_of_highd(tmp_path: Path, every: int) -> None:
    rows = [Row(frame, 1, 50.0 + 0.001 * frame, 22.0, vx=0.025) for frame in (1, 5, 10_001)]
    made = thin(recording_of(tmp_path / "in", rows), every)
    again = load_recording(write_highd(highd_content(made), tmp_path / "out"), cache=False)
    assert again.frame_rate == made.frame_rate == RATE / every


@pytest.mark.parametrize(
    ("seconds", "expected"),
    [
        (math.nan, "expected seconds above 0"),
        (-math.inf, "expected seconds above 0"),
        (0.03, r"needed, here 0\.08 s or more"),
    ],
)
def test_smoothing_needs_seconds(tmp_path: Path, seconds: float, expected: str) -> None:
    made = recording_of(tmp_path, accelerating(20))
    with pytest.raises(UserError, match=expected):
        smooth(made, seconds)
    assert smooth(made, 0.08).notes[-1].startswith("velocities from positions over 3 frames")


@pytest.mark.parametrize("seconds", [1e300, math.inf])
def test_spans_may_be_longer_than_the_recording(tmp_path: Path, seconds: float) -> None:
    made = recording_of(tmp_path, [row for row in accelerating() if not 60 < row.frame <= 110])
    assert "1 gap of" in fill_gaps(made, seconds).notes[-1]
    assert np.array_equal(rows_of(smooth(made, seconds)).vx, rows_of(smooth(made, 2 * made.duration)).vx)


def test_thinning_leaves_frames(tmp_path: Path) -> None:
    made = recording_of(tmp_path, accelerating(20))
    assert thin(made, 20).frame_count == 1
    with pytest.raises(UserError, match="every 21th frame is asked for, but it has 20 frames"):
        thin(made, 21)
    with pytest.raises(UserError, match="it has 20 frames"):
        thin(made, 10**20)


@pytest.mark.parametrize(("low", "high"), [(math.nan, 5.0), (5.0, math.nan), (5.0, 5.0), (9.0, 5.0)])
def test_a_cut_needs_a_span(tmp_path: Path, low: float, high: float) -> None:
    made = recording_of(tmp_path, accelerating(20))
    with pytest.raises(UserError, match=r"cut to .* to .*: expected two numbers, the lower one first"):
        cut(made, seconds=(low, high))
    with pytest.raises(UserError, match=r"cut to .* to .*: expected two numbers, the lower one first"):
        cut(made, metres=(low, high))


def test_an_empty_cut_says_what_there_was(tmp_path: Path) -> None:
    made = recording_of(tmp_path, accelerating(25))
    with pytest.raises(UserError, match=r"nothing is left: .*; it has 0 to 1 s and 47\.8 to 71\.9 m"):
        cut(made, seconds=(10.0, 20.0))


@pytest.mark.parametrize("force", [[], ["--force"]])
@pytest.mark.parametrize("kind", ["highd", pytest.param("parquet", marks=needs_pyarrow)])
def test_no_two_recordings_are_written_to_one_place(tmp_path: Path, kind: str, force: list[str]) -> None:
    inputs = [str(write_rows(tmp_path / parent / "drive", accelerating(9))) for parent in ("other", "a", "b")]
    out = tmp_path / "out"
    with pytest.raises(
        UserError, match=r"drive.*: .*other.* and .*a.* would both be called so; convert them"
    ):
        runner.invoke(
            app, ["convert", *inputs, "--out", str(out), "--to", kind, *force], catch_exceptions=False
        )
    assert not out.exists()


def test_nothing_is_written_beside_what_exists(tmp_path: Path) -> None:
    inputs = [str(write_rows(tmp_path / name, accelerating(9))) for name in ("a", "b", "c")]
    kept = write_rows(tmp_path / "out" / "b", accelerating(8))
    with pytest.raises(UserError, match="out/b: exists already"):
        runner.invoke(app, ["convert", *inputs, "--out", str(kept.parent)], catch_exceptions=False)
    assert [one.name for one in kept.parent.iterdir()] == ["b"]


@needs_pyarrow
@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
@pytest.mark.parametrize("command", ["convert", "cut"])
def test_only_files_are_replaced_by_files(tmp_path: Path, command: str) -> None:
    made = str(write_rows(tmp_path / "in", accelerating(9)))
    folder, pipe = tmp_path / "d.parquet", tmp_path / "p.parquet"
    folder.mkdir()
    os.mkfifo(pipe)
    for path, what in ((folder, "a folder"), (pipe, "a device or a pipe")):
        with pytest.raises(UserError, match=f"{path.name}: is {what}, expected a file to write"):
            runner.invoke(app, [command, made, "--out", str(path), "--force"], catch_exceptions=False)
    assert pipe.is_fifo()


def test_cut_by_command(tmp_path: Path) -> None:
    arguments = ["cut", "freeway", "--out", str(tmp_path / "out"), "--begin", "10", "--end", "20"]
    assert CliRunner().invoke(app, arguments, catch_exceptions=False).exit_code == 0
    assert load_recording(tmp_path / "out", cache=False).duration == 10.0
