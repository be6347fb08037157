"""The programs of examples/ run as a user would run them."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

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


def test_who_is_masked_merges() -> None:
    done = subprocess.run(
        [sys.executable, EXAMPLES / "merge.py", "--episodes", "3"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        "merged in 0 of 3 episodes, without the rules",
        "merged in 3 of 3 episodes, with the rules",
    ]


def test_a_notebook_shows_a_scene_a_decision_its_reasons_and_a_drive() -> None:
    nbformat = pytest.importorskip("nbformat", reason="nbclient and ipykernel are not installed")
    nbclient = pytest.importorskip("nbclient", reason="nbclient and ipykernel are not installed")
    notebook = nbformat.read(EXAMPLES / "explain_decision.ipynb", as_version=4)
    nbclient.NotebookClient(notebook, resources={"metadata": {"path": str(EXAMPLES)}}).execute()
    scene, decision, picture, proof, changed, drive = (shown(cell) for cell in notebook.cells if shown(cell))
    assert scene["image/png"].startswith("iVBOR")
    assert picture["image/png"].startswith("iVBOR")
    assert "<th>not offered</th><td>left_lane_change</td>" in decision["text/html"]
    assert "<pre>safe_actions(left_lane_change) fails\n" in proof["text/html"]
    assert "too_close(sports_car," in proof["text/html"]
    assert "<th>not offered</th><td>none</td>" in changed["text/html"]
    assert drive["text/html"].startswith('<iframe srcdoc="&lt;!DOCTYPE html&gt;')


def shown(cell: Any) -> dict[str, str]:
    """What a cell of a notebook shows, by media type; nothing for words and for cells without a value."""
    return {kind: text for output in cell.get("outputs", ()) for kind, text in output.get("data", {}).items()}


def test_a_stored_notebook_holds_no_outputs() -> None:
    for path in EXAMPLES.glob("*.ipynb"):
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        assert not any(cell.get("outputs") or cell.get("execution_count") for cell in cells)
