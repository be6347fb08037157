"""`check_program` and the `drlsl rules` commands."""

from __future__ import annotations

from pathlib import Path

import pytest

from drlsl.cli import run
from drlsl.logic import Engine
from drlsl.lowering import Report, check_program
from drlsl.lowering.frontend import Query
from drlsl.lowering.ir import Relation, Schema

ENVIRONMENTS = Path(__file__).parents[2] / "rules" / "envs"

SCHEMA = Schema([Relation("car", ("atom", "float"), key=0), Relation("limit", ("float",), single=True)])


def report(text: str, *asked: Query) -> Report:
    engine = Engine()
    engine.consult_text(text, "rules.pl")
    return check_program(engine, SCHEMA, asked)


def findings(text: str) -> list[str]:
    return [str(finding) for finding in report(text).findings]


NO_FAST = "rules.pl:1: fast/1 is not defined; did you mean last/2?"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("p(X) :- car(X, _), fast(X).", [NO_FAST]),
        ("p(X) :- car(X, _), \\+ ( fast(X) ; limit(2.0) ).", [NO_FAST]),
        ("p(N) :- aggregate_all(count, fast(_), N).", [NO_FAST]),
        ("p(X) :- car(X, _), call(fast, X).", [NO_FAST]),
        ("p(X) :- findall(Y, Z^car(Y, Z), X).", []),
        ("p(X) :- member(X, [1]), atom_length(X, _), exclude(q, [], _). q(_).", []),
        ("p(X) :- car(X, Y).", ["rules.pl:1: singleton variable: Y"]),
        (
            "p(X) :- !, limit(X).\np(1.0).",
            ["rules.pl:2: this clause of p/1 is never reached: the one at rules.pl:1 cuts it off"],
        ),
        ("p(1.0) :- !.\np(X) :- limit(X).", []),
        ("p(X) :- limit(X), !.\np(1.0).", []),
        (
            "p(X) :- \\+ car(X, 1.0), car(Y, _), Y = X. q(X) :- \\+ car(Y, _), car(Y, X).",
            ["rules.pl:1: Y is unbound in this negation and bound only behind it"],
        ),
        ("p :- \\+ car(_, 1.0), \\+ ( car(X, Y), Y > 2.0, X \\== ego ).", []),
    ],
)
def test_findings(text: str, expected: list[str]) -> None:
    assert findings(text) == expected


def test_tiers_of_each_predicate() -> None:
    text = (
        "near(C, X) :- car(C, X), limit(L), X < L.\n"
        "pair(f(C)) :- near(C, _).\n"
        "loose(_) :- near(_, _).\n"
        "shout(X) :- write(X).\n"
        "all(X) :- shout(X).\n"
    )
    found = {predicate.indicator: predicate for predicate in report(text).predicates}
    assert (found["near/2"].refused, found["near/2"].array_answer) == (None, None)
    assert found["pair/1"].refused is None
    assert found["pair/1"].scalar_answer is None
    assert found["pair/1"].array_answer is not None
    assert found["loose/1"].scalar_answer == "its answer holds an unbound variable"
    assert found["shout/1"].refused == found["all/1"].refused == "rules.pl:4: it calls write/1"


def test_what_no_rule_calls() -> None:
    text = "p :- q. q :- \\+ r. r :- limit(1.0). s :- p."
    assert report(text, Query("s", 0, "holds")).uncalled == ()
    assert report(text).uncalled == ("s/0",)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("p(X) :- limit(X).", []),
        ("p(X) :- limit(L), X is L / 2.0.", []),
        ("p(X) :- limit(L), X is 1.0 / L.", ["rules.pl:1: a division by 1e-30 or less"]),
        ("p(X) :- car(_, L), X is sqrt(L).", ["rules.pl:1: a square root of a negative number"]),
        ("p(X) :- car(_, L), X is sqrt(L * L).", []),
        (
            "p(X) :- car(_, L), q(L, X).\nq(L, X) :- X is L ^ 0.5.",
            ["rules.pl:2: a power of a negative number, or of 0 to a negative exponent"],
        ),
        ("p(X) :- limit(L), X is (L ^ 2 + 1.0) ^ 0.5.", []),
        ("p(X) :- limit(L), X is exp(L).", ["rules.pl:1: a number beyond 1e+300"]),
        ("p(X) :- limit(L), X is L + left.", ["rules.pl:1: an expression without a value"]),
        ("p(X) :- limit(X), \\+ ( car(_, Y), 1.0 / Y > X ).", ["rules.pl:1: a division by 1e-30 or less"]),
    ],
)
def test_when_a_query_is_undecided(text: str, expected: list[str]) -> None:
    query = Query("p", 1, "first")
    doubts = report(text, query).doubts
    assert [str(doubt) for doubt in doubts.get(query, ())] == expected


def test_check_prints_when_a_query_is_undecided(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["rules", "check"]) == 0
    out = capsys.readouterr().out
    assert "answered by the slower interpreter" in out
    assert "\n  longitudinal_velocity/1\n    " in out
    assert "\n  safe_actions/1\n" not in out


def test_the_rules_that_ship_look_right(capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("highway.pl", "paper.pl"):
        assert run(["rules", "check", str(Path(__file__).parents[2] / "rules" / name)]) == 0
        out = capsys.readouterr().out
        assert "no findings" in out
        assert "interpreter only" not in out


def test_check_says_what_is_wrong_and_exits_with_1(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rules = tmp_path / "mine.pl"
    rules.write_text("safe_actions(X) :- nowhere(X).\nnoise(X) :- write(X).\n", encoding="utf-8")
    assert run(["rules", "check", str(rules)]) == 1
    out = capsys.readouterr().out
    assert f"error  {rules}:1: nowhere/1 is not defined" in out
    assert f"noise/1  {rules}:2: it calls write/1" in out


def test_rules_of_other_environments_are_checked_for_what_is_theirs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("crossing", "frozen_lake", "minigrid", "straight_road"):
        assert run(["rules", "check", str(ENVIRONMENTS / f"{name}.pl")]) == 0
        assert "no findings" in capsys.readouterr().out
    rules = tmp_path / "taxi.pl"
    rules.write_text(
        ":- dynamic taxi/2.\noffered(A) :- member(A, [up, down]), \\+ objection(A, _).\n"
        "objection(up, top) :- taxy(0, _).\n",
        encoding="utf-8",
    )
    assert run(["rules", "check", str(rules)]) == 1
    out = capsys.readouterr().out
    assert "facts: taxi/2\n" in out
    assert f"\n1 finding\n  error  {rules}:3: taxy/2 is not defined; did you mean taxi/2?\n" in out


def test_a_table_of_facts_tells_the_tiers_of_rules_for_other_environments(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rules = tmp_path / "minigrid.pl"
    rules.write_bytes((ENVIRONMENTS / "minigrid.pl").read_bytes())
    assert run(["rules", "check", str(rules)]) == 0
    assert "no table of facts" in capsys.readouterr().out
    assert run(["rules", "show", str(rules)]) == 2
    assert "expected NAME.test.yaml beside NAME.pl" in capsys.readouterr().err
    table = tmp_path / "minigrid.test.yaml"
    table.write_bytes((ENVIRONMENTS / "minigrid.test.yaml").read_bytes())
    assert run(["rules", "check", str(rules)]) == 0
    out = capsys.readouterr().out
    assert "5 of 5 predicates run in every tier" in out
    assert "one at a time" not in out
    assert "no table of facts" not in out
    with rules.open("a", encoding="utf-8") as file:
        file.write("slip :- thinng(_, _, lava).\n")
    assert run(["rules", "check", str(rules)]) == 1  # findings, although a shield would refuse the program
    assert "thinng/3 is not defined; did you mean thing/3?" in capsys.readouterr().out
    assert run(["rules", "check", str(ENVIRONMENTS / "frozen_lake.pl")]) == 0
    assert "sure_ground/1" in capsys.readouterr().out.partition("interpreter only: ")[2]
    assert run(["rules", "check", str(ENVIRONMENTS / "crossing.pl")]) == 0
    assert "one at a time, not in arrays\n  offered/1" in capsys.readouterr().out


@pytest.mark.parametrize("tier", ["scalar", "numpy", "numba"])
def test_show_prints_what_rules_for_other_environments_become(
    tier: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["rules", "show", str(ENVIRONMENTS / "minigrid.pl"), "--tier", tier]) == 0
    source = capsys.readouterr().out
    compile(source, "shown", "exec")
    assert "column" in source
    assert ("lava" in source) == (tier == "scalar")  # reasons are looked for in one state at a time


@pytest.mark.parametrize("tier", ["scalar", "numpy", "numba"])
def test_show_prints_code_that_compiles(tier: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["rules", "show", "--tier", tier]) == 0
    source = capsys.readouterr().out
    compile(source, "shown", "exec")
    assert source.startswith("def answer(")
    assert "gap" in source


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["show", "--query", "left_is_safe"], "expected NAME/ARITY"),
        (["show", "--query", "nobody/0"], "does not define it\n"),
        (["show", "nofile.pl"], "cannot read the rule file nofile.pl"),
        (["show", "--tier", "gpu"], "gpu"),
    ],
)
def test_mistakes_on_the_command_line(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["rules", *arguments]) == 2
    assert message in capsys.readouterr().err
