"""CITATION.cff and SECURITY.md say what holds."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
import yaml

import drlsl
from drlsl.logic import Engine, PrologError

ROOT = Path(__file__).parents[1]


def test_the_citation_is_of_this_version() -> None:
    citation: dict[str, Any] = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    released = re.findall(r"^## \[([\d.]+)\] - ([\d-]+)$", changes, re.M)[0]
    assert (citation["version"], str(citation["date-released"])) == released
    assert citation["version"] == drlsl.__version__
    assert citation["license"] in (ROOT / "LICENSE").read_text(encoding="utf-8")


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
