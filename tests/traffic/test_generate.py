"""Synthetic recordings are made as ordered, and written whole or not at all."""

from __future__ import annotations

import builtins
import importlib.util
import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from drlsl.cli import run
from drlsl.errors import UserError
from drlsl.traffic import (
    PRESETS,
    Tracks,
    VehicleClass,
    find_preset,
    generate,
    load_recording,
    recording_report,
    simulate,
    write_highd,
)
from drlsl.traffic.highd_writer import HighdContent

needs_sumo = pytest.mark.skipif(importlib.util.find_spec("libsumo") is None, reason="needs the extra sumo")

SMALL = replace(PRESETS["highway-train"], frame_rate=10.0, run_up=200.0, run_out=100.0, warm_up=30.0)


@pytest.fixture(scope="module")
def content() -> HighdContent:
    pytest.importorskip("libsumo", reason="needs the extra sumo")
    return simulate(SMALL, seed=5, minutes=0.2)


def by_hand() -> HighdContent:
    """Car 1 changes from the lower of two lanes to the upper; truck 2 drives the other way."""
    frame = np.array([0, 1, 2, 0, 1])
    vehicle = np.array([1, 1, 1, 2, 2])
    x = np.array([50.0, 51.2, 52.4, 300.0, 299.04])
    y = np.array([24.5, 24.0, 23.5, 10.0, 10.0])
    vx = np.array([30.0, 30.0, 30.0, -24.0, -24.0])
    vy = np.array([-10.0, -10.0, -15.0, -0.001, 0.0])
    length = np.array([4.0, 4.0, 4.0, 14.0, 14.0])
    width = np.array([2.0, 2.0, 2.0, 2.5, 2.5])
    return HighdContent(
        tracks=Tracks(x, y, vx, vy, length, width, frame, vehicle),
        ax=np.zeros(5),
        ay=np.zeros(5),
        vehicle_class={1: VehicleClass.CAR, 2: VehicleClass.TRUCK},
        frame_rate=25.0,
        upper_markings=(8.0, 12.0),
        lower_markings=(20.0, 24.0, 28.0),
        speed_limit=None,
    )


def test_what_is_written_by_hand_is_read_back(tmp_path: Path) -> None:
    recording = load_recording(write_highd(by_hand(), tmp_path / "out"))
    frames, given = recording.frames, by_hand().tracks
    for index in range(len(given)):
        place = (
            given.frame[index],
            int(np.flatnonzero(frames.vehicle[given.frame[index]] == given.vehicle[index])[0]),
        )
        for name in ("x", "y", "vx", "length", "width"):
            assert getattr(frames, name)[place] == pytest.approx(getattr(given, name)[index], abs=0.0051)
    assert recording.vehicle_class == by_hand().vehicle_class
    assert [lane.centre for lane in recording.lanes] == [10.0, 22.0, 26.0]


def test_the_derived_columns_mean_what_highd_means(tmp_path: Path) -> None:
    folder = write_highd(by_hand(), tmp_path / "out")
    tracks = pd.read_csv(folder / "01_tracks.csv")
    assert tracks["laneId"].tolist() == [5, 5, 4, 2, 2]
    assert tracks["frame"].min() == 1
    assert "-0.00" not in (folder / "01_tracks.csv").read_text()
    vehicles = pd.read_csv(folder / "01_tracksMeta.csv")
    assert vehicles["drivingDirection"].tolist() == [2, 1]
    assert vehicles["numLaneChanges"].tolist() == [1, 0]
    assert vehicles["class"].tolist() == ["Car", "Truck"]
    assert vehicles["finalFrame"].tolist() == [3, 2]
    assert vehicles["minXVelocity"].tolist() == [30.0, 24.0]
    meta = pd.read_csv(folder / "01_recordingMeta.csv").iloc[0]
    assert (meta["numCars"], meta["numTrucks"], meta["speedLimit"]) == (1, 1, -1.0)
    assert (meta["upperLaneMarkings"], meta["lowerLaneMarkings"]) == ("8.00;12.00", "20.00;24.00;28.00")


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_an_existing_recording_is_kept_unless_forced(tmp_path: Path) -> None:
    out = write_highd(by_hand(), tmp_path / "out", compress=True)
    before = contents(out)
    with pytest.raises(UserError, match="exists already; choose another folder or add --force"):
        write_highd(by_hand(), out)
    assert contents(out) == before
    write_highd(by_hand(), out, force=True)
    assert sorted(contents(out)) == ["01_recordingMeta.csv", "01_tracks.csv", "01_tracksMeta.csv"]


def test_force_deletes_nothing_but_recordings(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("keep me")
    with pytest.raises(
        UserError, match=r"--force replaces only recordings, and thesis\.tex is not part of one"
    ):
        write_highd(by_hand(), tmp_path, force=True)
    assert contents(tmp_path) == {"thesis.tex": b"keep me"}


@pytest.mark.parametrize("step", ["write_bytes", "rename"])
def test_a_failed_write_leaves_everything_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    out = write_highd(by_hand(), tmp_path / "out")
    before = contents(out)
    real = getattr(Path, step)

    def fail(self: Path, *arguments: Any) -> Any:
        if self.name == "new" or step == "write_bytes":
            raise OSError("disk full")
        return real(self, *arguments)

    monkeypatch.setattr(Path, step, fail)
    with pytest.raises(UserError, match="cannot be written: disk full"):
        write_highd(by_hand(), out, force=True, compress=True)
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert contents(out) == before


def test_a_file_in_the_way_is_refused(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("")
    with pytest.raises(UserError, match="is a file, expected a folder"):
        write_highd(by_hand(), tmp_path / "out", force=True)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_pipe_in_the_way_is_called_so(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "out")
    with pytest.raises(UserError, match="is a device or a pipe, expected a folder"):
        write_highd(by_hand(), tmp_path / "out", force=True)


@pytest.mark.skipif(os.name == "nt", reason="Windows ends processes without a signal")
def test_a_command_that_is_terminated_leaves_nothing_behind(tmp_path: Path) -> None:
    """SIGTERM arrives while the folder is half-written: what was begun is deleted, as after Ctrl-C."""
    code = (
        "import os, signal, sys\n"
        "from drlsl.cli import main\n"
        "from drlsl.traffic import highd_writer\n"
        "highd_writer._swap = lambda *_, **__: os.kill(os.getpid(), signal.SIGTERM)\n"
        "main(['data', 'cut', 'freeway', '--end', '1', '--out', sys.argv[1]])\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "out")], capture_output=True, text=True, timeout=60
    )
    assert list(tmp_path.iterdir()) == []
    assert (done.returncode, done.stdout, done.stderr) == (128 + signal.SIGTERM, "", "")


def test_a_command_runs_in_any_thread(tmp_path: Path) -> None:
    """Signals go to the main thread, and only it may handle them."""
    line = ["data", "cut", "freeway", "--end", "1", "--out", str(tmp_path / "out")]
    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(run, line).result() == 0
    assert (tmp_path / "out").is_dir()


def test_without_sumo_there_is_a_way_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def missing(name: str, *arguments: Any, **options: Any) -> Any:
        if name == "libsumo":
            raise ImportError("No module named 'libsumo'", name=name)
        return real(name, *arguments, **options)

    monkeypatch.setattr(builtins, "__import__", missing)
    with pytest.raises(UserError, match=r"libsumo is missing.*pip install 'drlsl\[sumo\]'"):
        simulate(SMALL, seed=1, minutes=0.1)


@pytest.mark.parametrize("minutes", [0.0, -1.0, float("nan"), float("inf")])
def test_a_length_that_is_none_is_refused(minutes: float) -> None:
    with pytest.raises(UserError, match="minutes"):
        simulate(SMALL, seed=1, minutes=minutes)


def test_an_unknown_preset_is_refused() -> None:
    expected = "preset 'moon': no such preset; expected one of highway-train, highway-test, freeway"
    with pytest.raises(UserError, match=expected):
        find_preset("moon")


@needs_sumo
def test_the_same_seed_makes_the_same_files(content: HighdContent, tmp_path: Path) -> None:
    one = write_highd(content, tmp_path / "one")
    other = write_highd(simulate(SMALL, seed=5, minutes=0.2), tmp_path / "other")
    third = write_highd(simulate(SMALL, seed=6, minutes=0.2), tmp_path / "third")
    for path in one.iterdir():
        assert path.read_bytes() == (other / path.name).read_bytes()
    assert (one / "01_tracks.csv").read_bytes() != (third / "01_tracks.csv").read_bytes()


@needs_sumo
def test_what_is_made_is_a_sound_recording(content: HighdContent, tmp_path: Path) -> None:
    recording = load_recording(write_highd(content, tmp_path / "out", compress=True))
    report = recording_report(recording)
    assert recording.frame_count == 120
    assert recording.dropped == ()
    assert recording.notes == ()
    assert report.overlaps == 0
    assert {lane.direction.sign for lane in recording.lanes} == {-1, 1}
    for lane in recording.lanes:
        here = recording.frames.valid & (recording.frames.lane == lane.id)
        assert (recording.frames.vx[here] * lane.direction.sign > 0).all()


def test_smoothing_keeps_what_is_straight_and_blunts_a_jump() -> None:
    vehicle = np.repeat([1.0, 2.0], 60)
    values = np.concatenate([np.full(60, 3.0), np.where(np.arange(60) < 30, 5.0, 6.0)])
    smooth = generate._smoothed(values, vehicle, 4.0)
    assert smooth[:60] == pytest.approx(np.full(60, 3.0))
    assert np.abs(np.diff(smooth[60:])).max() < 0.11
    assert (smooth[60], smooth[-1]) == pytest.approx((5.0, 6.0))
