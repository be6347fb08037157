"""How many vehicles are enough, on programs small enough to count by hand."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings

from drlsl.driving.scene import SCHEMA, Facts, Scene, road_facts, scene_facts
from drlsl.logic import Engine
from drlsl.lowering.backends import compile_scalar
from drlsl.lowering.frontend import Query, lower
from drlsl.verify.properties import FACTS, load
from drlsl.verify.scope import witnesses
from tests.scenes import scenes

OTHER = "other(X, V) :- vehicle(Id, _, X, _, V, _, _, _), Id \\== ego. "


@pytest.mark.parametrize(
    ("rule", "enough"),
    [
        ("ask :- vehicle(ego, _, X, _, _, _, _, _), X > 0.0.", 0),
        ("ask :- other(X, _), X > 0.0.", 1),
        ("ask :- \\+ other(_, _).", 0),
        ("ask :- other(X, _), X > 0.0, \\+ ( other(Y, _), Y > 5.0 ).", 1),
        ("ask :- other(X, V), other(Y, W), X < Y, V > W.", 2),
        ("ask :- ( other(X, _), X > 1.0 ; other(Y, _), Y < -1.0, other(_, V), V > 3.0 ).", 2),
        ("ask :- aggregate_all(min(X), other(X, _), X), X > 3.0.", 1),
        (
            "ask :- aggregate_all(min(X), other(X, _), X), aggregate_all(max(Y), other(Y, _), Y), Y > X.",
            2,
        ),
        ("ask :- aggregate_all(count, other(_, _), N), N > 3.", None),
        ("ask :- aggregate_all(sum(X), other(X, _), S), S > 3.0.", None),
        # every one ahead needs one that races behind, every one behind one that comes the other way
        (
            "ask :- other(X, V), X > 90.0, V < 10.0, V > 0.0, \\+ ( other(Y, _), \\+ "
            "( Y > 0.0, other(Z, W), Z < 0.0, W > 60.0 ; Y < 0.0, other(_, W), W < -60.0 ) ).",
            3,
        ),
        ("ask :- other(X, _), \\+ ( other(Y, _), \\+ ( other(Z, _), Z > X + Y ) ).", None),
    ],
)
def test_counts(rule: str, enough: int | None) -> None:
    engine = Engine()
    engine.consult_text(OTHER + rule)
    assert witnesses(lower(engine, SCHEMA, [Query("ask", 0, "holds")]).answers[0]) == enough


@pytest.mark.parametrize(
    ("rule", "enough"),
    [
        ("ask :- at(Id, X), focus(Id), X > 0.0, at(Id, Y), Y < 5.0.", 1),
        ("ask :- focus(Id), Id == truck.", 1),
        ("ask :- \\+ ( at(Id, X), focus(Id), X > 0.0 ).", 0),
        ("ask :- aggregate_all(min(X), seen(X), L), aggregate_all(max(X), seen(X), M), M > L + 3.0.", 1),
        ("ask :- at(Id, X), focus(Id), X > 0.0, at(Other, Y), Other \\== ego, Y > X.", 2),
        ("ask :- at(Id, X), ( focus(Id) ; X > 0.0 ), aggregate_all(min(Y), at(_, Y), L), X > L.", 2),
    ],
)
def test_all_that_is_in_focus_is_one_vehicle(rule: str, enough: int) -> None:
    engine = Engine()
    engine.consult_text(
        ":- dynamic(focus/1). at(Id, X) :- vehicle(Id, _, X, _, _, _, _, _). "
        "seen(X) :- at(Id, X), ( Id == ego -> true ; focus(Id) ). " + rule
    )
    assert witnesses(lower(engine, FACTS, [Query("ask", 0, "holds")]).answers[0]) == enough


BOOK = load([])
SCALARS = {one.name: compile_scalar(lower(BOOK.engine, FACTS, [one.query])) for one in BOOK.properties}


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(scene=scenes())
def test_no_property_of_the_default_rules_is_broken(scene: Scene) -> None:
    """Every scene is a test of the properties, those with more vehicles than are enough too."""
    focus = next((car.id for car in scene.in_range()), "none")
    facts: Facts = {**road_facts(scene.road), **scene_facts(scene), ("focus", 1): [(focus,)]}
    broken = [name for name, scalar in SCALARS.items() if any(scalar(facts))]
    assert broken == []
