"""Rule files that ship are found by their names, in folders too."""

from __future__ import annotations

from pathlib import Path

import pytest

from drlsl.logic import Engine
from drlsl.shield import consult_rules, own_files, program_files, rule_file, rules_folder


@pytest.mark.parametrize("name", ["highway.pl", "envs/straight_road.pl"])
def test_a_file_that_ships_is_found(name: str) -> None:
    assert rule_file(name) == rules_folder() / name


def test_a_file_of_the_user_comes_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own = tmp_path / "envs" / "straight_road.pl"
    own.parent.mkdir()
    own.write_text("a.\n")
    monkeypatch.chdir(tmp_path)
    assert rule_file("envs/straight_road.pl") == Path("envs/straight_road.pl")
    assert rule_file("envs/other.pl") == Path("envs/other.pl")  # the error names what was asked for


def test_a_file_that_only_abolishes_is_one_of_the_program(tmp_path: Path) -> None:
    """Labels and results that are kept by the files of a program would else outlive a change of it."""
    own = tmp_path / "own.pl"
    own.write_text(":- ensure_loaded('highway.pl').\n:- abolish(lane_to_keep/1).\n")
    engine = Engine()
    consult_rules(engine, own)
    assert own_files(engine) == [own]
    assert {file.name for file in program_files(engine)} >= {"own.pl", "highway.pl", "longitudinal.pl"}
