"""The properties of rules/envs/crossing.pl are proved over all facts, and break when the rules do."""

from __future__ import annotations

from pathlib import Path

import pytest

from drlsl.lowering import Schema
from drlsl.shield import rules_folder
from drlsl.shield.environments.crossing import SCHEMA

pytest.importorskip("z3", reason="the extra 'verify' is not installed")

from drlsl.verify import Request
from drlsl.verify.properties import load
from drlsl.verify.told import FactsResult, verify_facts

PROPERTIES = Path("envs/crossing.properties.pl")
RULES = Path("envs/crossing.pl")
MOTION = ("ego_between", "decisions_follow", "others_between")
CONFLICTS = ("no_conflict", "gives_way")


def result_of(name: str, rules: Path = RULES, seconds: float = 120.0) -> FactsResult:
    (result,) = verify_facts(
        Request(rules=(rules,), properties=(PROPERTIES,), only=(name,), time_limit=seconds, attack=4096)
    )
    return result


def test_every_property_is_tested() -> None:
    book = load([RULES], [PROPERTIES])
    assert {one.name for one in book.properties} == {*MOTION, *CONFLICTS}


def test_the_properties_declare_the_facts_of_the_environment() -> None:
    book = load([RULES], [PROPERTIES])
    assert book.told is not None
    declared: Schema = book.told.schema
    kinds = {key: one.columns for key, one in declared.relations.items() if key[0] not in book.unknowns}
    assert kinds == {key: one.columns for key, one in SCHEMA.relations.items()}
    single = {key for key, one in declared.relations.items() if one.single and key[0] not in book.unknowns}
    assert single == {key for key, one in SCHEMA.relations.items() if one.single}


@pytest.mark.parametrize("name", [*MOTION, *CONFLICTS])
def test_a_property_is_proved_for_any_number_of_vehicles(name: str) -> None:
    result = result_of(name)
    assert result.status == "proved", result.reason
    assert result.enough
    assert result.floats is not None
    assert result.floats.margin == 1e-9


@pytest.mark.parametrize(
    ("name", "was", "wrong"),
    [
        ("ego_between", "left(2, 0.434598209)", "left(2, 0.436598209)"),
        ("ego_between", "lag(0.6)", "lag(0.61)"),
        ("decisions_follow", "S is S0 + S1.\n\n% way", "S is S1.\n\n% way"),
        ("decisions_follow", "change(stop, 2, -1.0)", "change(stop, 2, -2.0)"),
        ("others_between", "slows_down(3.0)", "slows_down(2.9)"),
        ("others_between", "A * T * T / 2, Top", "A * T / 2, Top"),
        ("no_conflict", "Least =< To2", "Least =< From2"),
        ("no_conflict", "S1 >= From1", "S1 >= To1"),
        ("no_conflict", "between(1, N, Step)", "between(2, N, Step)"),
        ("no_conflict", "Place \\== behind,\n    lead", "Place \\== beside,\n    lead"),
        ("gives_way", "gap_time(0.5)", "gap_time(0.25)"),
        ("gives_way", "Priority > Priority0", "Priority < Priority0"),
    ],
)
def test_a_slip_in_the_rules_is_found(name: str, was: str, wrong: str, tmp_path: Path) -> None:
    text = (rules_folder() / RULES).read_text(encoding="utf-8")
    assert text.count(was) == 1, was
    slipped = tmp_path / "slipped.pl"
    slipped.write_text(text.replace(was, wrong), encoding="utf-8")
    result = result_of(name, slipped)
    assert result.status == "refuted", result.reason
    assert result.facts is not None
    assert not result.prover_error
