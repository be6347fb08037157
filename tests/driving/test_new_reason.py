"""A reason against an action is one clause of objection/2: mask, words, proof and picture follow from it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings

from drlsl.cli import run
from drlsl.driving.explain import objections
from drlsl.driving.scene import Action, Scene, SceneBatch, load_scene
from drlsl.driving.shield import Shield
from tests.installed import TIERS
from tests.scenes import scenes_with_one_coming_fast

CLAUSE = (
    "objection(Action, closes_in_fast(Car, V)) :-\n"
    "    lane_change(Action, Side), target_vehicle(Car), place(behind, Car, _), in_way(Car, Side),\n"
    "    closing_speed(Car, V), V > 8.0.\n"
)
EXAMPLE = Path(__file__).parents[2] / "examples" / "scene.json"


@pytest.fixture(scope="module")
def rules(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rules") / "courteous.pl"
    path.write_text(f":- ensure_loaded('highway.pl').\n\n{CLAUSE}", encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def shields(rules: Path) -> dict[str, Shield]:
    return {tier: Shield.from_files([rules], tier=tier) for tier in TIERS[:3]}


DEFAULT = Shield.default()

SIDES = ("left", "right")


def fast_scene(speed: float) -> Scene:
    """The example with the sports car so far behind that only its speed can matter."""
    scene = load_scene(EXAMPLE)
    cars = (car._replace(x=83.0, vx=speed) if car.id == "sports_car" else car for car in scene.vehicles)
    return replace(scene, vehicles=tuple(cars))


def test_one_clause_says_what_is_offered_and_why_not(shields: dict[str, Shield]) -> None:
    just, more = fast_scene(37.5), fast_scene(37.6)
    for scene in (just, more):
        assert Action.LEFT_LANE_CHANGE in DEFAULT.decide(scene).safe_actions
    for shield in shields.values():
        assert shield.decide_batch(SceneBatch.of([just, more])).action_mask.tolist() == [
            [True, True, True],
            [True, False, True],
        ]
    shield = shields["interpreter"]
    unsafe = objections(shield, more, shield.decide(more))
    assert [one.words() for one in unsafe[Action.LEFT_LANE_CHANGE]] == ["closes in fast: sports_car, 8.1"]
    proof = shield.engine.explain("safe_actions(left_lane_change)")
    assert not proof.holds
    assert "objection(left_lane_change,closes_in_fast(sports_car,8.1))" in proof.text()


@settings(deadline=None, max_examples=40, suppress_health_check=[HealthCheck.too_slow])
@given(scene=scenes_with_one_coming_fast())
def test_it_takes_away_what_it_objects_to_and_nothing_else(shields: dict[str, Shield], scene: Scene) -> None:
    before = DEFAULT.decide(scene)
    after = shields["interpreter"].decide(scene)
    opposed = {row["A"] for row in shields["interpreter"].engine.query("objection(A, closes_in_fast(_, _))")}
    kept = tuple(action for action in before.safe_actions if action.atom not in opposed)
    # The observation tells which lane changes are offered.
    offered = {
        f"{side}_offered": float(f"{side}_lane_change" in {one.atom for one in kept}) for side in SIDES
    }
    observed = dict(zip(DEFAULT.observation.names, before.observation, strict=True)) | offered
    assert after == replace(before, safe_actions=kept, observation=tuple(observed.values()))
    for shield in shields.values():
        assert shield.decide_batch(SceneBatch.of([scene])).action_mask.tolist() == [
            list(map(bool, after.action_mask))
        ]


def test_commands_follow(rules: Path, tmp_path: Path) -> None:
    assert run(["rules", "check", str(rules)]) == 0
    table = tmp_path / "courteous.test.yaml"
    table.write_text(
        "scenes:\n  - scene: fast behind on the left\n"
        "    vehicles: {a: {lane: left, behind: 90.0, speed: 28.1}}\n"
        "    actions: [keep]\n    objections: {left: [closes_in_fast a]}\n",
        encoding="utf-8",
    )
    assert run(["rules", "test", str(rules), "--tables", str(table)]) == 0
