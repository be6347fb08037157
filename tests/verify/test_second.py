"""The second solver: it says the same, and where it does not, nothing is proved."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path

import pytest

import drlsl.cli
from drlsl.verify import Case, Request, verify
from drlsl.verify.smt import Algebra, Judges, Solver
from drlsl.verify.smt.second import Answer, Cvc5, SolversDisagree
from tests.verify.test_algebra import Frame

pytest.importorskip("cvc5", reason="the extra cvc5")

TRUE = (
    "property(t, 't').\n"
    "violates(t) :- vehicle(ego, _, _, _, V, _, L, W), abs(V) * L + W * W < abs(V) - 1.0.\n"
)
FALSE = "property(f, 'f').\nviolates(f) :- vehicle(ego, _, _, _, V, _, L, W), V * L * W > 6000.0.\n"


@pytest.fixture
def properties(tmp_path: Path) -> Path:
    path = tmp_path / "properties.pl"
    path.write_text(":- discontiguous(property/2).\n:- discontiguous(violates/1).\n" + TRUE + FALSE)
    return path


@pytest.mark.parametrize("solver", ["z3", "cvc5", "both"])
def test_all_prove_and_refute_alike(properties: Path, solver: str) -> None:
    cases = (Case(0, 2, 1, 1),)
    found = verify(Request((), (properties,), vehicles=0, cases=cases, attack=0, solver=solver)).results  # type: ignore[arg-type]
    assert [result.status for result in found] == ["proved", "refuted"]
    assert (found[0].confirmed > 0) is (solver == "both")


def questions() -> tuple[Algebra, Solver]:
    algebra = Algebra()
    return algebra, Solver(Frame(algebra), linear=False, judges=Judges("both"))


def test_a_false_none_of_the_first_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    algebra, solver = questions()
    x = algebra.ring.unknown("x", Fraction(0), Fraction(9))
    from drlsl.verify.smt import Outcome

    monkeypatch.setattr(Solver, "_by_z3", lambda *_: Outcome("none"))
    with pytest.raises(SolversDisagree, match="z3 says that no scene"):
        solver.holds_nowhere(algebra.less(algebra.multiply(x, x), algebra.one), 5.0)


def test_a_false_none_of_the_second_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    algebra, solver = questions()
    x = algebra.ring.unknown("x", Fraction(0), Fraction(9))
    monkeypatch.setattr(Cvc5, "ask", lambda *_: Answer("none"))
    with pytest.raises(SolversDisagree, match="cvc5 says that no scene"):
        solver.holds_nowhere(algebra.less(algebra.multiply(x, x), algebra.one), 5.0)


def test_no_answer_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    algebra, solver = questions()
    x = algebra.ring.unknown("x", Fraction(0), Fraction(9))
    monkeypatch.setattr(Cvc5, "ask", lambda *_: Answer("unknown"))
    far = algebra.less(algebra.number(100), algebra.add(algebra.multiply(x, x), x))
    assert solver.holds_nowhere(far, 5.0).verdict == "none"
    assert (solver._judges.confirmed, solver._judges.unanswered) == (0, 1)


def test_the_command_line_tells(properties: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = [
        "rules",
        "verify",
        "--property",
        str(properties),
        "--only",
        "t",
        "--vehicles",
        "0",
        "--jobs",
        "1",
    ]
    command += ["--attack", "0", "--solver", "both"]
    assert drlsl.cli.run(command) == 0
    assert "confirmed by cvc5" in capsys.readouterr().out
    assert drlsl.cli.run([*command, "--json"]) == 0
    (result,) = json.loads(capsys.readouterr().out)["results"]
    assert result["confirmed"] > 0
    assert result["unanswered"] == 0
