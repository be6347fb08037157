"""Proofs and refutations: small ones here, the whole in the tests marked slow."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest

from drlsl.driving.scene import load_scene
from drlsl.driving.shield import Shield, default_rules
from drlsl.verify import Case, Request, Result, verify, write_counterexample
from drlsl.verify.confirmation import Replay
from drlsl.verify.properties import load
from drlsl.verify.ranges import all_cases
from drlsl.workers import Crew

RULES = default_rules()[0].parent
TWO_LANES = Case(0, 2, 1, 1)
MIDDLE = Case(1, 3, 3, 3)

MUTANTS = {
    "wrong sign of a side": (
        "lane_exists",
        {"leftward(left, 1).": "leftward(left, -1).", "leftward(right, -1).": "leftward(right, 1)."},
    ),
    "wrong sign of an offset": (
        "critical_distance_front",
        {"S is Sign * (X2 - X1)": "S is Sign * (X1 - X2)"},
    ),
    "wrong lane": (
        "nobody_alongside",
        {"way(left, Low, High) :- side_lane(left,": "way(left, Low, High) :- side_lane(right,"},
    ),
    "missing vehicle: the one behind": (
        "critical_distance_back",
        {
            "gap(Car, Gap), needed_gap(Car, Needed),": "offset(Car, S), S >= 0.0, "
            "gap(Car, Gap), needed_gap(Car, Needed),"
        },
    ),
    "missing vehicle: one between lanes": (
        "nobody_alongside",
        {
            "    distance(ego, Car, D), radar_range(R)": "    lane(Car, Own), Own =\\= 0, "
            "distance(ego, Car, D), radar_range(R)"
        },
    ),
    "missing vehicle: all but the first": (
        "nothing_hidden",
        {
            "lane_change(Action, Side), obstacle(": "lane_change(Action, Side), "
            "once(( target_vehicle(Car), in_way(Car, Side) )), obstacle("
        },
    ),
    "who comes the other way counts as standing": (
        "opposite_distance",
        {"velocity(Car, V2), required_gap": "speed(Car, V2), required_gap"},
    ),
    "who comes the other way does not count": (
        "oncoming_is_no_better",
        {"V is -VFront, opposite_distance(VRear, V, C)": "C is 0.0"},
    ),
    "wrong unit: km/h taken for m/s": (
        "critical_distance_back",
        {"V is Sign * Vx.": "V is Sign * Vx / 3.6."},
    ),
    "wrong unit: m/s taken for km/h": (
        "acceleration_in_limits",
        {"V is Sign * Vx.": "V is Sign * Vx * 3.6."},
    ),
}


def mutated(folder: Path, changes: Mapping[str, str]) -> Path:
    """A copy of the default rules with texts of highway.pl replaced."""
    for name in ("highway.pl", "longitudinal.pl", "observation.pl"):
        text = (RULES / name).read_text(encoding="utf-8")
        for old, new in changes.items() if name == "highway.pl" else ():
            assert text.count(old) == 1
            text = text.replace(old, new)
        (folder / name).write_text(text, encoding="utf-8")
    return folder / "highway.pl"


def results(**wanted: object) -> dict[str, Result]:
    wanted = {"attack": 2000, **wanted}
    return {result.name: result for result in verify(Request(**wanted)).results}  # type: ignore[arg-type]  # each has its type


@pytest.mark.parametrize("case", [TWO_LANES, MIDDLE, Case(2, 1, 2, 1)], ids=str)
def test_the_default_rules_have_all_properties(case: Case) -> None:
    found = results(vehicles=2, cases=(case,))
    assert {name: result.reason for name, result in found.items() if result.status != "proved"} == {}


def test_enough_vehicles_are_known_for_every_property() -> None:
    found = results(vehicles=6, cases=())
    assert all(result.for_any_number for result in found.values())
    assert not all(result.for_any_number for result in results(vehicles=2, cases=()).values())


def test_the_hole_of_the_published_rules_is_found(tmp_path: Path) -> None:
    request = Request(rules=(RULES / "paper.pl",), vehicles=6, only=("nothing_hidden",), cases=(TWO_LANES,))
    (result,) = verify(request).results
    assert result.status == "refuted"
    found = result.counterexample
    assert found is not None
    assert len(found.scene.vehicles) == 2
    assert found.focus == found.scene.vehicles[1].id
    files = write_counterexample(request, result, tmp_path)
    assert [path.name for path in files] == [
        "nothing_hidden.json",
        "nothing_hidden.alone.json",
        "nothing_hidden.png",
    ]
    assert files[-1].read_bytes().startswith(b"\x89PNG")
    offered, alone = (
        [
            Shield.from_files(request.rules, tier=tier).decide(load_scene(path)).safe_actions
            for tier in ("interpreter", "numpy")
        ]
        for path in files[:2]
    )
    assert offered[0] == offered[1]
    assert set(offered[0]) - set(alone[0])


@pytest.mark.parametrize("kind", MUTANTS)
def test_seeded_bugs_are_found(tmp_path: Path, kind: str) -> None:
    name, changes = MUTANTS[kind]
    rules = mutated(tmp_path, changes)
    found = results(rules=(rules,), vehicles=2, only=(name,), cases=(Case(0, 2, 2, 2), TWO_LANES))
    assert found[name].status == "refuted", found[name].reason
    counterexample = found[name].counterexample
    assert counterexample is not None
    assert json.loads(json.dumps(counterexample.as_json()))["scene"]["ego"]


def test_a_scene_that_breaks_nothing_is_no_counterexample() -> None:
    book = load([RULES / "paper.pl"])
    replay = Replay(book.engine, next(one for one in book.properties if one.name == "nothing_hidden"))
    scene = load_scene(RULES.parent / "examples" / "scene.json")
    assert replay.breaks(scene, scene.vehicles[0].id) is None
    near = scene.ego._replace(id="near", lane=scene.ego.lane, x=scene.ego.x + 5.5)
    assert replay.breaks(replace(scene, vehicles=(near,)), "near") is None


def test_an_arithmetic_error_is_a_counterexample(tmp_path: Path) -> None:
    rules = tmp_path / "rules.pl"
    rules.write_text(
        ":- dynamic(vehicle/8).\n"
        "safe_actions(lane_keeping) :- vehicle(ego, _, _, _, V, _, _, _), 1.0 / V > 0.1.\n"
    )
    properties = tmp_path / "properties.pl"
    properties.write_text("property(fine, 'no errors'). violates(fine) :- safe_actions(A), A == other.")
    (result,) = verify(Request((rules,), (properties,), vehicles=0, cases=(TWO_LANES,))).results
    assert result.status == "refuted"
    assert result.counterexample is not None
    assert "zero" in str(result.counterexample.error)
    assert result.counterexample.scene.ego.vx == 0


def test_what_cannot_be_a_formula_is_unknown(tmp_path: Path) -> None:
    properties = tmp_path / "properties.pl"
    properties.write_text(
        "property(a, 'recursive'). violates(a) :- reach(1, X), X > 5.0. "
        "reach(N, X) :- vehicle(_, _, X0, _, _, _, _, _), ( X = X0 ; reach(N, X1), X is X1 + X0 ). "
        "property(b, 'undefined'). violates(b) :- hovercraft(1). "
        "property(c, 'too hard'). violates(c) :- vehicle(ego, _, X, _, V, _, L, W), "
        "sin(X) * V * V * V + L * W * W =:= atan(X) - 0.3, V > 60.0."
    )
    found = results(properties=(properties,), vehicles=0, cases=(TWO_LANES,), time_limit=1.0)
    assert {result.status for result in found.values()} == {"unknown"}
    assert "recurs" in found["a"].reason
    assert found["b"].reason == "the rules do not define hovercraft/1"
    assert found["c"].reason


def test_ranges_of_a_property_file_count(tmp_path: Path) -> None:
    properties = tmp_path / "properties.pl"
    text = "property(slow, 'slow'). violates(slow) :- vehicle(ego, _, _, _, V, _, _, _), abs(V) > 20.0. "
    properties.write_text(text)
    assert results(properties=(properties,), cases=(TWO_LANES,), vehicles=0)["slow"].status == "refuted"
    properties.write_text(text + "range(ego_speed, 0, 20).")
    assert results(properties=(properties,), cases=(TWO_LANES,), vehicles=0)["slow"].status == "proved"


def test_a_counterexample_keeps_to_the_ranges(tmp_path: Path) -> None:
    properties = tmp_path / "properties.pl"
    properties.write_text(
        "property(none, 'no vehicle ahead'). range(speed, 5.125, 9.375). range(lateral_speed, 0.5, 1). "
        "range(length, 3.3, 3.4). violates(none) :- vehicle(Id, _, X, _, _, _, _, _), Id \\== ego, X > 7.0."
    )
    for case in (TWO_LANES, Case(2, 0, 1, 1)):
        found = results(properties=(properties,), cases=(case,), vehicles=1)["none"].counterexample
        assert found is not None
        (car,) = found.scene.vehicles
        sign = case.direction(case.ego_lane).sign
        assert 5.125 <= sign * car.vx <= 9.375
        assert 0.5 <= sign * car.vy <= 1
        assert 3.3 <= car.length <= 3.4


def test_all_cases_are_roads_with_the_ego_on_them() -> None:
    cases = all_cases()
    assert len(cases) == len(set(cases))
    for case in cases:
        assert case.direction(case.ego_lane) is case.direction(case.target_lane)
        assert abs(case.ego_lane - case.target_lane) <= 1


def test_the_result_is_the_same_for_any_number_of_processes() -> None:
    cases = tuple(case for case in all_cases() if (case.leftward, case.rightward) == (0, 2))
    found = [
        results(rules=(RULES / "paper.pl",), only=("nothing_hidden",), cases=cases, crew=Crew(jobs))
        for jobs in (1, 2, 3)
    ]
    assert found[0]["nothing_hidden"].status == "refuted"
    told = [{**one["nothing_hidden"].as_json(), "seconds": 0} for one in found]
    assert told[0] == told[1] == told[2]


@pytest.mark.slow
def test_several_processes_prove_everything_for_six_vehicles() -> None:
    report = verify(Request(vehicles=6, crew=Crew(2)))
    assert [result.name for result in report.results if result.status != "proved"] == []
    assert all(result.for_any_number for result in report.results)
