"""The wheel carries the rules, the recordings and the types."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("hatchling", reason="hatchling builds the wheel")
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        [
            sys.executable,
            "-m",
            "pip",
            "wheel",
            "--quiet",
            "--no-deps",
            "--no-build-isolation",
            "-w",
            str(folder),
            ".",
        ],
        cwd=ROOT,
        check=True,
        capture_output=True,
    )
    (built,) = folder.glob("*.whl")
    return built


def test_the_wheel_carries_rules_recordings_and_types(wheel: Path) -> None:
    names = set(zipfile.ZipFile(wheel).namelist())
    rules = {path.relative_to(ROOT) for path in (ROOT / "rules").rglob("*") if path.is_file()}
    assert {f"drlsl/{path.as_posix()}" for path in rules} <= names
    assert {"drlsl/py.typed", "drlsl/logic/py.typed"} & names
    recordings = {path for path in (ROOT / "drlsl" / "traffic" / "recordings").rglob("*") if path.is_file()}
    assert {str(path.relative_to(ROOT)) for path in recordings} <= names
    assets = (ROOT / "drlsl" / "driving" / "page" / "assets").iterdir()
    assert {f"drlsl/driving/page/assets/{path.name}" for path in assets} <= names
    assert not any(name.startswith(("tests/", "runs/")) for name in names)


def test_an_installed_wheel_finds_its_rules(wheel: Path, tmp_path: Path) -> None:
    zipfile.ZipFile(wheel).extractall(tmp_path)
    code = (
        "import drlsl, pathlib; from drlsl.driving.shield import Shield, default_rules;"
        "print(drlsl.__file__, *default_rules()); Shield.default()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        cwd=tmp_path,
        check=True,
        capture_output=True,
        text=True,
    )
    package, rules = done.stdout.split()
    assert Path(package).is_relative_to(tmp_path)
    assert rules == str(tmp_path / "drlsl" / "rules" / "highway.pl")


def test_an_editable_install_finds_the_rules_of_the_checkout() -> None:
    from drlsl.driving.shield import default_rules

    assert default_rules() == (ROOT / "rules" / "highway.pl",)
