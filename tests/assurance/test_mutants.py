"""Which slips are made of a clause, and how they read."""

from __future__ import annotations

from pathlib import Path

import pytest

from drlsl.assurance.clause_text import ClauseText, clause_texts
from drlsl.assurance.mutants import mutants_of
from drlsl.logic import Engine
from tests.assurance.evidence import RULES


def texts(program: str) -> list[ClauseText]:
    engine = Engine()
    engine.consult_text(program, "rules.pl")
    return clause_texts(engine)


def changes(program: str, kind: str) -> set[str]:
    return {mutant.change for mutant in mutants_of(texts(program)) if mutant.kind == kind}


@pytest.mark.parametrize(
    ("program", "kind", "expected"),
    [
        ("p(X) :- X < 1.", "comparison", {"X < 1 ==> X =< 1", "X < 1 ==> X >= 1", "X < 1 ==> X > 1"}),
        ("p(X) :- X \\== a.", "comparison", {"X \\== a ==> X == a"}),
        ("p(X, Y) :- Y is X + 1.", "operator", {"Y is X + 1 ==> Y is X - 1"}),
        ("p(X, Y) :- Y is X * X.", "operator", {"Y is X * X ==> Y is X / X"}),
        ("p(X, Y) :- Y is -X.", "sign", {"Y is -X ==> Y is X"}),
        ("p(X, Y) :- Y is -(X).", "sign", {"Y is -(X) ==> Y is (X)"}),
        ("p(X, Y) :- Y is max(0, X).", "function", {"Y is max(0, X) ==> Y is min(0, X)"}),
        ("p(X, Y) :- Y is abs(X).", "function", {"Y is abs(X) ==> Y is (X)"}),
        ("p :- \\+ q. q.", "negation", {"\\+ q ==> q"}),
        ("p :- q, r. q. r.", "goal", {"q ==> true", "r ==> true"}),
        ("p :- ( q ; \\+ r ). q. r.", "goal", {"q ==> true", "\\+ r ==> true", "r ==> true"}),
        ("p(L) :- findall(X, q(X), L). q(1).", "goal", {"findall(X, q(X), L) ==> true", "q(X) ==> true"}),
        ("p :- left_on. left_on. right_on.", "goal", {"left_on ==> true", "left_on ==> right_on"}),
        ("p(left). p(right). q :- p(left).", "atom", {"p(left) ==> p(right)", "p(right) ==> p(left)"}),
        ("p(a). p(b). p(c).", "atom", {"p(a) ==> p(b)", "p(b) ==> p(c)", "p(c) ==> p(a)"}),
        ("p(X, Y) :- q(X, Y). q(1, 2).", "swap", {"p(X, Y) ==> p(Y, X)", "q(X, Y) ==> q(Y, X)"}),
        ("p(X, Y, Z) :- Z is X - Y.", "swap", {
            "p(X, Y, Z) ==> p(Y, X, Z)", "p(X, Y, Z) ==> p(X, Z, Y)", "Z is X - Y ==> Z is Y - X",
        }),
        ("p(X, Y) :- X * X > Y.", "variable", {
            "X * X > Y ==> Y * X > Y", "X * X > Y ==> X * Y > Y", "X * X > Y ==> X * X > X",
        }),
        ("p(2).", "constant", {f"p(2) ==> p({other})" for other in (3, 1, 0, -2)}),
        ("p(0.0).", "constant", {f"p(0.0) ==> p({other})" for other in (1.0, -1.0, 0.1, -0.1)}),
        ("p(3.6).", "constant", {
            f"p(3.6) ==> p({other})" for other in (3.96, 3.27273, 4.6, 2.6, 0.0, -3.6, 12.96, "1.0")
        }),
        ("p(-1).", "constant", {f"p(-1) ==> p(-{other})" for other in (2, 0)}),
        ("p(a). p(b).", "clause", {"left out"}),
        ("p(a). p(X) :- q(X). q(1). q(2).", "order", {"moved behind clause 2"}),
        ("q(1). q(2).", "order", set()),
    ],
)  # fmt: skip
def test_slips(program: str, kind: str, expected: set[str]) -> None:
    assert changes(program, kind) == expected


@pytest.mark.parametrize("program", ["highway.pl", "paper.pl"])
def test_every_mutant_of_the_rules_has_a_name_of_its_own_and_reads_as_a_clause(program: str) -> None:
    engine = Engine()
    engine.consult(RULES / program)
    mutants = mutants_of(clause_texts(engine))
    names = [mutant.name for mutant in mutants]
    assert len(set(names)) == len(names) > 500
    for mutant in mutants:
        if mutant.text is not None:
            assert mutant.text != mutant.clause.text
            Engine().consult_text(mutant.text)
        path, line, column = mutant.place.rsplit(":", 2)
        text = Path(path).read_text(encoding="utf-8").splitlines()[int(line) - 1]
        assert int(column) <= len(text)


def test_parts_of_a_clause() -> None:
    (clause,) = texts(
        "p(X, [a, b]) :- % a comment, with a comma\n  ( q(X) -> r ; \\+ s(X), t ), X > (1 + 2) * 3, !."
    )

    def shown(part: object) -> str:
        return clause.source.text[slice(*clause.stretch(part))]  # type: ignore[arg-type]  # a Range

    assert [shown(argument) for argument in clause.head.arguments] == ["X", "[a, b]"]
    assert [shown(goal.tokens) for goal in clause.goals] == [
        "q(X)", "r", "\\+ s(X)", "s(X)", "t", "X > (1 + 2) * 3", "!",
    ]  # fmt: skip
