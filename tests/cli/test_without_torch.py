"""Without PyTorch everything but the learner works, and the learner says what to install."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LEARNING = "drlsl: learning needs PyTorch, which is missing: pip install 'drlsl[train]'\n"
TIER = "drlsl: the torch tier needs PyTorch, which is missing: pip install 'drlsl[train]'\n"


def without_torch(arguments: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a command in an interpreter that finds no PyTorch."""
    code = "import sys; sys.modules['torch'] = None; from drlsl.cli import run; sys.exit(run(sys.argv[1:]))"
    return subprocess.run(
        [sys.executable, "-c", code, *arguments], cwd=folder, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("train --out run", LEARNING),
        ("train --out run --resume", LEARNING),
        ("eval run", LEARNING),
        ("study --out run", LEARNING),
        ("bench train", LEARNING),
        ("stress highway-test --episodes 1 --tier torch", TIER),
    ],
)
def test_one_line_says_what_to_install(command: str, message: str, tmp_path: Path) -> None:
    done = without_torch(command.split(), tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (2, "", message)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "command",
    [
        f"query --state {ROOT / 'examples' / 'scene.json'} --explain",
        "stress highway-test --episodes 1",
        "rules check",
        "train --print-config",
        "config show tiny",
        "config schema study",
    ],
)
def test_the_rest_works(command: str, tmp_path: Path) -> None:
    done = without_torch(command.split(), tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout


def test_an_environment_is_made_and_driven(tmp_path: Path) -> None:
    code = (
        "import sys; sys.modules['torch'] = None; import drlsl, gymnasium;"
        "env = gymnasium.make('drlsl/Highway-v0'); env.reset(seed=0); print(env.step(0)[1])"
    )
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True, capture_output=True)
