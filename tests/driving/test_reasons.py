"""Why an action is not offered, as the rules tell it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from drlsl.driving.explain import Objection, objections, speed_reason
from drlsl.driving.explain.reasons import SpeedReason
from drlsl.driving.scene import Action
from drlsl.driving.shield import Shield
from drlsl.errors import UserError
from drlsl.logic import Engine
from tests.driving.test_shield import SCENE, USABLE


@pytest.mark.parametrize(
    ("reason", "expected", "as_json"),
    [
        ("no_lane", Objection("no_lane"), {"reason": "no_lane"}),
        (
            "too_close(a, -1, 2.5)",
            Objection("too_close", "a", -1.0, 2.5),
            {"reason": "too_close", "vehicle": "a", "gap": -1.0, "needed": 2.5, "missing": 3.5},
        ),
        (
            "rough_road(bridge, 2.5, 3)",
            Objection("rough_road", details=("bridge", 2.5, 3)),
            {"reason": "rough_road", "details": ["bridge", 2.5, 3]},
        ),
        (
            "seen(at(3))",
            Objection("seen", details=("at(3)",)),
            {"reason": "seen", "details": ["at(3)"]},
        ),
        (
            "too_close(a, far, 2.5)",
            Objection("too_close", details=("a", "far", 2.5)),
            {"reason": "too_close", "details": ["a", "far", 2.5]},
        ),
    ],
)
def test_a_reason_of_any_form(reason: str, expected: Objection, as_json: dict[str, object]) -> None:
    engine = Engine()
    engine.consult_text("\n".join([*USABLE.values(), f"objection(left_lane_change, {reason})."]))
    shield = Shield(engine)
    found = objections(shield, SCENE, shield.decide(SCENE))
    assert found == {Action.LEFT_LANE_CHANGE: [expected], Action.RIGHT_LANE_CHANGE: []}
    assert expected.as_json() == as_json


@pytest.mark.parametrize(("reason", "shown"), [("_", "Reason"), ("7", "7"), ("[near, far]", "near")])
def test_a_reason_without_a_name_is_refused(reason: str, shown: str) -> None:
    engine = Engine()
    engine.consult_text("\n".join([*USABLE.values(), f"objection(left_lane_change, {reason})."]))
    shield = Shield(engine)
    decision = shield.decide(SCENE)
    with pytest.raises(UserError, match=f"{shown}.* as a reason against left_lane_change; expected a name"):
        objections(shield, SCENE, decision)


def test_an_objection_that_takes_no_action_away_is_logged(caplog: pytest.LogCaptureFixture) -> None:
    engine = Engine()
    engine.consult_text("\n".join([*USABLE.values(), "objection(lane_keeping, icy_road(bridge))."]))
    shield = Shield(engine)
    assert Action.LANE_KEEPING not in objections(shield, SCENE, shield.decide(SCENE))
    assert caplog.messages == ["the rules offer lane_keeping in spite of an objection: icy road: bridge"]


def test_the_nearest_vehicle_comes_first() -> None:
    engine = Engine()
    rules = "".join(
        f"objection(left_lane_change, {reason}).\n"
        for reason in ("too_close(a, 9.0, 20.0)", "too_close(b, 4.0, 20.0)", "law(z)", "law(a)", "law(a)")
    )
    engine.consult_text("\n".join([*USABLE.values(), rules]))
    shield = Shield(engine)
    found = objections(shield, SCENE, shield.decide(SCENE))[Action.LEFT_LANE_CHANGE]
    assert [objection.details or objection.vehicle for objection in found] == [("a",), ("z",), "b", "a"]


@pytest.mark.parametrize(
    ("objection", "words"),
    [
        (Objection("too_close", "v2", 5.4, 66.5), "v2 is 5.4 m away, 66.5 m needed: 61.1 m missing"),
        (Objection("too_close", "v2", -3.2, 66.5), "v2 is alongside, 66.5 m needed: 69.7 m missing"),
        (Objection("no_lane"), "no lane"),
        (Objection("rough_road", details=("bridge", 2.5)), "rough road: bridge, 2.5"),
    ],
)
def test_words(objection: Objection, words: str) -> None:
    assert objection.words() == words


def test_the_vehicle_that_decides_the_speed() -> None:
    shield = Shield.default()
    near = SCENE.ego._replace(id="near", x=40.0, vx=25.0)
    far = near._replace(id="far", x=80.0, vx=31.0)
    beside = near._replace(id="beside", lane=1, y=1.75, x=30.0)
    scene = replace(SCENE, vehicles=(far, beside, near))
    decision = shield.decide(scene)
    reason = speed_reason(shield, scene, decision.target_speed)
    assert reason is not None
    assert reason.vehicle == "near"
    without = shield.decide(replace(scene, vehicles=(far, beside)))
    assert reason.without == without.target_speed > decision.target_speed
    assert reason.words() == f"near decides it; without it {without.target_speed:.2f} m/s"
    shield.decide(scene)
    speed_reason(shield, scene, decision.target_speed)
    assert shield.engine.holds("vehicle(near, _, _, _, _, _, _, _)")


def test_nobody_decides_the_speed_on_a_free_road_or_where_two_do_alike() -> None:
    shield = Shield.default()
    assert speed_reason(shield, SCENE, shield.decide(SCENE).target_speed) is None
    twins = tuple(SCENE.ego._replace(id=name, x=40.0, vx=25.0) for name in ("one", "other"))
    scene = replace(SCENE, vehicles=twins)
    assert speed_reason(shield, scene, shield.decide(scene).target_speed) is None


def test_of_several_that_matter_the_one_that_matters_most_decides() -> None:
    engine = Engine()
    speed = (
        "longitudinal_velocity(V) :- findall(D, ( slows(Car, D), vehicle(Car, _, _, _, _, _, _, _) ), Ds), "
        "sum_list(Ds, S), V is 20.0 - S.\nslows(one, 1.0). slows(two, 5.0). slows(three, 2.0)."
    )
    engine.consult_text("\n".join([*{**USABLE, "longitudinal_velocity": speed}.values()]))
    shield = Shield(engine)
    cars = tuple(SCENE.ego._replace(id=name, x=20.0) for name in ("one", "two", "three", "four"))
    scene = replace(SCENE, vehicles=cars)
    assert shield.decide(scene).target_speed == 12.0
    assert speed_reason(shield, scene, 12.0) == SpeedReason("two", 17.0)
