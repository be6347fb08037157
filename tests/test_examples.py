"""The programs of examples/ run as a user would run them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"
LINES = 40


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.py")), ids=lambda path: path.name)
def test_an_example_is_short(path: Path) -> None:
    assert len(path.read_text(encoding="utf-8").splitlines()) <= LINES


def test_a_training_is_tuned_and_the_study_continued(tmp_path: Path) -> None:
    pytest.importorskip("optuna", reason="the extra 'tune' is not installed")
    from drlsl.learning import find_runs

    for trials in (1, 2):
        done = subprocess.run(
            [sys.executable, EXAMPLES / "tune.py", "--trials", "1"],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        assert done.stdout.startswith(f"best of {trials}: trial-")
    assert [path.name for path in find_runs([tmp_path])] == ["trial-0", "trial-1"]


def test_a_shielded_walk_does_not_fall() -> None:
    done = subprocess.run(
        [sys.executable, EXAMPLES / "shield_cliff.py"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    words = done.stdout.split()
    without, shielded = (int(words[words.index(word) - 1]) for word in ("without", "with"))
    assert without > 100
    assert shielded == 0
