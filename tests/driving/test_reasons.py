"""Why an action is not offered, as the rules tell it."""

from __future__ import annotations

import pytest

from drlsl.driving.actions import Action
from drlsl.driving.reasons import Objection, objections
from drlsl.driving.shield import Shield
from drlsl.logic import Engine
from tests.driving.test_shield import SCENE, USABLE


@pytest.mark.parametrize(
    ("reason", "expected", "as_json"),
    [
        ("no_lane", Objection("no_lane"), {"reason": "no_lane"}),
        (
            "too_close(a, -1, 2.5)",
            Objection("too_close", "a", -1.0, 2.5),
            {"reason": "too_close", "vehicle": "a", "gap": -1.0, "needed": 2.5},
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
    ],
)
def test_a_reason_of_any_form(reason: str, expected: Objection, as_json: dict[str, object]) -> None:
    engine = Engine()
    engine.consult_text("\n".join([*USABLE.values(), f"objection(left_lane_change, {reason})."]))
    shield = Shield(engine)
    found = objections(shield, shield.decide(SCENE))
    assert found == {Action.LEFT_LANE_CHANGE: [expected], Action.RIGHT_LANE_CHANGE: []}
    assert expected.as_json() == as_json


def test_the_nearest_vehicle_comes_first() -> None:
    engine = Engine()
    rules = "".join(
        f"objection(left_lane_change, {reason}).\n"
        for reason in ("too_close(a, 9.0, 20.0)", "too_close(b, 4.0, 20.0)", "law(z)", "law(a)", "law(a)")
    )
    engine.consult_text("\n".join([*USABLE.values(), rules]))
    shield = Shield(engine)
    found = objections(shield, shield.decide(SCENE))[Action.LEFT_LANE_CHANGE]
    assert [objection.details or objection.vehicle for objection in found] == [("a",), ("z",), "b", "a"]
