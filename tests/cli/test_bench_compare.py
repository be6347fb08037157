"""`drlsl bench compare`: two checkouts or wheels, measured in turn."""

from __future__ import annotations

import json
import zipfile
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
        f'#!/bin/sh\necho "{name} $1 $2" >> "{root}/calls"\necho "$*" >> "{root}/{name}.calls"\n'
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
    step = report["env: 1 side by side"]
    assert (step["old_s"], step["new_s"], step["swing"]) == (0.01, 0.02, 1.0)


def test_settings_are_those_of_the_new_versions_training(tmp_path: Path) -> None:
    old, new = checkout(tmp_path, "old"), checkout(tmp_path, "new")
    faster = ["--new-set", "learning.precision=bfloat16", "--new-set", "threads=2"]
    parts = ["--only", "train", "--only", "env", "--pairs", "1"]
    assert run(["bench", "compare", str(old), str(new), *parts, *faster]) == 0
    told, env = "bench train --runs 1 --json", "bench env --runs 1 --json"
    assert (tmp_path / "old.calls").read_text().splitlines() == [told, env]
    settings = "--set learning.precision=bfloat16 --set threads=2"
    assert (tmp_path / "new.calls").read_text().splitlines() == [f"{told} {settings}", env]


def test_queries_are_processes_of_their_own(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    old, new = checkout(tmp_path, "old"), checkout(tmp_path, "new")
    assert run(["bench", "compare", str(old), str(new), "--only", "query", "--pairs", "1"]) == 0
    assert capsys.readouterr().out.splitlines()[1].startswith("query: processor time")
    calls = (tmp_path / "calls").read_text().splitlines()
    assert calls == ["old query --state"] * 5 + ["new query --state"] * 5


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["nowhere", "new"],
            "nowhere: no .venv/bin/drlsl; name a wheel, or a checkout in which `make check` was run",
        ),
        (
            ["old", "new", "--only", "speed"],
            "--only speed: expected one of rules, env, train, query, start, compile, proofs",
        ),
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


def ratios_of(*ratios: float) -> Comparison:
    """A comparison in which the old version took so many seconds, and the new one always one."""
    return Comparison("speed", ratios, (1.0,) * len(ratios))


@given(st.lists(st.floats(0.1, 10.0), min_size=1, max_size=40))
def test_the_interval_holds_the_median(ratios: list[float]) -> None:
    found = ratios_of(*ratios)
    low, high = found.interval
    assert min(ratios) <= low <= found.median <= high <= max(ratios)


def test_of_nine_pairs_the_second_and_the_eighth_bound_the_median() -> None:
    assert ratios_of(9, 1, 8, 2, 7, 3, 6, 4, 5).interval == (2, 8)
    assert ratios_of(5, 1, 4, 2, 3).interval == (1, 5)


def test_the_swing_is_that_of_the_version_that_swings_more() -> None:
    assert Comparison("speed", (1.0, 1.5, 1.2), (3.0, 2.0, 2.5)).swing == 1.5


def wheel(
    folder: Path,
    version: str,
    program: str,
    *,
    name: str = "drlsl",
    tag: str = "py3-none-any",
    python: str = ">=3.9",
) -> Path:
    """A wheel whose command is a text of Python."""
    info = f"{name}-{version}.dist-info"
    files = {
        f"{name}_command.py": program,
        f"{info}/METADATA": f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n"
        f"Requires-Python: {python}\n",
        f"{info}/WHEEL": f"Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: {tag}\n",
        f"{info}/entry_points.txt": f"[console_scripts]\n{name} = {name}_command:main\n",
    }
    record = "".join(f"{path},,\n" for path in [*files, f"{info}/RECORD"])
    path = folder / f"{name}-{version}-{tag}.whl"
    with zipfile.ZipFile(path, "w") as archive:
        for inside, text in {**files, f"{info}/RECORD": record}.items():
            archive.writestr(inside, text)
    return path


def steps(speed: float) -> str:
    """A program that tells made-up steps a second, and the version of its installation."""
    told = {"steps_per_s": {"1": speed}}
    return (
        "import importlib.metadata, json, numpy, sys\n"
        "def main():\n"
        f"    told = {told!r}\n"
        "    told['steps_per_s'][importlib.metadata.version('drlsl')] = 10.0\n"
        "    print(json.dumps(told))\n"
    )


def test_wheels_are_installed_side_by_side_beside_the_packages_of_this_python(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    old, new = (wheel(tmp_path, f"{speed}.0", steps(speed)) for speed in (4, 6))
    assert run(["bench", "compare", str(old), str(new), "--only", "env", "--pairs", "1", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert list(report) == ["env: 1 side by side"]  # each tells a version of its own besides
    assert report["env: 1 side by side"]["median"] == pytest.approx(1.5)


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("missing", "cannot be read: No such file"),
        ("text", "not a wheel"),
        ("other archive", "not a wheel"),
        ("other project", "a wheel of numpy, expected one of drlsl"),
        ("other interpreter", "is not a supported wheel on this platform"),
        ("other version", "requires a different Python"),
        ("does not start", "No module named 'no_such_module'"),
    ],
)
def test_a_wheel_that_cannot_be_compared_is_one_line(
    kind: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "drlsl-1.0-py3-none-any.whl"
    if kind == "text":
        path.write_text("no wheel")
    elif kind == "other archive":
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("a.txt", "a")
    elif kind == "other project":
        path = wheel(tmp_path, "1.0", steps(1.0), name="numpy")
    elif kind == "other interpreter":
        path = wheel(tmp_path, "1.0", steps(1.0), tag="cp27-cp27m-any")
    elif kind == "other version":
        path = wheel(tmp_path, "1.0", steps(1.0), python="<3.9")
    elif kind == "does not start":
        path = wheel(tmp_path, "1.0", "import no_such_module\n")
    assert run(["bench", "compare", str(path), str(path), "--only", "env", "--pairs", "1"]) == 2
    told = capsys.readouterr().err
    assert told.startswith(f"drlsl: {path}: ")
    assert message in told
    assert told.count("\n") == 1
