"""CITATION.cff, SECURITY.md and the picture of the README show what holds."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from matplotlib.image import imread

import drlsl
from drlsl.cli import run
from drlsl.logic import Engine, PrologError

ROOT = Path(__file__).parents[1]


def test_the_citation_is_of_this_version() -> None:
    citation: dict[str, Any] = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    released = re.findall(r"^## \[([\d.]+)\] - ([\d-]+)$", changes, re.M)[0]
    assert (citation["version"], str(citation["date-released"])) == released
    assert citation["version"] == drlsl.__version__
    assert citation["license"] in (ROOT / "LICENSE").read_text(encoding="utf-8")
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert f"version = {{{released[0]}}}" in readme
    assert f"date    = {{{released[1]}}}" in readme


def test_the_picture_of_the_readme_is_the_one_that_a_query_draws(tmp_path: Path) -> None:
    """Its pixels may differ a little from one release of Matplotlib to the next."""
    drawn = tmp_path / "decision.png"
    assert run(["query", "--state", str(ROOT / "examples" / "scene.json"), "--picture", str(drawn)]) == 0
    shown = ROOT / "docs" / "decision.png"
    assert shown.stat().st_size < 200_000
    assert "](docs/decision.png)" in (ROOT / "README.md").read_text(encoding="utf-8")
    one, other = imread(drawn), imread(shown)
    assert one.shape == other.shape
    assert abs(one - other).mean() < 0.01


@pytest.mark.parametrize(
    "goal",
    [
        "open(out, write, S)",
        "tell(out)",
        "see('scene.json')",
        "shell(ls)",
        "process_create(path(ls), [], [])",
        "getenv('HOME', X)",
        "tcp_socket(S)",
        "delete_file(out)",
        "exists_file(out)",
        "directory_files('.', F)",
        "use_foreign_library(x)",
        "py_call(sys:exit)",
    ],
)
def test_a_rule_file_has_no_way_out(goal: str) -> None:
    with pytest.raises(PrologError, match=r"existence error: procedure \w+/\d does not exist"):
        Engine().once(goal)
