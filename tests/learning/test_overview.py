"""`drlsl runs`: trainings listed and compared as they are on disk."""

import json
from pathlib import Path

import pytest

from drlsl.cli import run
from drlsl.learning import (
    RunFolder,
    differing_settings,
    find_runs,
    make_config,
    merged,
    overview_of,
    preset_names,
)
from drlsl.learning.config import TrainConfig, preset_values
from drlsl.learning.overview import nearest_preset

from .test_rundir import event

TINY = ["--preset", "tiny", "--device", "cpu", "--set", "env.track_length=400"]


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fake_driving: None) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "120")


@pytest.fixture
def two_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> list[Path]:
    """A whole run, and another that differs from it and was not tested."""
    assert run(["train", *TINY, "--out", "runs/a"]) == 0
    others = [
        "--seed",
        "3",
        "--set",
        "learning.discount=0.9",
        "--set",
        "evaluation.episodes_after_training=0",
    ]
    assert run(["train", *TINY, *others, "--out", "runs/study/runs/b"]) == 0
    capsys.readouterr()
    return [Path("runs/a"), Path("runs/study/runs/b")]


def test_runs_are_found_anywhere_below(two_runs: list[Path]) -> None:
    assert find_runs([Path("runs")]) == two_runs
    assert find_runs([two_runs[1], Path("runs")]) == two_runs[::-1]


def test_a_list_for_people_and_for_programs(two_runs: list[Path], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["runs", "list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    (first,) = [line for line in lines if "runs/a" in line]
    (second,) = [line for line in lines if "runs/study/runs/b" in line]
    assert "tiny +2" in first
    assert "4/4" in first
    assert "tiny +4" in second
    assert run(["runs", "list", "runs/study", "runs/a", "--json"]) == 0
    b, a = json.loads(capsys.readouterr().out)
    rows = RunFolder.open(two_runs[0]).episodes()
    assert a["run"] == "runs/a"
    assert a["mean_return"] == pytest.approx(sum(row["return"] for row in rows) / 4)
    assert a["contacts_at_fault"] + a["contacts_not_at_fault"] == sum(row["contact"] for row in rows)
    assert a["test"]["episodes"] == 2
    assert (b["seed"], b["done"], b["test"]) == (3, 4, None)
    assert b["changed"]["learning.discount"] == 0.9


def test_a_comparison_shows_what_differs_alone(
    two_runs: list[Path], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["runs", "compare", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["settings"] == {
        "seed": [0, 3],
        "learning.discount": [0.95, 0.9],
        "evaluation.episodes_after_training": [2, 0],
    }
    assert [one["run"] for one in found["runs"]] == [str(path) for path in two_runs]
    assert run(["runs", "compare"]) == 0
    out = capsys.readouterr().out
    assert "learning.discount" in out
    assert "batch_size" not in out
    assert "test, time saved" in out


def test_metrics_are_json_lines(two_runs: list[Path], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["runs", "metrics", *map(str, two_runs)]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert lines == [
        {"run": str(root), **row} for root in two_runs for row in RunFolder.open(root).episodes()
    ]


def test_a_damaged_run_does_not_hide_the_others(
    two_runs: list[Path], capsys: pytest.CaptureFixture[str]
) -> None:
    (two_runs[0] / "metrics.csv").write_text("episode\n1\n")
    assert run(["runs", "list", "--json"]) == 1
    printed = capsys.readouterr()
    assert [one["run"] for one in json.loads(printed.out)] == ["runs/study/runs/b"]
    assert printed.err.startswith("drlsl: runs/a/metrics.csv: damaged: ")
    assert printed.err.count("\n") == 1
    assert run(["runs", "compare"]) == 2


@pytest.mark.parametrize(
    ("place", "problem"), [("none", "none: no such folder; "), (".", ".: no run here; `drlsl train --out")]
)
def test_where_there_is_no_run(place: str, problem: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["runs", "list", place]) == 2
    assert problem in capsys.readouterr().err


def test_contacts_and_latest_returns_are_counted(tmp_path: Path, tiny_config: TrainConfig) -> None:
    folder = RunFolder.create(tmp_path / "run", tiny_config)
    assert overview_of(folder).mean_return is None
    for number in range(1, 25):
        folder.append_metrics(event(number))
    found = overview_of(folder)
    assert (found.done, found.contacts_at_fault, found.contacts_not_at_fault) == (24, 0, 24)
    assert found.mean_return == pytest.approx(-1 / 3)


@pytest.mark.parametrize("preset", preset_names())
def test_a_preset_is_nearest_to_itself(preset: str) -> None:
    config = make_config(merged(preset_values(preset), {"seed": 9, "threads": 2}), "test")
    assert nearest_preset(config) == (preset, {"threads": 2})


def test_equal_settings_do_not_differ(tiny_config: TrainConfig) -> None:
    assert differing_settings([tiny_config, tiny_config]) == {}
