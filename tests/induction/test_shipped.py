"""rules/learnt.pl, an example of a run: its table, its mutants, what is proved of it, and how it drives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drlsl.assurance import DrivingRules, reasons_of, run_cases, score
from drlsl.assurance.mutation import MutantTester
from drlsl.driving.shield import Shield
from drlsl.induction.lane_changes import Labelling, label_changes
from drlsl.induction.lane_changes.examination import examined, stressed
from drlsl.traffic import load_recording
from drlsl.verify import Request, verify
from drlsl.workers import Crew
from tests.assurance.evidence import RULES, table_cases

LEARNT = RULES / "learnt.pl"
MUST = ("nobody_alongside", "nothing_hidden")


def test_the_table_holds_on_every_tier() -> None:
    outcome = run_cases(DrivingRules.of([LEARNT]), table_cases(LEARNT), ["numpy"])
    assert outcome.cases > 40
    assert not outcome.failures


def test_some_mutants_are_noticed_or_explained() -> None:
    tester, reasons = MutantTester(DrivingRules.of([LEARNT]), table_cases(LEARNT)), reasons_of([LEARNT])
    for mutant in tester.mutants[::12]:
        verdict = tester.verdict(mutant)
        assert (verdict.killed_by is None) == (verdict.name in reasons), verdict


@pytest.mark.slow
def test_every_mutant_is_noticed_or_explained() -> None:
    found = score(DrivingRules.of([LEARNT]), table_cases(LEARNT), reasons_of([LEARNT]))
    assert [verdict.name for verdict in found.unexplained] == []


def test_what_must_hold_is_proved_on_some_roads() -> None:
    request = Request(rules=(LEARNT,), only=MUST, attack=0)
    for result in verify(replace(request, cases=request.cases[:2])).results:
        assert (result.status, result.for_any_number) == ("proved", True), result.name


@pytest.mark.slow
def test_what_must_hold_is_proved_on_every_road() -> None:
    for result in examined(LEARNT, (), MUST, crew=Crew(2), attack=20_000):
        assert (result.status, result.for_any_number) == ("proved", True), result.name


@pytest.mark.parametrize("recording", ["highway-train", "freeway", "highway-test"])
def test_nobody_is_at_fault_in_a_few_episodes(recording: str) -> None:
    (found,) = stressed(LEARNT, [recording], 15, 1, tier="numpy")
    assert found.clean
    assert found.counts.lane_changes > 5


def test_it_offers_more_than_the_default_in_recorded_traffic() -> None:
    """On lane changes that were driven to be labelled: the clauses cover what highway.pl offers, and more."""
    changes = label_changes(Labelling(changes=150, egos=32), "learning.pl", load_recording("highway-test"))
    rows, places = np.arange(len(changes)), 1 + changes.side
    learnt, default = (
        Shield.from_files([rules], tier="numpy").decide_batch(changes.scenes).action_mask[rows, places]
        for rules in (LEARNT, RULES / "highway.pl")
    )
    assert learnt.sum() > 2 * default.sum() > 0
    assert not (learnt & changes.unsafe).any()
