"""The tables of the rules that ship for other environments: they pass on every tier, reach and notice all."""

from __future__ import annotations

from pathlib import Path

import pytest

from drlsl.assurance import load_tables, measure, reasons_of, run_cases, score, tables_of

RULES = Path(__file__).parents[2] / "rules" / "envs"
PROGRAMS = ["minigrid.pl"]
ONLY_INTERPRETED: set[str] = set()
QUICK = {"minigrid.pl"}
"""Those of whose mutants all are tried in every run of the tests."""


@pytest.mark.parametrize("program", PROGRAMS)
def test_they_pass_on_every_tier_and_reach_every_clause_and_branch(program: str) -> None:
    files = [RULES / program]
    rules, cases = load_tables(files, tables_of(files))
    outcome = run_cases(rules, cases, ["numpy"])
    assert outcome.failures == []
    tiers = {"interpreter"} if program in ONLY_INTERPRETED else {"interpreter", "scalar", "numpy"}
    assert outcome.answers.keys() == tiers
    assert bool(outcome.notes) == (program in ONLY_INTERPRETED)
    reached, _ = measure(rules, cases)
    assert [str(point) for point in reached.missed] == []
    assert {Path(point.file) for point in reached.reached} == {RULES / program}


@pytest.mark.parametrize(
    "program", [pytest.param(one, marks=() if one in QUICK else pytest.mark.slow) for one in PROGRAMS]
)
def test_they_notice_every_mutant_that_can_be_noticed(program: str) -> None:
    files = [RULES / program]
    found = score(*load_tables(files, tables_of(files)), reasons_of(files))
    assert [verdict.name for verdict in found.unexplained] == []
    assert found.share > 0.9
