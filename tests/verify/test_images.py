"""Questions asked in another scene, against asking them in that scene."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from drlsl.driving.scene import Scene
from drlsl.driving.shield import Shield, default_rules
from drlsl.errors import UserError
from drlsl.logic import Engine
from drlsl.verify.images import expand
from drlsl.verify.properties import Book, default_properties, load
from tests.scenes import scenes

FEW = settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
ACTIONS = ("lane_keeping", "left_lane_change", "right_lane_change")


@pytest.fixture(scope="module")
def book() -> Book:
    return load([])


@FEW
@given(scene=scenes(), data=st.data())
def test_alone_is_the_scene_with_one_vehicle(book: Book, scene: Scene, data: st.DataObject) -> None:
    focus = data.draw(st.sampled_from(["none", *(car.id for car in scene.in_range())]))
    shield = Shield(book.engine)
    shield.state_facts(scene)
    book.engine.replace_facts("focus", 1, [(focus,)])
    there = [action for action in ACTIONS if book.engine.holds(f"'alone:safe_actions'({action})")]
    one = tuple(car for car in scene.vehicles if car.id == focus)
    shield.state_facts(Scene(scene.road, scene.ego, one, scene.target_lane))
    assert there == [action for action in ACTIONS if book.engine.holds(f"safe_actions({action})")]


P = "image(a, p(2), true). p(1)."


def engine_of(text: str) -> Engine:
    engine = Engine()
    engine.consult_text(text)
    expand(engine)
    return engine


def test_only_what_depends_on_the_facts_is_copied() -> None:
    engine = engine_of(
        "image(far, p(X1), ( p(X), X1 is X + 10 )). p(1). p(2). limit(11). high(X) :- p(X), limit(L), X > L. "
        "ask(X) :- in(far, high(X)). all(L) :- in(far, findall(X, p(X), L))."
    )
    assert [solution["X"] for solution in engine.query("ask(X)")] == [12]
    assert [solution["L"] for solution in engine.query("all(L)")] == [[11, 12]]
    assert engine.defines("far:high", 1)
    assert not engine.defines("far:limit", 1)


def test_goals_inside_control_constructs_are_asked_in_the_image() -> None:
    engine = engine_of(
        f"{P} "
        "ask(X) :- in(a, ( call(p, X), \\+ p(1), setup_call_cleanup(true, p(X), p(_)) )). "
        "list(L) :- in(a, ( findall(X, ( member(X, [1, 2]), p(X) ), L), forall(member(Y, L), p(Y)) ))."
    )
    assert [solution["X"] for solution in engine.query("ask(X)")] == [2]
    assert [solution["L"] for solution in engine.query("list(L)")] == [[2]]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("p(1). ask :- in(nowhere, p(_)).", r"no clause image\(nowhere, Fact, Goal\)"),
        ("image(a, p(X), p(X)). p(1). ask :- in(a, in(a, p(_))).", "an image of an image"),
        ("image(a, p(X), p(X)). p(1). ask(G) :- in(a, call(G, 1)).", "unknown before the rules run"),
        ("p(1). ask(X) :- in(X, p(1)).", "needs the name of an image"),
        (
            f"{P} ask :- in(a, maplist(p, [1])).",
            "maplist/2 calls a goal that it is given",
        ),
        (f"{P} q :- maplist(p, [1]). ask :- in(a, q).", "maplist/2 calls a goal"),
        (f"{P} each(G) :- G. ask :- in(a, each(p(1))).", "each/1 calls a goal"),
        (
            f"{P} each(G) :- \\+ call(G, 1). q :- each(p). ask :- in(a, q).",
            "each/1 calls",
        ),
        (f"{P} ask :- in(a, phrase(p, [])).", "phrase/2 calls a goal"),
        (
            f"{P} ask :- in(a, foldl(q, [1], 0, _)). q(X, Y, Y) :- p(X).",
            "foldl/4 calls",
        ),
    ],
)
def test_images_that_cannot_be(text: str, message: str) -> None:
    with pytest.raises(UserError, match=message):
        engine_of(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("image(a, b, c).", "no properties"),
        ("property(a, b). property(a, c). violates(a) :- fail.", "more than once"),
        ("property(a, b).", r"property\(a, ...\) without a clause"),
        ("property(a, b). violates(c) :- fail.", r"violates\(c\) without property"),
        ("property(a, b). property(c, d). violates(a) :- fail.", r"property\(c, ...\) without a clause"),
        ("property(a, b). violates(a) :- fail. gap(_, 1).", r"highway.pl:\d+.* the rules define gap/2"),
        ("property(a, b). violates(a) :- fail. range(wheels, 3, 4).", r"range\(wheels, ...\): unknown"),
        ("property(a, b). violates(a) :- fail. range(speed, 3, 1).", "the lower first"),
        ("property(a, b). violates(_) :- fail.", "names no property"),
    ],
)
def test_files_of_properties_that_cannot_be(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "bad.pl"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UserError, match=message):
        load(default_rules(), [path])


def test_several_files_of_properties_stand_side_by_side(tmp_path: Path) -> None:
    path = tmp_path / "more.pl"
    path.write_text("property(mine, b). violates(mine) :- fail. range(length, 1, 18).", encoding="utf-8")
    book = load([], [path, default_properties()])
    assert [one.name for one in book.properties][:2] == ["mine", "lane_exists"]
    assert book.ranges["length"] == (Fraction(1), Fraction(18))
    assert not book.engine.warnings


def test_a_property_may_ask_for_what_rules_lack(tmp_path: Path) -> None:
    path = tmp_path / "more.pl"
    path.write_text("property(a, b). violates(a) :- helper. helper :- hovercraft(1).", encoding="utf-8")
    assert load([], [path]).missing == {"a": ("hovercraft/1",)}


def test_the_default_properties_read_no_rule_but_what_all_are_asked_for() -> None:
    book = load([default_properties().parent / "paper.pl"])
    assert book.missing == {"lane_to_keep": ("lane_to_keep/1",)}
