"""`drlsl bench compare`: two checkouts, measured in turn."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drlsl.benchmarks import Comparison
from drlsl.cli import run


def checkout(root: Path, name: str, *, slower: float = 1.0, broken: bool = False) -> Path:
    """A folder whose `drlsl` writes down that it was called and tells made-up speeds."""
    program = root / name / ".venv" / "bin" / "drlsl"
    program.parent.mkdir(parents=True)
    rules = {
        "one_scene_ms": {"scalar": {"5": 2.0 * slower}, "swipl": {"5": 1.0}},
        "batch_us_per_scene": {"numpy": 4.0 * slower},
    }
    told = {
        "rules": rules,
        "env": {"tier": "numpy", "steps_per_s": {"1": 100.0 / slower}, "highway_env": 3.0},
        "train": {"updates_per_s": 50.0 / slower, "bare_updates_per_s": 80.0, "ratio": 0.6},
    }
    for part, speeds in told.items():
        (program.parent / f"{part}.json").write_text(json.dumps(speeds))
    program.write_text(
        f'#!/bin/sh\necho "{name} $1 $2" >> "{root}/calls"\n'
        + ('echo "some trace" >&2; echo "drlsl: out of order" >&2; exit 2\n' if broken else "")
        + f'[ "$1" = bench ] && cat "{program.parent}/$2.json"\nexit 0\n'
    )
    program.chmod(0o755)
    return root / name


def test_each_number_is_a_ratio_and_the_checkouts_take_turns(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    old, new = checkout(tmp_path, "old"), checkout(tmp_path, "new", slower=2.0)
    parts = ["--only", "rules", "--only", "env", "--only", "train"]
    assert run(["bench", "compare", str(old), str(new), *parts, "--pairs", "3", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert {name: found["median"] for name, found in report.items()} == {
        "rules: scalar, 5 vehicles": 0.5,
        "rules: numpy, batch": 0.5,
        "env: 1 side by side": 0.5,
        "train: training": 0.5,
        "train: bare updates": 1.0,
    }
    assert all(found["interval"] == [found["median"]] * 2 for found in report.values())
    calls = (tmp_path / "calls").read_text().split("\n")
    assert [call.split()[0] for call in calls[:6]] == ["old", "new", "new", "old", "old", "new"]


def test_queries_are_processes_of_their_own(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    old, new = checkout(tmp_path, "old"), checkout(tmp_path, "new")
    assert run(["bench", "compare", str(old), str(new), "--only", "query", "--pairs", "1"]) == 0
    assert capsys.readouterr().out.startswith("query: processor time")
    calls = (tmp_path / "calls").read_text().splitlines()
    assert calls == ["old query --state"] * 5 + ["new query --state"] * 5


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nowhere", "new"], "nowhere: no .venv/bin/drlsl; name a checkout in which `make check` was run"),
        (["old", "new", "--only", "speed"], "--only speed: expected one of rules, env, train, query"),
        (["old", "broken", "--only", "env"], "ended with 2: drlsl: out of order"),
    ],
)
def test_what_cannot_be_compared_is_one_line(
    arguments: list[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("old", "new", "broken"):
        checkout(tmp_path, name, broken=name == "broken")
    assert run(["bench", "compare", *arguments, "--pairs", "1"]) == 2
    told = capsys.readouterr().err
    assert message in told
    assert told.count("\n") == 1


@given(st.lists(st.floats(0.1, 10.0), min_size=1, max_size=40))
def test_the_interval_holds_the_median(ratios: list[float]) -> None:
    found = Comparison("speed", tuple(ratios))
    low, high = found.interval
    assert min(ratios) <= low <= found.median <= high <= max(ratios)


def test_of_nine_pairs_the_second_and_the_eighth_bound_the_median() -> None:
    assert Comparison("speed", (9, 1, 8, 2, 7, 3, 6, 4, 5)).interval == (2, 8)
    assert Comparison("speed", (5, 1, 4, 2, 3)).interval == (1, 5)
