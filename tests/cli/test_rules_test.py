"""`drlsl rules test` as its users meet it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from drlsl.cli import run

RULES = """
:- include('limits.pl').
safe_actions(lane_keeping).
safe_actions(left_lane_change) :- ( far(40) -> \\+ near ; fail ).
front_is_free.
longitudinal_velocity(V) :- V is 10.0.
state([1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.5, 0.5]).
entry_is_safe.
near :- fail.
"""
TABLE = """
scenes:
  - scene: nobody else
    actions: [keep, left]
    target_speed: 10.0
    front_is_free: true
    entry_is_safe: true
    goals: {near: false, "far(X), X = 1": []}
    observation: {front: 1, speed: 0.5}
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.pl").write_text(RULES)
    (tmp_path / "limits.pl").write_text("far(D) :- D > 30.\n")
    (tmp_path / "mine.test.yaml").write_text(TABLE.replace("far(X), X = 1", "X = 1, far(X)"))
    return tmp_path


def test_tables_that_pass(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["rules", "test", "mine.pl"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("2 scenes, 0 wrong; answers checked: interpreter 16, scalar ")


def test_a_wrong_answer(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "other.yaml").write_text(TABLE.replace("[keep, left]", "[keep]").replace("X = 1", "X = 40"))
    assert run(["rules", "test", "mine.pl", "--tables", "other.yaml", "--mutate"]) == 1
    out = capsys.readouterr().out
    assert "other.yaml:3: nobody else (left_to_right)\n" in out
    assert (
        "  actions: expected lane_keeping, got lane_keeping, left_lane_change  [interpreter, scalar, numpy]"
        in out
    )
    assert "got an error: arguments are not sufficiently instantiated" in out or "instantiation error" in out
    assert out.endswith("no mutants: the program must pass its tables first\n")


def test_coverage_names_what_is_missed(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["rules", "test", "mine.pl", "--coverage"]) == 1, "near/0 never answers"
    out = capsys.readouterr().out
    assert "clauses   7 of 8 reached, 87.5%\nbranches  2 of 4 reached, 50.0%\n" in out
    assert "  mine.pl:9:1: near/0 clause 1: answers\n" in out
    column = RULES.splitlines()[3].index("fail") + 1
    assert f"  mine.pl:4:{column}: safe_actions/1 clause 2: else\n" in out


def test_survivors_and_their_reasons(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["rules", "test", "mine.pl", "--mutate", "--jobs", "1", "--json"]) == 1
    data = json.loads(capsys.readouterr().out)
    mutation = data["mutation"]
    names = [survivor["name"] for survivor in mutation["survivors"]]
    assert "far/1 clause 1: D > 30 ==> D >= 30" in names
    assert mutation["noticed"] == mutation["mutants"] - len(names)
    assert mutation["score"] == pytest.approx(mutation["noticed"] / mutation["mutants"])
    reasons = {"survivors": [{"reason": "nobody asks", "mutants": names}]}
    (folder / "mine.mutants.yaml").write_text(json.dumps(reasons))
    assert run(["rules", "test", "mine.pl", "--mutate", "--jobs", "1"]) == 0
    out = capsys.readouterr().out
    assert f"survivors: {len(names)} with a reason, 0 without\nnobody asks\n" in out
    assert "  limits.pl:1:13: far/1 clause 1: D > 30 ==> D >= 30\n" in out


def test_processes_print_the_same(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    told = []
    for jobs in ("1", "2"):
        assert run(["rules", "test", "mine.pl", "--mutate", "--jobs", jobs]) == 1
        told.append(capsys.readouterr().out)
    assert "  this row would notice it: " in told[0] or "  nothing was found" in told[0]
    assert told[0] == told[1]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["none.pl"], "cannot read the rule file none.pl"),
        (["limits.pl"], "no table: expected limits.test.yaml, or name one with --tables"),
        (
            ["limits.pl", "--tables", "mine.test.yaml"],
            "the rule program does not define safe_actions/1",
        ),
        (["mine.pl", "--tables", "none.yaml"], "cannot read none.yaml"),
        (["mine.pl", "--tables", "mine.pl"], "mine.pl"),
        (["mine.pl", "--jobs", "0"], "--jobs"),
        (["mine.pl", "--mutate", "--jobs", "2", "--ray", "auto"], "--jobs is for this machine"),
        (["mine.pl", "--ray", "auto"], "--ray: only the mutants of --mutate are shared"),
    ],
)
def test_refusals(
    folder: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert run(["rules", "test", *arguments]) == 2
    printed = capsys.readouterr()
    assert message in printed.err
    assert printed.err.count("\n") == 1


def test_no_table(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "mine.test.yaml").unlink()
    assert run(["rules", "test", "mine.pl"]) == 2
    assert "no table: expected mine.test.yaml, or name one with --tables" in capsys.readouterr().err


def test_a_reason_that_names_no_mutant(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "mine.mutants.yaml").write_text("survivors:\n  - reason: r\n    mutants: [no such]\n")
    assert run(["rules", "test", "mine.pl", "--mutate"]) == 2
    assert "a reason is given for the mutant 'no such', which does not exist" in capsys.readouterr().err
    (folder / "mine.mutants.yaml").write_text("survivors:\n  - reason: r\n    mutant: no such\n")
    assert run(["rules", "test", "mine.pl", "--mutate"]) == 2
    assert "mine.mutants.yaml:2: survivors.0.mutants is missing" in capsys.readouterr().err
