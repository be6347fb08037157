"""The data set of the measurements is made alike again, resumes, and is traffic; a small one is measured."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from drlsl.traffic import find_sources, load_source
from scripts.large_data_set import make, measured

MINUTES = 0.1


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("DRLSL_CACHE", str(tmp_path / "cache"))
    make(tmp_path / "set", 2, MINUTES)
    return tmp_path / "set"


def test_recordings_are_a_function_of_their_number_and_none_is_made_twice(
    root: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tables = [path.read_bytes() for path in sorted(root.rglob("*_tracks.csv"))]
    assert len(set(tables)) == 2
    made = [load_source(source) for source in find_sources(root / "data")]
    assert [one.frame_count for one in made] == [150, 150]
    assert all(one.frames.valid.sum(axis=1).mean() > 30 for one in made)
    capsys.readouterr()
    make(root, 2, MINUTES)
    assert not capsys.readouterr().out
    (root / "data" / "02" / "02_tracks.csv").unlink()
    for path in (root / "data" / "02").iterdir():
        path.unlink()
    (root / "data" / "02").rmdir()
    make(root, 2, MINUTES)
    assert [path.read_bytes() for path in sorted(root.rglob("*_tracks.csv"))] == tables


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="Linux tells the memory of a process")
def test_a_small_set_is_measured(root: Path) -> None:
    found = measured(root, "this", Path(__file__).resolve().parent.parent)
    assert json.dumps(found)
    assert 0.1 < found["start"]["private_gb"] < 1.0
    assert all(speed > 1000 for speed in found["speed"]["steps_per_s"])
