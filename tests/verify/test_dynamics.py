"""What follows from a decision: the properties of dynamics.pl, and errors that break them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from drlsl.driving.shield import default_rules
from drlsl.errors import UserError
from drlsl.verify import Case, Request, Result, verify
from drlsl.verify.confirmation import Replay
from drlsl.verify.properties import load
from drlsl.verify.ranges import all_cases
from drlsl.workers import Crew

RULES = default_rules()[0].parent
DYNAMICS = RULES / "dynamics.pl"
R157, R157_PROPERTIES = RULES / "un_r157.pl", RULES / "un_r157.properties.pl"
FOLLOWER, FOLLOWER_PROPERTIES = RULES / "follower_brakes.pl", RULES / "follower_brakes.properties.pl"
CASES = (Case(0, 2, 1, 1),)

SLIPS = {
    "a wrong sign": ("keeps_apart_ahead", "(V + A * T) * (V", "(V - A * T) * (V"),
    "a wrong sign, seen in the distance": ("distance_is_least", "- VFront * VFront", "+ VFront * VFront"),
    "half the braking": ("keeps_apart_behind", "(V + A * T) / (2 * B)", "(V + A * T) / (4 * B)"),
    "half the braking, seen in the distance": (
        "distance_is_enough",
        "(V + A * T) / (2 * B)",
        "(V + A * T) / (4 * B)",
    ),
    "the response is forgotten": ("keeps_apart_ahead", "V * T + A * T * T / 2 + ", ""),
    "the response is forgotten, seen in the distance": (
        "distance_is_enough",
        "V * T + A * T * T / 2 + ",
        "",
    ),
    "who comes the other way stands": (
        "keeps_apart_oncoming",
        "velocity(Car, V2), required_gap",
        "speed(Car, V2), required_gap",
    ),
    "who comes the other way does not come nearer": (
        "can_stop_before_oncoming",
        "Gap is Gap0 - S",
        "Gap is Gap0 - S + S",
    ),
    "only one of two stops": ("opposite_is_enough", "C is S1 + S2", "C is S1"),
    "more than the two need": ("opposite_is_least", "C is S1 + S2", "C is 0.1 + S1 + S2"),
    "gently where there is no room": (
        "brakes_fully_where_it_cannot",
        "braking_limit(B), A is -B\n    ; Gap > Required",
        "giving_way(B), A is -B\n    ; Gap > Required",
    ),
    "giving way the softer the nearer": (
        "nearer_is_no_softer",
        "Gap > Required, Needed =< Sure -> acc",
        "Gap < Required, Needed =< Sure -> acc",
    ),
    "more than is needed": ("distance_is_least", "C is max(0.0,", "C is 0.1 + max(0.0,"),
    "no room at standstill": ("keeps_apart_ahead", "Gap is C + D", "Gap is C - D + D"),
    "a front vehicle that brakes softly": ("can_stop_at_entry", "front_braking(8.0)", "front_braking(4.0)"),
    "nobody is looked for on the way": ("can_stop_after_change", "Gap < Needed.", "Gap < 0.0, Gap < Needed."),
    "half the way to stop": (
        "can_stop_after_step",
        "V1 * V1 / (2 * B) + Dt * Dt",
        "V1 * V1 / (4 * B) + Dt * Dt",
    ),
    "a wrong sign in the room": ("can_stop_after_step", "- V1 * Dt =<", "+ V1 * Dt =<"),
    "a stop without the step, in the rules": ("can_stop_after_step", "/ (2 * B) + Dt * Dt.", "/ (2 * B)."),
}
"""An error in the rules, by the property that finds it."""

MOTION_SLIPS = {
    "a front vehicle that comes too far": (
        "front_comes_so_far",
        "S is V * T - 8.0 * T * T / 2",
        "S is V * T",
    ),
    "a rear vehicle that does not speed up": (
        "rear_comes_no_further",
        "U is V + 3.0 * 0.35, T1",
        "U is V, T1",
    ),
    "a rear vehicle that brakes twice as hard": (
        "rear_comes_no_further",
        "/ (2 * 6.0).",
        "/ (4 * 6.0).",
    ),
    "a stop without the step": ("can_stop_after_full_braking", "/ (2 * 8.0) + Dt * Dt", "/ (2 * 8.0)"),
}
"""An error in the motion that dynamics.pl assumes, by the property that finds it."""


def results(**wanted: object) -> dict[str, Result]:
    wanted = {"attack": 2000, **wanted}
    return {result.name: result for result in verify(Request(**wanted)).results}  # type: ignore[arg-type]  # each has its type


def statuses(found: Mapping[str, Result]) -> dict[str, str]:
    return {name: f"{result.status} {result.reason}".strip() for name, result in found.items()}


def changed(folder: Path, old: str, new: str, names: tuple[str, ...]) -> None:
    """Copies of rule files in which a text that is in one of them is replaced."""
    texts = {name: (RULES / name).read_text(encoding="utf-8") for name in names}
    assert sum(text.count(old) for text in texts.values()) == 1
    for name, text in texts.items():
        (folder / name).write_text(text.replace(old, new), encoding="utf-8")


def test_the_default_rules_have_all_dynamic_properties() -> None:
    found = results(properties=(DYNAMICS,), vehicles=6, cases=CASES)
    assert statuses(found) == dict.fromkeys(found, "proved")
    assert all(result.for_any_number for result in found.values())


@pytest.mark.parametrize("slip", SLIPS)
def test_errors_in_the_rules_are_found(tmp_path: Path, slip: str) -> None:
    name, old, new = SLIPS[slip]
    changed(tmp_path, old, new, ("highway.pl", "longitudinal.pl", "observation.pl"))
    wanted = {"rules": (tmp_path / "highway.pl",), "properties": (DYNAMICS,), "only": (name,), "cases": CASES}
    (result,) = results(**wanted).values()
    assert result.status == "refuted", result.reason
    assert result.counterexample is not None


@pytest.mark.parametrize("slip", MOTION_SLIPS)
def test_errors_in_the_motion_are_found(tmp_path: Path, slip: str) -> None:
    name, old, new = MOTION_SLIPS[slip]
    changed(tmp_path, old, new, ("dynamics.pl", "spec.pl"))
    (result,) = results(properties=(tmp_path / "dynamics.pl",), only=(name,), cases=CASES).values()
    assert result.status == "refuted", result.reason
    assert result.counterexample is not None
    assert result.counterexample.unknowns


def test_a_counterexample_has_the_unknowns_that_its_property_speaks_of(tmp_path: Path) -> None:
    path = tmp_path / "far.pl"
    path.write_text(
        ":- dynamic(way/1). :- dynamic(other/1). "
        "unknown(way, 1, 9.5, 'a way, m'). unknown(other, 0, 1, 'another'). "
        "property(short, 'short'). violates(short) :- way(W), W > 7.25. "
        "property(far, 'far'). violates(far) :- way(W), W < 0.5."
    )
    found = results(properties=(path,), vehicles=0, cases=CASES)
    assert found["far"].status == "proved"
    counterexample = found["short"].counterexample
    assert counterexample is not None
    assert counterexample.unknowns.keys() == {"way"}
    assert 7.25 < counterexample.unknowns["way"] <= 9.5
    assert counterexample.as_json()["unknowns"] == dict(counterexample.unknowns)
    book = load([], [path])
    replay = Replay(book.engine, book.properties[0], book.facts)
    assert replay.breaks(counterexample.scene, "none", {"way": 7.0, "other": 0.0}) is None
    assert replay.breaks(counterexample.scene, "none", {"way": 8.0, "other": 0.0}) is not None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("unknown(time_step, 0, 1, 'x').", "the name is taken"),
        ("unknown(speed, 0, 1, 'x').", "the name is taken"),
        ("unknown(way, 2, 1, 'x').", "expected two numbers, the lower first"),
        ("unknown(way, 0, 1, 'x'). unknown(way, 0, 2, 'x').", "more than once, with different"),
        ("unknown(way, 0, 1, 'x'). way(3.0).", "way/1 has clauses"),
    ],
)
def test_unknowns_that_cannot_be(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "wrong.pl"
    path.write_text(f"property(p, 'p'). violates(p) :- fail. {text}")
    with pytest.raises(UserError, match=message):
        load([], [path])


def test_two_files_may_speak_of_the_same_unknown() -> None:
    book = load([R157], [R157_PROPERTIES, DYNAMICS])
    assert {"moment", "step_share"} <= book.unknowns.keys()


@pytest.mark.parametrize(
    ("rules", "properties", "start", "count"),
    [(R157, R157_PROPERTIES, "r157", 6), (FOLLOWER, FOLLOWER_PROPERTIES, "follower", 4)],
    ids=["un_r157.pl", "follower_brakes.pl"],
)
def test_other_distances_have_properties_of_their_own(
    rules: Path, properties: Path, start: str, count: int
) -> None:
    book = load([rules], [properties])
    own = tuple(one.name for one in book.properties if one.name.startswith(start))
    assert len(own) == count
    found = results(rules=(rules,), properties=(properties,), only=own, vehicles=5, cases=CASES)
    assert statuses(found) == dict.fromkeys(own, "proved")


@pytest.mark.parametrize(
    ("rules", "name", "properties"),
    [
        (R157, "critical_distance_front", R157_PROPERTIES),
        (R157, "safe_entry", R157_PROPERTIES),
        (R157, "keeps_apart_behind", DYNAMICS),
        (R157, "distance_is_enough", DYNAMICS),
        (FOLLOWER, "critical_distance_back", FOLLOWER_PROPERTIES),
        (FOLLOWER, "safe_entry", FOLLOWER_PROPERTIES),
        (FOLLOWER, "keeps_apart_behind", DYNAMICS),
    ],
)
def test_other_distances_are_not_those_of_rss(rules: Path, name: str, properties: Path) -> None:
    found = results(rules=(rules,), properties=(properties,), only=(name,), cases=CASES)
    assert found[name].status == "refuted"


@pytest.mark.parametrize(
    ("old", "new", "name"),
    [
        ("follower_response(0.4)", "follower_response(0.3)", "follower_keeps_distance"),
        ("follower_response(0.4)", "follower_response(0.5)", "follower_room_is_least"),
        ("follower_braking(3.0)", "follower_braking(3.5)", "follower_has_room"),
        ("Kept = VRear", "Kept = VEgo", "follower_room_is_least"),
        ("max(D, Kept * Headway)", "Kept * Headway", "follower_entry"),
    ],
)
def test_errors_in_the_room_behind_are_found(tmp_path: Path, old: str, new: str, name: str) -> None:
    text = FOLLOWER.read_text(encoding="utf-8").replace("'highway.pl'", f"'{RULES / 'highway.pl'}'")
    assert text.count(old) == 1
    path = tmp_path / "slip.pl"
    path.write_text(text.replace(old, new), encoding="utf-8")
    (result,) = results(rules=(path,), properties=(FOLLOWER_PROPERTIES,), only=(name,), cases=CASES).values()
    assert result.status == "refuted", result.reason


@pytest.mark.slow
def test_everything_is_proved_on_every_road() -> None:
    found = results(properties=(DYNAMICS,), vehicles=6, crew=Crew(2), cases=tuple(all_cases()))
    assert statuses(found) == dict.fromkeys(found, "proved")
    assert all(result.for_any_number for result in found.values())
