"""un_r157.pl and follower_brakes.pl: highway.pl with other distances, wherever rules are asked."""

from __future__ import annotations

from dataclasses import dataclass

import pytest
from hypothesis import HealthCheck, given, settings

from drlsl.assurance import DrivingRules, measure, reasons_of, run_cases, score
from drlsl.cli import run
from drlsl.driving.scene import Scene, SceneBatch, Vehicle
from drlsl.driving.shield import Shield
from tests.assurance.evidence import RULES, table_cases
from tests.properties.oracle import Oracle
from tests.scenes import scenes

HIGHWAY = Shield.default()
REPLACED = {"un_r157.pl": "critical_distance/3", "follower_brakes.pl": "required_gap_behind/3"}
SHIELDS = {name: Shield.from_files([RULES / name], tier="numpy") for name in REPLACED}


@pytest.mark.parametrize(
    ("name", "clauses", "mutants"), [("un_r157.pl", 2, 30), ("follower_brakes.pl", 4, 80)]
)
def test_the_table_passes_and_notices_every_mutant(name: str, clauses: int, mutants: int) -> None:
    path = RULES / name
    cases = table_cases(path)
    rules = DrivingRules.of([path])
    outcome = run_cases(rules, cases)
    assert (outcome.failures, outcome.notes) == ([], [])
    coverage = measure(rules, cases)[0]
    assert (sum(point.is_clause for point in coverage.reached), coverage.missed) == (clauses, ())
    found = score(rules, cases, reasons_of([path]))
    assert len(found.verdicts) >= mutants
    assert [verdict.name for verdict in found.unexplained] == []


@pytest.mark.parametrize("name", REPLACED)
def test_nothing_looks_wrong(capsys: pytest.CaptureFixture[str], name: str) -> None:
    assert run(["rules", "check", str(RULES / name)]) == 0
    assert REPLACED[name] in capsys.readouterr().out
    assert run(["rules", "check", name]) == 0


@pytest.mark.parametrize("name", REPLACED)
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(scene=scenes())
def test_arrays_decide_as_the_interpreter_does(name: str, scene: Scene) -> None:
    decision = SHIELDS[name].decide(scene)
    batch = SHIELDS[name].decide_batch(SceneBatch.of([scene]))
    assert batch.failures == {}
    assert tuple(batch.action_mask[0].tolist()) == tuple(map(bool, decision.action_mask))
    assert batch.target_speed[0] == decision.target_speed


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(scene=scenes())
def test_un_r157_is_never_more_careful_than_highway(scene: Scene) -> None:
    """RSS lets the vehicle in front brake, UN R157 does not: its distance is never the longer one."""
    assert set(HIGHWAY.decide(scene).safe_actions) <= set(SHIELDS["un_r157.pl"].decide(scene).safe_actions)


@dataclass(frozen=True)
class GentleFollower(Oracle):
    """The rules of highway.pl written by hand, with the room behind that a gently braking follower needs."""

    def needed_gap(self, car: Vehicle) -> float:
        if self.offset(car) >= 0:
            return super().needed_gap(car)
        own, rear = self.speed(self.ego), self.speed(car)
        gained = 0.4 * (rear - own) + (rear - own) ** 2 / 6 if rear > own else 0.0
        return gained + max(2.0, min(own, rear))


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(scene=scenes())
def test_a_gentle_follower_has_the_room_that_it_needs(scene: Scene) -> None:
    shield, oracle = SHIELDS["follower_brakes.pl"], GentleFollower(scene)
    decision = shield.decide(scene)
    assert [action.atom for action in decision.safe_actions] == oracle.actions()
    assert decision.target_speed == HIGHWAY.decide(scene).target_speed
    assert shield.entry_is_safe(scene) == oracle.is_safe("entry")


def test_what_the_three_ask_for() -> None:
    ahead = [shield.engine.once("required_gap(30.0, 28.0, C)") for shield in (HIGHWAY, *SHIELDS.values())]
    behind = [
        shield.engine.once("required_gap_behind(30.0, 28.0, C)") for shield in (HIGHWAY, *SHIELDS.values())
    ]
    assert [found["C"] for found in ahead if found] == pytest.approx([44.025625, 91 / 30, 44.025625])
    assert [found["C"] for found in behind if found] == pytest.approx([44.025625, 91 / 30, 29.466667])
