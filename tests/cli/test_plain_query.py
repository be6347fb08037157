"""Lines of `drlsl query` that are read without Typer: Typer reads them alike."""

from __future__ import annotations

import inspect
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drlsl.cli import run
from drlsl.cli.plain_query import plain_query
from drlsl.cli.program import run_program
from drlsl.cli.query_answer import answer_query

ROOT = Path(__file__).parents[2]
SCENE = str(ROOT / "examples" / "scene.json")
PLAIN = ["--state", "--rules", "--goal", "--explain", "--json"]
WORDS = [*PLAIN, *PLAIN, "a.json", "~/b.pl", "a=b", "", "-", "--", "-x", "--what-if", "--state=a", "--help"]


def bound(*args: Any, **kwargs: Any) -> dict[str, Any]:
    """Return all the arguments of a call of `answer_query`; no list and an empty one mean the same."""
    call = inspect.signature(answer_query).bind(*args, **kwargs)
    call.apply_defaults()
    return {name: None if value == [] else value for name, value in call.arguments.items()}


@given(line=st.lists(st.sampled_from(WORDS), max_size=8))
def test_a_plain_line_means_what_it_means_to_typer(line: list[str]) -> None:
    plain = plain_query(["query", *line])
    if plain is None:
        return
    with patch("drlsl.cli.query.answer_query") as answer:
        assert run_program(["query", *line]) == 0
    assert bound(**plain) == bound(*answer.call_args.args, **answer.call_args.kwargs)


@pytest.mark.parametrize(
    "line",
    [
        "--state s.json",
        "--json --state s.json",
        "--rules a.pl --state s.json --rules b.pl --explain",
        "--state s.json --goal front_is_free --json",
    ],
)
def test_what_is_asked_most_is_plain(line: str) -> None:
    assert plain_query(["query", *line.split()]) is not None


@pytest.mark.parametrize("line", [[], ["query"], ["query", "--json"], ["rules", "--state", "s.json"]])
def test_all_other_lines_are_for_typer(line: list[str]) -> None:
    assert plain_query(line) is None


@pytest.mark.parametrize("line", [["query", "--state", "~/s.json"], ["data", "info", "*.csv"]])
def test_typer_expands_what_the_shell_of_windows_leaves(
    line: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[Any] = []
    monkeypatch.setattr(sys, "argv", ["drlsl", *line])
    monkeypatch.setattr("drlsl.cli.os", SimpleNamespace(name="nt"))
    monkeypatch.setattr("drlsl.cli.program.run_program", given.append)
    run()
    assert given == [None]  # Typer looks for the line itself, and expands such a line only


def test_a_reader_that_has_gone_is_no_error() -> None:
    code = "from drlsl.cli import main; main()"
    reader, writer = os.pipe()
    os.close(reader)
    with open(writer, "wb") as out:
        done = subprocess.run(
            [sys.executable, "-u", "-c", code, "query", "--state", SCENE],
            stdout=out,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert (done.returncode, done.stderr) == (1, "")
