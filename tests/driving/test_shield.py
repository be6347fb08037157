"""The shield: what it asks of a program, and what happens when a program fails."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from drlsl.driving.explain import busy_sections, objections
from drlsl.driving.scene import EGO, Action, Road, Scene, SceneBatch, Vehicle, road_facts
from drlsl.driving.shield import LIMITS, Decision, RuleFailure, Shield, scene_program
from drlsl.driving.shield.decision import fail_safe_speed
from drlsl.driving.shield.interpreter import Interpreter
from drlsl.errors import UserError
from drlsl.logic import Engine, LimitExceeded, Limits, PrologError, PrologSyntaxError
from tests.installed import TIERS
from tests.scenes import road, scenes

PROGRAMS = ("highway.pl", "overtake_left.pl", "paper.pl")
SCENE = Scene(road(0, 3), Vehicle(EGO, 2, 0.0, 7.25, 30.0, 0.0, 4.6, 1.9), (), 2)

SHIELDS = {
    (program, tier): Shield.from_files([Path(__file__).parents[2] / "rules" / program], tier=tier)
    for program in PROGRAMS
    for tier in TIERS
}

USABLE = {
    "safe_actions": "safe_actions(lane_keeping).",
    "front_is_free": "front_is_free.",
    "longitudinal_velocity": "longitudinal_velocity(20.0).",
    "state": "state([0, 0, 0, 0, 0, 0, 0, 0, 0.5, 1]).",
    "entry_is_safe": "entry_is_safe.",
}


def shield(tier: str = "interpreter", **changes: str) -> Shield:
    """The shield of a program in which some predicates are written otherwise."""
    engine = Engine()
    engine.consult_text("\n".join({**USABLE, **changes}.values()))
    return Shield(engine, tier=tier)


def test_a_small_program_is_enough() -> None:
    decision = shield().decide(SCENE)
    assert decision.safe_actions == (Action.LANE_KEEPING,)
    assert decision.action_mask == (1, 0, 0)
    assert decision.target_speed == 20.0
    assert decision.lane_to_keep == SCENE.target_lane


@pytest.mark.parametrize("name", USABLE)
def test_a_program_that_lacks_a_predicate_is_refused(name: str) -> None:
    with pytest.raises(UserError, match=name):
        shield(**{name: ""})


def test_an_atom_that_names_no_action_is_an_error_and_never_an_action() -> None:
    with pytest.raises(UserError, match="'lane_change', which the agent does not know"):
        shield(safe_actions="safe_actions(lane_change).")
    found_late = "safe_actions(Action) :- Action = lane_change."
    with pytest.raises(UserError, match="'lane_change', which the agent does not know"):
        shield(safe_actions=found_late).decide(SCENE)
    for tier in TIERS:
        with pytest.raises(UserError, match="'lane_change', which the agent does not know"):
            shield(tier, safe_actions=found_late).decide_batch(SceneBatch.of([SCENE]))


@pytest.mark.parametrize("action", ["left_lane_chnage", "left", "7", "side(left)"])
def test_an_objection_to_an_unknown_action_is_refused_before_anything_drives(action: str) -> None:
    """It would take no action away, and no answer would show it."""
    with pytest.raises(UserError, match=r"objection/2: .* which the agent does not know"):
        shield(objection=f"objection({action}, icy_road) :- fail.")
    shield(objection="objection(_, icy_road). objection(left_lane_change, no_lane).")


FAILURES = {
    "no action": {"safe_actions": "safe_actions(_) :- fail."},
    "instantiation": {"longitudinal_velocity": "longitudinal_velocity(V) :- V is _ + 1."},
    "type": {"front_is_free": "front_is_free :- atom_length(1, a)."},
    "unknown predicate": {"safe_actions": "safe_actions(lane_keeping) :- nobody_defined_this."},
    "zero division": {"longitudinal_velocity": "longitudinal_velocity(V) :- V is 1.0 / 0.0."},
    "thrown": {"state": "state(_) :- throw(oops)."},
    "no speed": {"longitudinal_velocity": "longitudinal_velocity(_) :- fail."},
    "negative speed": {"longitudinal_velocity": "longitudinal_velocity(-0.1)."},
    "atom as speed": {"longitudinal_velocity": "longitudinal_velocity(fast)."},
    "short observation": {"state": "state([0, 1])."},
    "observation out of range": {"state": "state([0, 0, 0, 0, 0, 0, 0, 0, 0.5, 1.5])."},
    "observation of atoms": {"state": "state([a, 0, 0, 0, 0, 0, 0, 0, 0.5, 1])."},
    "speed beyond any float": {"longitudinal_velocity": "longitudinal_velocity(V) :- V is 10 ^ 400."},
    "observation beyond any float": {"state": "state([0, 0, 0, 0, 0, 0, 0, 0, X, 1]) :- X is 10 ^ 400."},
    "endless": {"safe_actions": "safe_actions(X) :- safe_actions(X)."},
}


def refusal(asked: Shield) -> str:
    """Why a tier does not run a program; nothing if it does."""
    try:
        asked.decide_batch(SceneBatch.of([SCENE]))
    except UserError as problem:
        return str(problem)
    return ""


@pytest.mark.parametrize("changes", FAILURES.values(), ids=FAILURES)
@pytest.mark.parametrize("tier", ["interpreter", "scalar", "numpy"])
def test_a_failing_program_is_loud_and_on_the_road_brakes(changes: dict[str, str], tier: str) -> None:
    failing = shield(tier, **changes)
    refused = refusal(failing)
    with pytest.raises(UserError if refused and tier != "interpreter" else RuleFailure):
        failing.decide(SCENE)
    if refused:
        misfits = "state/1 gives a list of 2; expected 10", "state/1 gives no number as front; expected 10"
        not_run = () if tier == "interpreter" else (f"the {tier} tier cannot run these rules",)
        assert any(reason in refused for reason in (*misfits, *not_run))
        return
    decisions = failing.decide_batch(SceneBatch.of([SCENE]))
    assert decisions.action_mask.tolist() == [[True, False, False]]
    assert decisions.target_speed[0] == fail_safe_speed(30.0, SCENE.road) == pytest.approx(30.0 - 8.0 * 0.04)
    assert decisions.lane_to_keep[0] == SCENE.target_lane
    assert set(decisions.failures) == {0}
    assert decisions.failures[0]


@pytest.mark.parametrize("tier", TIERS)
def test_only_the_failing_scene_of_a_batch_takes_the_fail_safe(tier: str) -> None:
    picky = shield(
        tier,
        front_is_free="front_is_free.\n:- dynamic(vehicle/8).",
        longitudinal_velocity="longitudinal_velocity(V) :- vehicle(ego, _, _, _, X, _, _, _), V is 10.0 / X.",
    )
    standing = Scene(SCENE.road, SCENE.ego._replace(vx=0.0), (), 2)
    decisions = picky.decide_batch(SceneBatch.of([SCENE, standing]))
    assert set(decisions.failures) == {1}
    assert decisions.target_speed[0] == pytest.approx(1 / 3)


@pytest.mark.parametrize("tier", TIERS)
@pytest.mark.parametrize("field", ["x", "y", "vx", "vy", "length", "width"])
@pytest.mark.parametrize("who", ["ego", "other"])
def test_a_number_that_is_none_is_never_overlooked(tier: str, field: str, who: str) -> None:
    other = Vehicle("v0", 2, 40.0, 7.25, 20.0, 0.0, 4.6, 1.9)
    ego = SCENE.ego
    wrong: dict[str, Any] = {field: math.nan}
    if who == "ego":
        ego = ego._replace(**wrong)
    else:
        other = other._replace(**wrong)
    scene = Scene(SCENE.road, ego, (other,), 2)
    tested = SHIELDS["highway.pl", tier]
    with pytest.raises(RuleFailure):
        tested.decide(scene)
    decisions = tested.decide_batch(SceneBatch.of([SCENE, scene]))
    assert set(decisions.failures) == {1}
    assert decisions.action_mask[1].tolist() == [True, False, False]
    assert 0 <= decisions.target_speed[1] <= 30.0
    assert tested.decide_batch(SceneBatch.of([SCENE, SCENE])).failures == {}


def test_a_name_means_a_program_that_ships(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert Shield.from_files(["paper.pl"]).engine.defines("critical_distance", 1)
    (tmp_path / "paper.pl").write_text("\n".join(USABLE.values()))
    assert not Shield.from_files(["paper.pl"]).engine.defines("critical_distance", 1)
    with pytest.raises(UserError, match="cannot read the rule file"):
        Shield.from_files(["no/paper.pl"])


def test_a_file_on_top_of_a_program_that_ships_may_lie_anywhere(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """What it replaces without a word is logged, since a slip of the name would do the same."""
    path = tmp_path / "mine.pl"
    replaced = "safe_actions(lane_keeping).\n"
    path.write_text(f":- ensure_loaded('highway.pl').\n:- abolish(safe_actions/1).\n{replaced}")
    assert Shield.from_files([path]).decide(SCENE).action_mask == (1, 0, 0)
    assert caplog.messages == []
    path.write_text(f":- ensure_loaded('highway.pl').\n{replaced}")
    assert Shield.from_files([path]).decide(SCENE).action_mask == (1, 0, 0)
    (message,) = caplog.messages
    assert message.startswith(f"{path}:2: safe_actions/1 is defined anew")


def test_files_that_cannot_be_used(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"cannot read the rule file .*: No such file or directory$"):
        Shield.from_files([tmp_path / "none.pl"])
    with pytest.raises(
        UserError, match=r"cannot read the rule file higway\.pl: .*; did you mean highway\.pl\?$"
    ):
        Shield.from_files(["higway.pl"])
    (tmp_path / "bad.pl").write_text("safe_actions(lane_keeping).\nfront_is_free :- ( .\n")
    with pytest.raises(PrologSyntaxError, match=r"bad\.pl:2:"):
        Shield.from_files([tmp_path / "bad.pl"])


@pytest.mark.parametrize("program", PROGRAMS)
@pytest.mark.parametrize("tier", TIERS)
@given(scene=scenes())
@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_every_tier_answers_as_the_interpreter_does(program: str, tier: str, scene: Scene) -> None:
    interpreter, tested = SHIELDS[program, "interpreter"], SHIELDS[program, tier]
    batch = SceneBatch.of([SCENE, scene])
    decisions = tested.decide_batch(batch)
    assert tested.tier == tier
    try:
        decision = interpreter.decide(scene)
    except RuleFailure:
        assert set(decisions.failures) == {1}
        return
    assert decisions.action_mask[1].tolist() == list(map(bool, decision.action_mask))
    assert decisions.target_speed[1] == decision.target_speed
    assert decisions.observation[1].tolist() == list(decision.observation)
    assert decisions.front_is_free[1] == decision.front_is_free
    assert decisions.lane_to_keep[1] == decision.lane_to_keep
    assert not decisions.failures
    assert tested.entries_are_safe(batch)[1] == interpreter.entry_is_safe(scene)
    alone = tested.decide(scene)
    assert sorted(alone.safe_actions) == sorted(decision.safe_actions)
    assert replace(alone, safe_actions=decision.safe_actions) == decision
    assert tested.entry_is_safe(scene) == interpreter.entry_is_safe(scene)


@pytest.mark.parametrize("tier", ["scalar", "numpy", "numba", "auto"])
def test_one_scene_is_decided_by_the_tier_that_was_given(tier: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The interpreter is for what the tier leaves undecided, and then it is asked."""
    given_tier = Shield.default(tier=tier)
    expected = given_tier.decide(SCENE)
    asked: list[Scene] = []
    interpreted = Interpreter.decide_scene

    def noted(self: Interpreter, scene: Scene) -> Decision:
        asked.append(scene)
        return interpreted(self, scene)

    monkeypatch.setattr(Interpreter, "decide_scene", noted)
    monkeypatch.setattr(Interpreter, "entry_is_safe", None)
    assert given_tier.decide(SCENE) == expected
    assert given_tier.entry_is_safe(SCENE)
    assert asked == []
    beyond = replace(SCENE, ego=SCENE.ego._replace(x=2e15))
    given_tier.decide(beyond)
    assert asked == [beyond]


@pytest.mark.parametrize("tier", TIERS)
def test_reasons_are_of_the_scene_that_is_asked_about(tier: str) -> None:
    """A tier other than the interpreter leaves the engine's facts as they were."""
    asked = Shield.default(tier=tier)
    alongside = Vehicle("v1", 1, 0.0, 1.75, 30.0, 0.0, 4.6, 1.9)
    crowded = replace(SCENE, vehicles=(alongside,))
    for scene, there in ((crowded, True), (SCENE, False), (crowded, True)):
        found = objections(asked, scene, asked.decide(scene))
        blamed = [one.vehicle for against in found.values() for one in against]
        assert ("v1" in blamed) == there
        assert any(busy_sections(asked, scene).values()) == there


@given(scene=scenes())
@settings(max_examples=60, deadline=None)
def test_a_batch_gives_its_scenes_back(scene: Scene) -> None:
    seen = scene.in_range()
    again = SceneBatch.of([SCENE, scene]).scene(1)
    assert again.ego == scene.ego
    assert [car[1:] for car in again.vehicles] == [car[1:] for car in seen]
    assert all(math.isfinite(number) for car in again.vehicles for number in car[2:])


def test_facts_are_replaced_between_scenes() -> None:
    default = Shield.default()
    alongside = Vehicle("v1", 1, 0.0, 1.75, 30.0, 0.0, 4.6, 1.9)
    crowded = Scene(SCENE.road, SCENE.ego, (alongside,), 2)
    first = default.decide(SCENE)
    assert default.decide(crowded) != first
    assert default.decide(SCENE) == first


@pytest.mark.parametrize("program", PROGRAMS)
def test_numbers_of_other_types_are_the_same_scene(program: str) -> None:
    exact = replace(SCENE, vehicles=(Vehicle("van", 2, 40.0, 7.0, 25.0, 0.0, 5.0, 2.0),))
    ego: dict[str, Any] = {"lane": np.int64(2), "x": 0, "vx": np.float32(30)}
    van: tuple[Any, ...] = ("van", np.int8(2), 40, 7, np.int64(25), 0, 5, 2)
    loose = replace(exact, ego=SCENE.ego._replace(**ego), vehicles=(Vehicle(*van),))
    for tier in TIERS:
        asked = SHIELDS[program, tier]
        assert asked.decide(loose) == asked.decide(exact)
        decisions = asked.decide_batch(SceneBatch.of([exact, loose] * 5))
        assert not decisions.failures
        assert (decisions.target_speed == decisions.target_speed[0]).all()
        assert (decisions.observation == decisions.observation[0]).all()
        assert (decisions.action_mask == decisions.action_mask[0]).all()


@pytest.mark.parametrize("tier", TIERS)
@pytest.mark.parametrize(
    ("field", "value"), [("lane", 2.0), ("lane", True), ("x", "40"), ("vx", True), ("length", 10**400)]
)
def test_a_value_of_another_kind_is_refused_by_name(tier: str, field: str, value: object) -> None:
    scene = replace(SCENE, ego=SCENE.ego._replace(**{field: value}))  # type: ignore[arg-type]  # the mistake
    with pytest.raises(RuleFailure, match=f"{field} of vehicle/8 is"):
        SHIELDS["highway.pl", tier].decide(scene)
    with pytest.raises((TypeError, ValueError), match=f"{field} of vehicle/8 is"):
        SceneBatch.of([scene])


@pytest.mark.parametrize("tier", TIERS)
def test_a_lane_to_steer_for_is_an_integer(tier: str) -> None:
    wrong = replace(SCENE, target_lane=2.0)  # type: ignore[arg-type]  # the mistake
    with pytest.raises(RuleFailure, match=r"target_lane/1 is 2\.0; expected an integer"):
        SHIELDS["highway.pl", tier].decide(wrong)
    with pytest.raises(TypeError, match=r"target_lane/1 is 2\.0; expected an integer"):
        SceneBatch.of([wrong])
    same = replace(SCENE, target_lane=np.int8(2))  # type: ignore[arg-type]  # it is an integer
    assert SHIELDS["highway.pl", tier].decide(same) == SHIELDS["highway.pl", tier].decide(SCENE)


def test_a_lane_beyond_64_bits_has_no_place_in_a_batch() -> None:
    with pytest.raises(ValueError, match="a lane of scene 1 is not an integer of 64 bits"):
        SceneBatch.of([SCENE, replace(SCENE, ego=SCENE.ego._replace(lane=2**64))])


@pytest.mark.parametrize("goal", ["halt", "halt(3)", "catch(halt, _, true)", "call_cleanup(fail, halt)"])
@pytest.mark.parametrize("tier", ["interpreter", "auto"])
def test_a_rule_that_halts_is_a_failure_with_the_fail_safe(goal: str, tier: str) -> None:
    halting = shield(
        tier, safe_actions=f"safe_actions(lane_keeping) :- {goal}.", entry_is_safe="entry_is_safe :- halt."
    )
    with pytest.raises(RuleFailure, match="asked to end"):
        halting.decide(SCENE)
    with pytest.raises(RuleFailure, match="asked to end"):
        halting.entry_is_safe(SCENE)
    decisions = halting.decide_batch(SceneBatch.of([SCENE]))
    assert list(decisions.failures) == [0]
    assert decisions.target_speed[0] == fail_safe_speed(SCENE.ego.vx, SCENE.road)


def test_a_file_that_halts_or_never_ends_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "rules.pl"
    path.write_text("\n".join(USABLE.values()) + "\n:- halt.\n")
    with pytest.raises(PrologError, match="asked to end"):
        Shield.from_files([path])
    engine = Engine()
    path.write_text("p(1).\n:- repeat, fail.\n")
    with pytest.raises(LimitExceeded):
        engine.consult(path, limits=Limits(inferences=10_000))
    assert not engine.defines("p", 1)


def test_a_question_may_have_a_limit_of_seconds() -> None:
    engine = Engine()
    engine.consult_text("\n".join({**USABLE, "entry_is_safe": "entry_is_safe :- repeat, fail."}.values()))
    with pytest.raises(RuleFailure, match="seconds"):
        Shield(engine, seconds=0.05).entry_is_safe(SCENE)
    assert Shield(engine).limits == LIMITS
    assert LIMITS.seconds is None


def test_shields_of_two_tiers_on_one_engine_tell_each_other_of_the_road() -> None:
    first = Shield.default()
    second = first.with_tier("scalar")
    assert (first.tier, second.tier) == ("interpreter", "scalar")
    slow = replace(SCENE, road=replace(SCENE.road, time_step=0.2))
    expected = [Shield.default().decide(scene) for scene in (SCENE, slow)]
    assert expected[0] != expected[1]
    for _ in range(2):
        assert first.decide(SCENE) == expected[0]
        assert second.decide(slow) == expected[1]
        assert first.decide(SCENE) == expected[0]
    with pytest.raises(UserError, match="the scalar tier cannot run these rules"):
        shield(safe_actions="safe_actions(X) :- nb_getval(offer, X).").with_tier("scalar")


@pytest.mark.parametrize("tier", ["numpy", "numba"])
def test_the_facts_of_a_road_are_made_once_while_others_are_asked_about(
    tier: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Egos enter on the roads of a whole data set, one after the other."""
    made: list[Road] = []

    def counted(one: Road) -> Any:
        made.append(one)
        return road_facts(one)

    monkeypatch.setattr(scene_program, "road_facts", counted)
    asked = Shield.default(tier=tier)
    for limit in (30.0, 30.1, 30.0, 30.1, 30.0):
        on = road(0, 3, limit=limit)
        decisions = asked.decide_batch(SceneBatch.of([replace(SCENE, road=on)] * 9))
        assert set(decisions.target_speed.tolist()) == {limit}
    assert made == [road(0, 3, limit=30.0), road(0, 3, limit=30.1)]


def test_the_facts_of_few_roads_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scene_program, "KEPT", 2)
    asked = Shield.default(tier="numpy")
    for limit in (30.0, 30.1, 30.02, 30.04, 30.0):
        decisions = asked.decide_batch(SceneBatch.of([replace(SCENE, road=road(0, 3, limit=limit))] * 9))
        assert set(decisions.target_speed.tolist()) == {limit}
    tier: Any = asked._tier()
    assert len(tier._answers._known) == 2
