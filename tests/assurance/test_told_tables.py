"""Tables of facts: how they are read and asked on every tier, and what bad ones are told."""

from __future__ import annotations

import json
import random
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from drlsl.assurance import load_tables, measure, run_cases, score
from drlsl.assurance.reason_patterns import ReasonPattern, all_explained
from drlsl.assurance.told_facts import ToldFacts, ToldState, facts_row
from drlsl.cli import run
from drlsl.errors import UserError
from drlsl.logic import Compound, Engine
from drlsl.shield import ActionRules
from drlsl.workers import Crew

RULES = """
:- dynamic taxi/2, waiting/2, aboard/0, fare/1, toll/1.
toll(2.0).
action(south).  action(pickup).  action(dropoff).
offered(Action) :- action(Action), \\+ objection(Action, _).
objection(pickup, nobody_waits_here) :- taxi(Row, Column), \\+ waiting(Row, Column).
objection(dropoff, nobody_aboard(Row)) :- \\+ aboard, taxi(Row, _).
objection(Action, too_dear(Action, Fare)) :- action(Action), fare(Fare), toll(Toll), Fare + Toll > 10.0.
"""

TABLE = """
shield: {actions: [south, pickup, dropoff], fallback: south}
columns: {taxi: {row: 1, column: 2}}
facts: {taxi: {}}
states:
  - state: in the middle
    actions: [south]
    objections: {pickup: [nobody_waits_here], dropoff: [nobody_aboard 1], south: []}
    rows:
      - {goals: {"taxi(R, C)": {R: 1, C: 2}}}
      - {row: somebody waits, facts: {waiting: [1, 2]}, actions: [south, pickup], objections: {pickup: []}}
      - row: elsewhere
        facts: {waiting: {a: [0, 2], b: [1, 3]}, taxi: {row: 3}}
        objections: {dropoff: [nobody_aboard(3)]}
      - {row: aboard, facts: {aboard: true}, actions: [south, dropoff], objections: {dropoff: []}}
  - state: too dear
    facts: {fare: [[8.5], [9]]}
    fails: the rules offer no action
    objections:
      south: ["too_dear(south, _)"]
      pickup: ["too_dear(pickup, 8.5)", "too_dear(_, 9)", nobody_waits_here]
    rows:
      - {}
      - row: the toll is told
        facts: {fare: [8.5], toll: [1.6]}
        objections: {south: [too_dear south], pickup: [too_dear pickup, nobody_waits_here]}
"""


def written(folder: Path, table: str = TABLE, rules: str = RULES) -> tuple[list[Path], list[Path]]:
    (folder / "taxi.pl").write_text(rules)
    (folder / "taxi.test.yaml").write_text(table)
    return [folder / "taxi.pl"], [folder / "taxi.test.yaml"]


def test_rows_are_told_and_asked_on_every_tier(tmp_path: Path) -> None:
    rules, cases = load_tables(*written(tmp_path))
    assert [case.name for case in cases] == [
        "in the middle",
        "in the middle / somebody waits",
        "in the middle / elsewhere",
        "in the middle / aboard",
        "too dear",
        "too dear / the toll is told",
    ]
    outcome = run_cases(rules, cases, ["numpy"])
    assert (outcome.failures, outcome.notes) == ([], [])
    checks = sum(len(case.checks) for case in cases)
    assert outcome.answers == {"interpreter": len(cases) + checks, "scalar": checks, "numpy": len(cases)}
    elsewhere = cases[2].state
    assert elsewhere["taxi", 2] == [(3, 2)]
    assert elsewhere["waiting", 2] == [(0, 2), (1, 3)]
    assert [case.state["aboard", 0] for case in cases[2:4]] == [[], [()]]
    assert [case.state["toll", 1] for case in cases] == [[(2.0,)]] * 5 + [[(1.6,)]], "the file's, if not told"


def test_wrong_answers_are_told_with_line_expectation_and_answer(tmp_path: Path) -> None:
    wrong = TABLE.replace("actions: [south, pickup], obj", "actions: [pickup], obj")
    wrong = wrong.replace("[nobody_aboard 1]", "[nobody_aboard 2]")
    wrong = wrong.replace("no action\n", "no way\n").replace("(pickup, 8.5)", "(pickup, 8.6)")
    outcome = run_cases(*load_tables(*written(tmp_path, wrong)))
    told = {(one.place.rpartition(":")[2], one.what): one for one in outcome.failures}
    actions = told["11", "actions"]
    assert actions.problem == "expected pickup, got south, pickup"
    assert actions.tiers == ("interpreter", "scalar", "numpy")
    aboard = told["10", "objections dropoff"]
    assert aboard.problem == "expected nobody_aboard 2, got nobody_aboard 1"
    assert aboard.tiers == ("interpreter", "scalar")
    decision = "expected the failure 'the rules offer no way', got a failure: the rules offer no action"
    assert told["23", "decision"].problem == decision
    assert told["23", "objections pickup"].problem == (
        "expected too_dear(pickup, 8.6), too_dear(_, 9), nobody_waits_here, "
        "got nobody_waits_here, too_dear(pickup, 8.5), too_dear(pickup, 9)"
    )


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("shield: {actions: [south, pickup, dropoff], fallback: south}\n", "", ":1: shield is missing"),
        ("fallback: south", "falback: south", ":2: shield.f"),
        ("fallback: south}", "fallback: north}", "shield: fallback: north is not among"),
        ("fallback: south}", "fallback: south, ask: offered(north)}", "shield: ask is 'offered"),
        ("[south, pickup, dropoff], f", "[south, dropoff], f", ":8: objections: there is no action pickup; "),
        (
            "actions: [south]\n",
            "actions: [suoth]\n",
            ":7: actions: there is no action suoth; the shield has s",
        ),
        ("{pickup: [nobody", "{pikup: [nobody", ":8: objections: there is no action pikup; the shield has s"),
        ("waiting: [1, 2]", "wating: [1, 2]", r":11: facts: there are no facts wating/1; the rules declare "),
        ("waiting: [1, 2]", "waiting/3: [1, 2]", r":11: facts: .* waiting/3; declared is waiting/2"),
        ("waiting: [1, 2]", "waiting: [1, 2, 3]", r":11: facts: a row of waiting/2 has 3 values"),
        ("waiting: [1, 2]", "waiting: [[1, 2], 5]", r":11: facts: a row of waiting/2 is 5; expected 2 "),
        ("waiting: [1, 2]", "waiting: [1, north]", r": facts: value 2 of waiting/2 is .*; in other rows "),
        ("waiting: [1, 2]", "waiting: [1, no]", r":11: facts: value 2 of waiting/2 is False; .* in quotes"),
        ("waiting: [1, 2]", "waiting: [1, .nan]", r":11: facts: value 2 of waiting/2 is nan; expected a f"),
        ("waiting: [1, 2]", "waiting: {row: 1}", r":11: facts: the columns of waiting/2 have no names"),
        ("waiting: [1, 2]", "waiting: 1", r":11: facts: waiting is 1; expected a list of rows"),
        ("aboard: true", "aboard: [1]", r":15: facts: aboard has no values; expected true if it holds"),
        ("taxi: {row: 3}", "taxi: {rwo: 3}", r":13: facts: rwo is no column of taxi/2; expected row, col"),
        ("{row: 1, column: 2}", "{row: 1, column: null}", r":4: facts: a row of taxi/2 has no column, which"),
        ("{row: 1, column: 2}", "{row: 1}", r":3: columns: there are no facts taxi/1; declared is taxi/2"),
        (
            "{row: 1, column: 2}",
            "{row: 1, column: yes}",
            r":3: columns\.taxi\.column: input should be",
        ),
        ("[nobody_waits_here]", "['a(']", r":8: objections: 'a\(' is no reason"),
        ("states:", "scenes:", ":5: scenes is not a key of a table; expected states, shield, columns, facts"),
        ("      - {}\n", "      - {fact: {}}\n", ":23: fact is not a key of a table; docs/testing-rules.md"),
    ],
)
def test_bad_tables_are_refused_with_file_line_and_reason(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    assert old in TABLE
    with pytest.raises(UserError, match=message) as error:
        load_tables(*written(tmp_path, TABLE.replace(old, new)))
    assert str(error.value).startswith(str(tmp_path))
    assert "\n" not in str(error.value)


def test_rows_expect_something(tmp_path: Path) -> None:
    head = TABLE.partition("facts:")[0]
    with pytest.raises(UserError, match=r":5: a: expects nothing; give actions, objections, goals or fails"):
        load_tables(*written(tmp_path, f"{head}states:\n  - {{state: a, facts: {{fare: [1.0]}}}}\n"))


def test_tables_of_one_program_are_of_one_kind_and_ask_one_shield(tmp_path: Path) -> None:
    rules, tables = written(tmp_path)
    other = tmp_path / "taxi.more.test.yaml"
    other.write_text("scenes:\n  - {scene: a, actions: [keep]}\n")
    with pytest.raises(
        UserError, match=r"taxi\.test\.yaml is a table of facts and .*more\.test\.yaml one of"
    ):
        load_tables(rules, [*tables, other])
    other.write_text(TABLE.replace("fallback: south", "fallback: pickup"))
    with pytest.raises(
        UserError, match=r"more\.test\.yaml:2: shield: it is another one than in .*taxi\.test"
    ):
        load_tables(rules, [*tables, other])
    other.write_text(TABLE.replace("column: 2}}", "column: 1}}"))
    with pytest.raises(UserError, match="taxi: another table names its columns otherwise"):
        load_tables(rules, [*tables, other])
    other.write_text(TABLE)
    assert len(load_tables(rules, [*tables, other])[1]) == 12


def test_rules_without_facts_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="the rules declare no facts"):
        load_tables(*written(tmp_path, rules="offered(south).\n"))


def test_facts_of_the_program_that_no_table_can_tell(tmp_path: Path) -> None:
    rules = RULES.replace("toll(2.0).", "toll(gate(2.0)).")
    with pytest.raises(
        UserError, match=r"own facts: value 1 of toll/1 is .*; tell toll in none or all states"
    ):
        load_tables(*written(tmp_path, rules=rules))
    _, cases = load_tables(*written(tmp_path, TABLE.rpartition("      - row: the toll is told")[0], rules))
    assert all(("toll", 1) not in case.state for case in cases)


def test_coverage_and_mutants(tmp_path: Path) -> None:
    without_toll = TABLE.rpartition("      - row: the toll is told")[0]
    rules, cases = load_tables(*written(tmp_path, without_toll))
    reached, _ = measure(rules, cases)
    assert [str(point) for point in reached.missed] == []
    found = score(rules, cases)
    survivors = [verdict.name for verdict in found.survivors]
    limit = "objection/2 clause 3: Fare + Toll > 10.0 ==> Fare + Toll >= 10.0"
    assert limit in survivors, "nothing is at the limit"
    assert not any(name.startswith(("offered/1", "objection/2 clause 1")) for name in survivors)
    assert found == score(rules, cases, crew=Crew(2))


def test_a_state_that_would_notice_a_survivor(tmp_path: Path) -> None:
    """It is searched among states like those of the table, and printed as a row that can be put into it."""
    head = TABLE.partition("states:")[0]
    row = "states:\n  - {state: s, facts: {waiting: [0, 2], fare: [1.0]}, actions: [south]}\n"
    rules, cases = load_tables(*written(tmp_path, head + row))
    assert run_cases(rules, cases).failures == []
    found = [one for one in score(rules, cases).witnesses.values() if one is not None]
    witness = next(one for one in found if (one.goal, one.mutant) == ("offered(Action)", "south"))
    again = f"states:\n  - {{state: s, actions: [south], rows: [{witness.row}]}}\n"
    rules, cases = load_tables(*written(tmp_path, head + again))
    (failure,) = {one.problem for one in run_cases(rules, cases).failures if one.what == "actions"}
    offered = witness.rules.replace(" |", ",").replace("no solution", "none")
    assert failure == f"expected south, got {offered}"


CARS = ":- dynamic car/3, ego/1, lit/0."


def test_states_like_others_are_of_the_same_form() -> None:
    engine = Engine()
    engine.consult_text(CARS)
    told = ToldFacts(engine)
    facts = told.facts({"ego": [3], "car": [["a", 1, 2.5], ["b", 2, 0.0]], "lit": True})
    other = told.facts({"ego": [5]})
    schema = told.complete([facts, other])
    chance, counts = random.Random(1), set()
    for _ in range(200):
        drawn = ToldState(facts, told).changed(chance).state()
        counts.add(len(drawn["car", 3]))
        assert len(drawn["ego", 1]) == 1, "as in every state"
        for key, rows in drawn.items():
            assert schema.relations[key].conform(rows) == rows
    assert counts == {0, 1, 2}


names = st.from_regex(r"[a-z][a-z0-9_]{0,5}", fullmatch=True)
cars = st.lists(st.tuples(names, st.integers(-9, 9), st.floats(-1e6, 1e6)), max_size=4)


@given(cars=cars, ego=st.lists(st.tuples(st.integers()), max_size=2), lit=st.booleans())
def test_facts_are_read_as_they_were_written(cars: list[Any], ego: list[Any], lit: bool) -> None:
    engine = Engine()
    engine.consult_text(CARS)
    facts = {("car", 3): cars, ("ego", 1): ego, ("lit", 0): [()] if lit else []}
    text = yaml.safe_dump({"facts": facts_row(facts)}, default_flow_style=True)
    assert ToldFacts(engine).facts(yaml.safe_load(text)["facts"]) == facts


A, B = Compound("near", ("a", 2.0)), Compound("near", ("b", 3.0))


@pytest.mark.parametrize(
    ("wanted", "reasons", "agree"),
    [
        ((), [], True),
        ((), ["far"], False),
        (("far",), ["far"], True),
        (("far",), ["far", "far"], False),
        (("near a", "near b"), [B, A], True),
        (("near a",), [A, B], False),
        (("near a", "near a"), [A, A], True),
        (("near(a, 2.0)", "near(b, 3)"), [B, A], True),
        (("near(a, 2.0009)",), [A], True),
        (("near(a, 2.002)",), [A], False),
        (("near(a, _)", "near(b, 2.0)"), [A, B], False),
        (("near(_, _)",), [A, B], True),
        (("near(_, _)",), ["far"], False),
        (("near(_, _)", "far"), ["far"], False),
        (("near(_, _)", "near(a, 2.0)"), [A, B], True),
        (("near(_, _)", "near(a, 2.0)"), [A], False),
        (("near(_)",), [A], False),
        (("near(1)",), [Compound("near", (1,))], True),
        (("near(1.0)",), [Compound("near", (1,))], False),
    ],
)
def test_reasons(wanted: tuple[str, ...], reasons: list[Any], agree: bool) -> None:
    patterns = [ReasonPattern(text, 0.001) for text in wanted]
    assert all_explained(patterns, reasons) == agree


def test_a_tier_of_the_same_program_counts_for_itself() -> None:
    rules = ActionRules(RULES, ["south", "pickup", "dropoff"], fallback="south", tier="interpreter")
    facts: dict[Any, Any] = {
        ("taxi", 2): [(1, 2)],
        ("waiting", 2): [(1, 2)],
        ("aboard", 0): [()],
        ("fare", 1): [(1.0,)],
        ("toll", 1): [(1.0,)],
    }
    assert rules.decide(facts) == ("south", "pickup", "dropoff")
    other = rules.with_tier("numpy")
    assert other.tier_for_many == "numpy"
    failures = other.offers([facts, {**facts, ("fare", 1): [(10.0,)]}]).failures
    assert failures == {1: "the rules offer no action"}
    assert (other.counts.decisions, other.counts.fail_safes, rules.counts.decisions) == (2, 1, 0)
    assert rules.tier == "interpreter"
    with pytest.raises(UserError, match="no such tier"):
        rules.with_tier("fortran")


def test_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    written(tmp_path)
    monkeypatch.chdir(tmp_path)
    assert run(["rules", "test", "taxi.pl", "--coverage"]) == 0
    printed = capsys.readouterr()
    assert printed.out.startswith("6 states, 0 wrong; answers checked: interpreter ")
    assert printed.err == "", "a row that expects a failure warns of none"
    assert run(["rules", "test", "taxi.pl", "--mutate", "--json"]) == 1
    data = json.loads(capsys.readouterr().out)
    assert data["states"] == 6
    assert 0 < data["mutation"]["noticed"] < data["mutation"]["mutants"]
    home = RULES.replace("offered(Action) :-", "offered(home) :- aboard.\noffered(Action) :-")
    (tmp_path / "taxi.pl").write_text(home)
    assert run(["rules", "test", "taxi.pl"]) == 2
    assert "the rules name the action home, which is not among south, pickup" in capsys.readouterr().err
