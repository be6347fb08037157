"""un_r157.pl: highway.pl with the distance of UN R157, wherever rules are asked."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings

from drlsl.assurance import measure, run_cases, score
from drlsl.cli import run
from drlsl.driving.scene import Scene, SceneBatch
from drlsl.driving.shield import Shield
from tests.assurance.evidence import RULES, table_cases
from tests.scenes import scenes

R157 = RULES / "un_r157.pl"
SHIELD = Shield.from_files([R157], tier="numpy")
HIGHWAY = Shield.default()


def test_the_table_passes_and_notices_every_mutant() -> None:
    cases = table_cases(R157)
    outcome = run_cases(Shield.from_files([R157]), cases)
    assert (outcome.failures, outcome.notes) == ([], [])
    assert measure(Shield.from_files([R157]), cases, [R157])[0].missed == ()
    found = score([R157], cases)
    assert len(found.verdicts) >= 30
    assert list(found.survivors) == []


def test_nothing_looks_wrong(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["rules", "check", str(R157)]) == 0
    assert "critical_distance/3" in capsys.readouterr().out
    assert run(["rules", "check", "un_r157.pl"]) == 0


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(scene=scenes())
def test_arrays_decide_as_the_interpreter_does(scene: Scene) -> None:
    decision = SHIELD.decide(scene)
    batch = SHIELD.decide_batch(SceneBatch.of([scene]))
    assert batch.failures == {}
    assert tuple(batch.action_mask[0].tolist()) == tuple(map(bool, decision.action_mask))
    assert batch.target_speed[0] == decision.target_speed


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(scene=scenes())
def test_it_is_never_more_careful_than_highway(scene: Scene) -> None:
    """RSS lets the vehicle in front brake, UN R157 does not: its distance is never the longer one."""
    assert set(HIGHWAY.decide(scene).safe_actions) <= set(SHIELD.decide(scene).safe_actions)


def test_the_two_ask_for_unlike_gaps() -> None:
    goal = "critical_distance(30.0, 28.0, C)"
    distances = [shield.engine.once(goal) for shield in (HIGHWAY, SHIELD)]
    assert [found["C"] for found in distances if found is not None] == pytest.approx([42.025625, 31 / 30])
