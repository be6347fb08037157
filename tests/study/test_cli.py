"""The command as a process: killed, stopped, twice at once, and refused."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from drlsl.cli import run

from .fake import PAUSE, tell_to_fail

ROOT = Path(__file__).parents[2]


def begin(out: Path, pause_s: float = 0.0, *more: str) -> "subprocess.Popen[str]":
    """The study with fake tasks, in a process group of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "tests.study.fake_cli", "study", "--out", str(out), "--jobs", "2", *more],
        cwd=ROOT,
        env={**os.environ, PAUSE: str(pause_s)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def finish(process: "subprocess.Popen[str]", status: int = 0) -> str:
    out, err = process.communicate(timeout=300)
    assert process.returncode == status, err
    return out + err


def until(condition: Callable[[], object], seconds: float = 120.0) -> None:
    """Wait for something another process does."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.05)


def report_of(out: Path) -> Mapping[str, bytes]:
    """Every file of the report by name; the folder's own path, which is in the command, made the same."""
    files = {path for path in (out / "report").rglob("*") if path.is_file()}
    return {
        str(path.relative_to(out)): path.read_bytes().replace(out.name.encode(), b"STUDY") for path in files
    }


def trained_rows(out: Path) -> int:
    return sum(path.read_bytes().count(b"\n") for path in out.glob("runs/*/metrics.csv"))


@pytest.mark.parametrize(
    "whole_group",
    [pytest.param(True, id="group"), pytest.param(False, id="study alone", marks=pytest.mark.slow)],
)
def test_killed_in_the_middle_and_begun_again_the_report_is_the_same(
    tmp_path: Path, whole_group: bool
) -> None:
    assert "report in" in finish(begin(tmp_path / "whole"))
    broken = tmp_path / "broken"
    process = begin(broken, 0.1)
    until(lambda: trained_rows(broken) > 4)
    (os.killpg if whole_group else os.kill)(process.pid, signal.SIGKILL)
    process.wait()
    assert not (broken / "report").exists()
    finish(begin(broken))
    expected = report_of(tmp_path / "whole")
    assert {"report/report.md", "report/report.html", "report/figures/cumulative_reward.png"} <= set(expected)
    assert report_of(broken) == expected


@pytest.mark.slow
def test_ctrl_c_leaves_a_study_that_can_be_gone_on_with(tmp_path: Path) -> None:
    out = tmp_path / "study"
    process = begin(out, 0.1)
    until(lambda: trained_rows(out) > 4)
    os.killpg(process.pid, signal.SIGINT)
    assert "run the same command to resume" in finish(process, 130)
    assert not list(out.glob("failures/*"))
    assert "16/16" in finish(begin(out))


@pytest.mark.slow
def test_two_at_once_in_one_folder(tmp_path: Path) -> None:
    out = tmp_path / "study"
    first = begin(out, 0.05)
    until(lambda: trained_rows(out) > 0)
    told = finish(begin(out), 2)
    assert f"process {first.pid} on" in told
    assert "is at work here (study); wait for it, or stop it" in told
    os.killpg(first.pid, signal.SIGKILL)
    first.wait()


@pytest.mark.slow
def test_runs_that_fail_twice_are_in_the_report_and_in_the_status(tmp_path: Path) -> None:
    out = tmp_path / "study"
    out.mkdir()
    first = begin(out, 0.2)
    until((out / "study.yaml").exists)
    tell_to_fail(out, "m1-seed1", "raise", 2)
    told = finish(first, 1)
    assert "m1-seed1 failed, trying again: told to fail at m1-seed1" in told
    assert "m1-seed1 failed, given up" in told
    report = (out / "report" / "report.md").read_text()
    assert "4 of 16 runs have no result" in report
    assert "- m1-seed1: told to fail at m1-seed1; told to fail at m1-seed1; given up" in report


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--preset", "none"], "'none': no such preset; expected one of benchmark, benchmark-beside, full"),
        (["--preset", "smoke", "--config", "x.yaml"], "expected one of them, not both"),
        (["--methods", "sarsa"], "no method 'sarsa': expected some of dqn"),
        (["--config", "missing.yaml"], "cannot read"),
        (["--test", "nowhere.csv"], "nowhere.csv: no such file"),
        (["--report-only"], "no study here"),
        (["--jobs", "2", "--ray", "auto"], "--jobs is for this machine"),
    ],
)
def test_refusals(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    told: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["study", *arguments]) == 2
    error = capsys.readouterr().err
    assert told in error
    assert error.count("\n") == 1
