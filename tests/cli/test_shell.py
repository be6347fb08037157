"""Tests of the top level: what a person types and sees."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from drlsl.cli.shell import Shell
from drlsl.logic import Engine

_RULES = "too_near(V) :- gap(V, G), G < 9.8.\ngap(v23, 4.2).\ngap(v7, 50).\n"


@pytest.fixture
def rules(tmp_path: Path) -> Path:
    path = tmp_path / "rules.pl"
    path.write_text(_RULES, encoding="utf-8")
    return path


def _session(lines: list[str], files: list[Path], keys: str = "") -> int:
    """Run a session over typed lines; `keys` are pressed at solutions."""
    typed, pressed = iter(lines), iter(keys)

    def read_line(_prompt: str) -> str:
        line = next(typed, None)
        if line is None:
            raise EOFError
        return line

    return Shell(Engine(), read_line, lambda: next(pressed)).run(files)


def test_solutions_are_shown_one_by_one(rules: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert _session(["gap(X, Y)."], [rules], ";") == 0
    assert capsys.readouterr().out.splitlines()[2:6] == ["X = v23,", "Y = 4.2 ;", "X = v7,", "Y = 50."]


def test_any_other_key_stops(rules: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _session(["gap(X, _)."], [rules], "\n")
    assert "X = v23 .\n" in capsys.readouterr().out


def test_true_false_and_shared_variables(capsys: pytest.CaptureFixture[str]) -> None:
    _session(["true.", "fail.", "X = f(Y, Y, _).", "X = (a :- b)."], [])
    assert capsys.readouterr().out.splitlines()[1:] == [
        "true.",
        "false.",
        "X = f(Y, Y, _1).",
        "X = (a:-b).",
        "",
    ]


def test_a_goal_may_go_over_lines(rules: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _session(["gap(", "v7", ", G).", "", "true."], [rules])
    assert "G = 50.\ntrue.\n" in capsys.readouterr().out


def test_errors_are_readable_and_the_session_goes_on(capsys: pytest.CaptureFixture[str]) -> None:
    _session(["a b.", "X is 1 / 0.", "nothing(1).", "atom_length(X, Y).", "true."], [])
    out = capsys.readouterr().out
    assert "query:1:3: syntax error: unexpected 'b'" in out
    assert "evaluation error: zero_divisor, in X is 1/0" in out
    assert "procedure nothing/1 does not exist" in out
    assert "in atom_length(X,Y)" in out
    assert out.endswith("true.\n\n")


def test_explain_says_why(rules: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _session(["explain(too_near(v7))."], [rules])
    assert f"- 50<9.8  (G<9.8)  [{rules}:1] with V = v7, G = 50" in capsys.readouterr().out


def test_a_file_is_loaded_again_after_a_change(rules: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shell = Shell(Engine(), lambda _: "", lambda: ".")
    shell.load(rules)
    rules.write_text(_RULES.replace("v7, 50", "v9, 60"), encoding="utf-8")
    shell._answer("make.")
    shell._answer("gap(v9, X).")
    shell._answer("gap(v7, X).")
    rules.write_text("broken(", encoding="utf-8")
    shell._answer("make.")
    shell._answer("gap(v9, X).")
    out = capsys.readouterr().out
    assert out.splitlines()[2:4] == ["X = 60.", "false."]
    assert f"{rules}:1:8: syntax error: unexpected end of text" in out
    assert out.endswith("X = 60.\n")


def test_files_can_be_loaded_from_the_prompt(rules: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _session([f"['{rules}'].", f"consult('{rules}').", "['no such file'].", "gap(v7, X)."], [])
    out = capsys.readouterr().out
    assert out.count(f"{rules} loaded.") == 2
    assert "no such file" in out
    assert "X = 50." in out


def test_halt_gives_the_status() -> None:
    assert _session(["halt(3)."], []) == 3


def test_it_runs_without_a_terminal(rules: Path) -> None:
    code = "import sys; from drlsl.cli.shell import run_shell; sys.exit(run_shell(sys.argv[1:]))"
    done = subprocess.run(
        [sys.executable, "-c", code, str(rules)],
        input="gap(X, Y).\n;\nhalt.\n",
        capture_output=True,
        text=True,
        timeout=60,
        env={"XDG_STATE_HOME": str(rules.parent), "HOME": str(rules.parent)},
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "X = v7,\nY = 50.\n" in done.stdout
