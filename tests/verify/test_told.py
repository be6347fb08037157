"""Properties of rules whose facts the file of properties declares."""

from __future__ import annotations

from pathlib import Path

import pytest

from drlsl.errors import UserError

pytest.importorskip("z3", reason="the extra 'verify' is not installed")

import drlsl.verify.told.facts_proof as facts_proof
from drlsl.verify import Request
from drlsl.verify.told import FactsResult, verify_facts

RULES = """
:- dynamic car/3, gap/2, limit/1.
offered(go) :- \\+ too_near.
too_near :- car(Id, V, _), gap(Id, D), D < V * 2.0.
"""
FACTS = """
facts(car(key, number(0, 40), one_of([left, right])), any).
facts(gap(key(car), number(0, 300)), any).
facts(limit(number(0, 40)), one).
"""


def proved(tmp_path: Path, properties: str, rules: str = RULES, facts: str = FACTS) -> FactsResult:
    (tmp_path / "rules.pl").write_text(rules, encoding="utf-8")
    (tmp_path / "properties.pl").write_text(facts + properties, encoding="utf-8")
    request = Request(
        rules=(tmp_path / "rules.pl",), properties=(tmp_path / "properties.pl",), attack=4096, time_limit=20.0
    )
    (result,) = verify_facts(request)
    return result


def test_a_property_of_any_number_of_rows_is_proved(tmp_path: Path) -> None:
    text = "property(room, 'x'). violates(room) :- offered(go), car(I, V, left), gap(I, D), D < V."
    result = proved(tmp_path, text)
    assert (result.status, result.enough) == ("proved", True)
    assert result.rows == {"car": 1, "gap": 1}
    assert result.scenes >= 4096


def test_facts_that_break_a_property_are_shown(tmp_path: Path) -> None:
    text = "property(room, 'x'). violates(room) :- offered(go), car(I, V, left), gap(I, D), D < V * 2.5."
    result = proved(tmp_path, text)
    assert result.status == "refuted"
    assert result.facts is not None
    ((key, speed, side),) = result.facts["car", 3]
    gaps = [gap for of, gap in result.facts["gap", 2] if of == key]
    assert side == "left"
    assert any(2.0 * speed <= gap < 2.5 * speed for gap in gaps)


CELLS = """
:- dynamic agent/2, thing/2.
offered(right) :- agent(X, Y), X1 is X + 1, \\+ thing(X1, Y).
"""
GRID = "facts(agent(integer(0, 7), integer(0, 7)), one). facts(thing(integer(0, 7), integer(0, 7)), any). "


def test_integers_may_be_computed_with(tmp_path: Path) -> None:
    free = "violates(free) :- offered(right), agent(X, Y), thing(X1, Y), X1 - 1 =:= X."
    one = proved(tmp_path, f"property(free, 'x'). {free}", CELLS, GRID)
    assert (one.status, one.enough) == ("proved", True)
    other = proved(tmp_path, f"property(free, 'x'). {free.replace('- 1', '- 2')}", CELLS, GRID)
    assert other.status == "refuted"
    assert other.facts is not None
    ((x, y),) = other.facts["agent", 2]
    assert (x + 2, y) in other.facts["thing", 2]


def test_an_error_of_the_rules_breaks_a_property(tmp_path: Path) -> None:
    text = "property(room, 'x'). violates(room) :- offered(go), limit(V), V > 50.0."
    result = proved(tmp_path, text, RULES.replace("V * 2.0", "V / (V - V)"))
    assert (result.status, result.facts is not None) == ("refuted", True)
    assert "evaluation error" in (result.error or "")


BROKEN = "property(room, 'x'). violates(room) :- offered(go), car(I, V, left), gap(I, D), D < V * 2.5."


def test_the_attack_finds_what_a_prover_overlooks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(facts_proof._Question, "_is_impossible", lambda *_: True)
    result = proved(tmp_path, BROKEN)
    assert (result.status, result.prover_error, result.facts is not None) == ("refuted", True, True)
    text = "property(room, 'x'). violates(room) :- offered(go), limit(V), V > 50.0."
    result = proved(tmp_path, text, RULES.replace("V * 2.0", "V / (V - V)"))
    assert (result.status, result.prover_error) == ("refuted", True)
    assert "evaluation error" in (result.error or "")


def test_tiers_that_disagree_are_no_proof(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(facts_proof._Question, "_is_impossible", lambda *_: True)
    monkeypatch.setattr(facts_proof._Replay, "breaks", lambda *_: None)
    result = proved(tmp_path, BROKEN)
    assert (result.status, result.prover_error) == ("unknown", False)
    assert "do not agree" in result.reason


@pytest.mark.parametrize(
    ("declared", "said"),
    [
        ("facts(a(number(2, 1)), one).", r"a column is number\(2,1\); expected number\(Low, High\)"),
        ("facts(a(key, key), any).", "expected one key at most"),
        ("facts(a(key(b)), any).", r"key\(b\) names no relation with a key"),
        ("facts(a(key), some).", r"expected facts\(Name\(Column, ...\), one\) or any"),
        ("facts(limit(number(0, 1)), one).", "declared more than once"),
    ],
)
def test_a_wrong_declaration_is_refused(declared: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=said):
        proved(tmp_path, f"{declared}\nproperty(p, 'x'). violates(p) :- offered(go), \\+ offered(_).")


def test_a_key_is_no_number(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="a key of car is used as a number"):
        proved(tmp_path, "property(p, 'x'). violates(p) :- offered(go), car(I, _, _), I > 1.")


def test_a_property_that_no_facts_can_break_is_told(tmp_path: Path) -> None:
    text = "property(room, 'x'). violates(room) :- offered(fastr), limit(V), V > 30.0."
    result = proved(tmp_path, text)
    assert "is a name misspelt" in result.reason


def test_facts_of_another_arity_than_in_the_rules_are_refused(tmp_path: Path) -> None:
    facts = FACTS.replace("one_of([left, right])", "one_of([left, right]), number(0, 1)")
    with pytest.raises(UserError, match=r"facts\(car/4, ...\) is declared; the rules have facts of car/3"):
        proved(tmp_path, "property(room, 'x'). violates(room) :- offered(go).", facts=facts)


def test_facts_that_are_not_declared_are_named(tmp_path: Path) -> None:
    result = proved(tmp_path, "property(room, 'x'). violates(room) :- offered(go).", facts=GRID)
    assert result.reason.endswith("not declared by facts/2: car/3, gap/2, limit/1")
