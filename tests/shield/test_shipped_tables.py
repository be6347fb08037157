"""The tables of the rules that ship for other environments: they pass on every tier, reach and notice all."""

from __future__ import annotations

from pathlib import Path

import pytest

from drlsl.assurance import load_tables, measure, reasons_of, run_cases, score, tables_of

RULES = Path(__file__).parents[2] / "rules" / "envs"
PROGRAMS = ["crossing.pl", "frozen_lake.pl", "minigrid.pl", "straight_road.pl"]

TIERS = {
    "crossing.pl": ("interpreter", "scalar"),  # its actions are those of the facts, which arrays cannot offer
    "frozen_lake.pl": ("interpreter",),  # it is tabled
    "minigrid.pl": ("interpreter", "scalar", "numpy"),
    "straight_road.pl": ("interpreter", "scalar", "numpy"),
}
"""The tiers that can run each."""


@pytest.mark.parametrize(
    "program", [pytest.param(one, marks=pytest.mark.slow if one == "crossing.pl" else ()) for one in PROGRAMS]
)
def test_they_pass_on_every_tier_and_reach_every_clause_and_branch(program: str) -> None:
    files = [RULES / program]
    rules, cases = load_tables(files, tables_of(files))
    outcome = run_cases(rules, cases, ["numpy"])
    assert outcome.failures == []
    assert tuple(outcome.answers) == TIERS[program]
    assert bool(outcome.notes) == (len(TIERS[program]) < 3)
    reached, _ = measure(rules, cases)
    assert [str(point) for point in reached.missed] == []
    assert {Path(point.file) for point in reached.reached} == {RULES / program}


@pytest.mark.parametrize(
    "program", [pytest.param(one, marks=() if one == "minigrid.pl" else pytest.mark.slow) for one in PROGRAMS]
)
def test_they_notice_every_mutant_that_can_be_noticed(program: str) -> None:
    files = [RULES / program]
    found = score(*load_tables(files, tables_of(files)), reasons_of(files))
    assert [verdict.name for verdict in found.unexplained] == []
    assert found.share > 0.9
