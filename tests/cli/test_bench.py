"""`drlsl bench engine --programs`: a folder of programs, each rated beside SWI-Prolog."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from drlsl.cli.program import app

_RUNNER = CliRunner()


@pytest.mark.skipif(shutil.which("swipl") is None, reason="compares with SWI-Prolog")
def test_programs_of_a_folder_are_rated(tmp_path: Path) -> None:
    (tmp_path / "count.pl").write_text("top :- c(300).\nc(0) :- !.\nc(N) :- M is N - 1, c(M).\n")
    (tmp_path / "cell.pl").write_text("main :- '.'(a, b) = [a | b], write(noise).\n")
    (tmp_path / "differs.pl").write_text("top :- current_prolog_flag(max_arity, unbounded), \\+ p.\np.\n")
    (tmp_path / "broken.pl").write_text("top :- .\n")
    (tmp_path / "other.pl").write_text("run.\n")
    done = _RUNNER.invoke(app, ["bench", "engine", "--programs", str(tmp_path), "--runs", "1", "--json"])
    assert done.exit_code == 0, done.output
    report = json.loads(done.stdout)
    programs = report["programs"]
    assert set(programs) == {"broken", "cell", "count", "differs", "other"}
    assert "syntax error" in programs["broken"]["problem"]
    assert "top/0" in programs["other"]["problem"]
    for program in ("cell", "count", "differs"):
        assert programs[program]["first"]["s"] > 0
        assert programs[program]["repeated"]["ratio"] > 0
    ratios = [programs[program]["first"]["ratio"] for program in ("cell", "count", "differs")]
    assert min(ratios) <= report["geometric_mean"]["first"] <= max(ratios)


@pytest.mark.skipif(shutil.which("swipl") is None, reason="compares with SWI-Prolog")
def test_programs_that_answer_otherwise_are_not_rated(tmp_path: Path) -> None:
    # Only SWI-Prolog has this flag.
    (tmp_path / "here.pl").write_text("top :- \\+ catch(current_prolog_flag(version_data, _), _, fail).\n")
    (tmp_path / "yes.pl").write_text("top.\n")
    done = _RUNNER.invoke(app, ["bench", "engine", "--programs", str(tmp_path), "--runs", "1"])
    assert done.exit_code == 0, done.output
    assert "the answers differ" in done.stdout
    assert "geometric mean of 1" in done.stdout


def test_a_folder_without_programs_is_said(tmp_path: Path) -> None:
    done = _RUNNER.invoke(app, ["bench", "engine", "--programs", str(tmp_path), "--runs", "1"])
    assert "is missing" in str(done.exception)
