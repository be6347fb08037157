"""What was answered in an earlier run is not asked again, and nothing else is taken for an answer."""

from __future__ import annotations

import sqlite3
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

from drlsl.cli import run
from drlsl.verify import Case, Request, verify
from drlsl.verify.smt import Algebra, KnownAnswers, Outcome, Solver
from tests.verify.test_algebra import Frame

REQUEST = Request(
    cases=(Case(0, 2, 1, 1),), attack=0, vehicles=2, only=("nobody_alongside", "critical_distance_front")
)


@pytest.fixture
def kept(tmp_path: Path) -> Path:
    """A file with the answers to two properties."""
    path = tmp_path / "new" / "answers.sqlite"
    proved(path)
    return path


def proved(path: Path) -> None:
    assert {one.status for one in verify(replace(REQUEST, kept=path)).results} == {"proved"}


def no_solver(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    asked: list[object] = []

    def ask(*arguments: object) -> Outcome:
        asked.append(arguments)
        return Outcome("unknown", reason="nobody asks")

    monkeypatch.setattr(Solver, "_by_z3", ask)
    return asked


def test_a_second_run_asks_nothing(kept: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = no_solver(monkeypatch)
    proved(kept)
    assert asked == []


def test_without_a_file_all_is_asked(kept: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = no_solver(monkeypatch)
    assert {one.status for one in verify(replace(REQUEST, time_limit=0.5)).results} == {"unknown"}
    assert asked


@pytest.mark.parametrize(
    "damage",
    [
        "UPDATE answers SET seal = x'00'",
        "UPDATE answers SET opinion = 'confirmed'",
        "UPDATE answers SET question = randomblob(32)",
    ],
)
def test_a_damaged_answer_is_none(kept: Path, damage: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with sqlite3.connect(kept) as file:
        assert file.execute(damage).rowcount > 0
    asked = no_solver(monkeypatch)
    results = verify(replace(REQUEST, kept=kept, time_limit=0.5)).results
    assert {one.status for one in results} == {"unknown"}
    assert asked


def test_an_answer_to_another_question_is_none(tmp_path: Path) -> None:
    path = tmp_path / "answers.sqlite"
    KnownAnswers(path).keep(b"one", "alone")
    assert KnownAnswers(path).get(b"one") is not None
    with sqlite3.connect(path) as file:
        ((place,),) = file.execute("SELECT question FROM answers")
    KnownAnswers(path).keep(b"other", "alone")
    with sqlite3.connect(path) as file:
        file.execute("DELETE FROM answers WHERE question = ?", (place,))
        file.execute("UPDATE answers SET question = ?", (place,))
    assert KnownAnswers(path).get(b"one") is None


def test_a_scene_of_the_relaxation_is_no_scene() -> None:
    """Products may be any numbers for a linear solver: its `some` says nothing of the others."""
    algebra, known = Algebra(), KnownAnswers()
    x, y = (algebra.ring.unknown(name, Fraction(1), Fraction(9)) for name in "xy")
    small = algebra.less(algebra.multiply(x, y), algebra.number(5))
    far = algebra.booleans.and_((small, *(algebra.less(algebra.number(3), one) for one in (x, y))))
    linear = Solver(Frame(algebra), linear=True, answers=known)
    exact = Solver(Frame(algebra), linear=False, answers=known)
    assert linear.holds_nowhere(far, 5.0).verdict == "some"
    assert exact.holds_nowhere(far, 5.0).verdict == "none"
    assert linear.holds_nowhere(far, 5.0).verdict == "none"  # what is nowhere is nowhere for both


def test_a_file_that_is_no_file_of_answers_is_told(tmp_path: Path) -> None:
    path = tmp_path / "answers.sqlite"
    path.write_text("no database, but long enough to be taken for one\n" * 40)
    with pytest.warns(UserWarning, match="answers of solvers are not kept"):
        proved(path)


def test_the_command_keeps_answers_unless_told_not_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("DRLSL_CACHE", str(tmp_path))
    command = [
        "rules",
        "verify",
        "--only",
        "nobody_alongside",
        "--vehicles",
        "1",
        "--attack",
        "0",
        "--jobs",
        "1",
    ]
    assert run([*command, "--no-cache"]) == 0
    assert not list(tmp_path.rglob("*.sqlite"))
    assert run(command) == 0
    (file,) = tmp_path.rglob("*.sqlite")
    assert file.parent.name == "proofs"
    asked = no_solver(monkeypatch)
    assert run(command) == 0
    assert asked == []
    capsys.readouterr()
