"""`drlsl data` shows and makes recordings."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from drlsl.cli.data import app
from drlsl.errors import UserError
from drlsl.traffic import bundled_recordings, load_recording, recording_report
from tests.traffic.writing import Row, write_highd

runner = CliRunner()


def run(*arguments: str) -> str:
    result = runner.invoke(app, list(arguments), catch_exceptions=False, env={"COLUMNS": "160"})
    assert result.exit_code == 0, result.output
    return result.output


def test_list_names_the_bundled_recordings() -> None:
    text = run("list")
    assert all(name in text for name in ("highway-train", "highway-test", "freeway", "3 right to left"))
    rows = {row["name"]: row for row in json.loads(run("list", "--json"))}
    assert rows["freeway"]["lanes"] == {"left_to_right": 5}
    assert rows["highway-train"]["duration_s"] == 300.0


def test_list_names_all_in_a_narrow_window() -> None:
    result = runner.invoke(app, ["list"], catch_exceptions=False, env={"COLUMNS": "60"})
    assert "…" not in result.output
    assert all(name in result.output for name in bundled_recordings())
    assert max(map(len, result.output.splitlines())) <= 60


def test_one_frame_is_told_as_one(tmp_path: Path) -> None:
    folder = write_highd(tmp_path / "h", [Row(1, 1, 100.0, 22.0)])
    assert "0.04 s, 1 frame at 25 Hz" in run("info", str(folder))
    assert "1 vehicle, 0.04 s at 25 Hz" in run("convert", str(folder), "--out", str(tmp_path / "out"))


def test_info_describes_a_recording(tmp_path: Path) -> None:
    rows = [Row(1, 1, 100.0, 22.0), Row(1, 1, 100.0, 22.0), Row(1, 2, 200.0, 5.0)]
    folder = write_highd(tmp_path / "h", rows, trucks=[2])
    text = run("info", str(folder))
    assert "1 car, 1 truck" in text
    assert "centre" in text
    assert "dropped: 1 row: row repeated" in text
    assert "note: 1 row has its centre in no lane" in text
    facts = json.loads(run("info", str(folder), "--json"))
    assert facts["trucks"] == 1
    assert facts["lanes"][1]["speed_m_s"] is None


@pytest.mark.parametrize("columns", ["60", "80"])
@pytest.mark.parametrize("name", ["highway-test", "freeway"])
def test_info_is_readable_in_a_narrow_window(name: str, columns: str) -> None:
    result = runner.invoke(app, ["info", name], catch_exceptions=False, env={"COLUMNS": columns})
    report = recording_report(load_recording(name))
    assert "…" not in result.output
    assert max(map(len, result.output.splitlines())) <= int(columns)
    words = result.output.replace("│", " ").split()
    for lane in report.lanes:
        assert lane.speed_m_s is not None
        assert lane.gap_m is not None
        assert f"{lane.speed_m_s.mean:.1f}" in words
        assert f"{lane.gap_m.p50:.1f}" in words
        assert f"{lane.centre_m:.2f}" in words


def test_info_of_nothing_is_a_user_error() -> None:
    with pytest.raises(UserError, match="no such file or folder"):
        runner.invoke(app, ["info", "nope"], catch_exceptions=False)


def test_generate_refuses_before_it_works(tmp_path: Path) -> None:
    for arguments, message in (
        (["--out", str(tmp_path)], "exists already"),
        (["--out", str(tmp_path / "x"), "--preset", "moon"], "preset 'moon': no such preset"),
        (["--out", str(tmp_path / "x"), "--minutes", "0"], "more than 0 and at most 120 minutes"),
    ):
        with pytest.raises(UserError, match=message):
            runner.invoke(app, ["generate", *arguments], catch_exceptions=False)
    assert not (tmp_path / "x").exists()


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("libsumo") is None, reason="needs the extra sumo")
def test_generate_makes_a_recording(tmp_path: Path) -> None:
    out = tmp_path / "made"
    assert "vehicles" in run("generate", "--preset", "highway-test", "--minutes", "0.1", "--out", str(out))
    assert json.loads(run("info", str(out), "--json"))["frames"] == 150


def test_starting_imports_no_pandas() -> None:
    code = "import sys, drlsl.cli.data; sys.exit(bool({'pandas', 'numpy', 'libsumo'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
