"""Tables of scenes: those that ship pass on every tier; how they are read; what bad ones are told."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drlsl.assurance import DrivingRules, load_table, run_cases, tables_of
from drlsl.assurance.case_rows import EgoRow, RoadRow, VehicleRow, scene_of
from drlsl.driving.scene import Scene
from drlsl.driving.shield import Shield
from drlsl.errors import UserError
from drlsl.traffic import Direction
from tests.assurance.evidence import RULES, table_cases

NAMES = Shield.default().observation.names


@pytest.mark.parametrize("program", ["highway.pl", "paper.pl"])
def test_the_rules_that_ship_pass_their_tables_on_every_tier(program: str) -> None:
    cases = table_cases(RULES / program)
    outcome = run_cases(DrivingRules.of([RULES / program]), cases)
    assert outcome.failures == []
    assert outcome.notes == []
    assert len(cases) > 100
    assert outcome.answers["scalar"] == sum(len(case.checks) for case in cases)
    assert outcome.answers["numpy"] > 100


@pytest.mark.slow
@pytest.mark.parametrize("program", ["highway.pl", "paper.pl"])
@pytest.mark.parametrize("tier", ["numba", "torch"])
def test_they_pass_on_the_other_array_tiers(program: str, tier: str) -> None:
    pytest.importorskip(tier, reason=f"the extra for {tier} is not installed")
    outcome = run_cases(DrivingRules.of([RULES / program]), table_cases(RULES / program), [tier])
    assert (outcome.failures, outcome.notes) == ([], [])
    assert outcome.answers[tier] > 100


def test_tables_beside_rules(tmp_path: Path) -> None:
    for name in ("mine.test.yaml", "mine.speed.test.yaml", "mine2.test.yaml", "mine.mutants.yaml"):
        (tmp_path / name).write_text("")
    found = tables_of([tmp_path / "mine.pl"])
    assert [path.name for path in found] == ["mine.speed.test.yaml", "mine.test.yaml"]


def table(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "t.test.yaml"
    path.write_text(text)
    return path


WRONG = """
ego: {lane: 1}
scenes:
  - scene: nobody else
    rows:
      - {actions: [keep, left, right]}
      - {row: too fast, target_speed: 99.0, goals: {settled: false, "lane(ego, L)": {L: 7}}}
      - {fails: no action}
      - {sections: {front: a}, observation: {lane: 0.25}, entry_is_safe: false, lane_to_keep: left}
      - {goals: {no_such_goal(X): {X: 1}, "lane(ego": true}, objections: {right: []}}
"""


def test_wrong_answers_are_told_with_line_expectation_and_answer(tmp_path: Path) -> None:
    path = table(tmp_path, WRONG)
    outcome = run_cases(DrivingRules(Shield.default()), load_table(path, NAMES))
    told = {(failure.place, failure.case, failure.what): failure for failure in outcome.failures}
    actions = told[f"{path}:6", "nobody else (left_to_right)", "actions"]
    assert actions.problem == (
        "expected lane_keeping, left_lane_change, right_lane_change, got lane_keeping, left_lane_change"
    )
    assert actions.tiers == ("interpreter", "scalar", "numpy")
    fast = "nobody else / too fast (right_to_left)"
    assert told[f"{path}:7", fast, "target_speed"].problem == "expected 99, got 20.12"
    assert told[f"{path}:7", fast, "settled"].problem == "expected false, got true"
    assert told[f"{path}:7", fast, "lane(ego, L)"].problem == "expected L = 7, got L = 1"
    assert told[f"{path}:8", "nobody else (left_to_right)", "decision"].problem == (
        "expected the failure 'no action', got a decision"
    )
    last = {what: failure.problem for (place, _, what), failure in told.items() if place == f"{path}:9"}
    assert last == {
        "sections": "expected front a, got front free",
        "front_is_busy": "expected true, got false",
        "front_is_free": "expected false, got true",
        "observation": "expected lane 0.25, got lane 0",
        "entry_is_safe": "expected false, got true",
        "lane_to_keep": last["lane_to_keep"],
    }
    unknown = told[f"{path}:10", "nobody else (left_to_right)", "no_such_goal(X)"]
    assert (
        "got an error: unknown procedure no_such_goal/1" in unknown.problem or "procedure" in unknown.problem
    )
    assert "got an error: " in told[f"{path}:10", "nobody else (left_to_right)", "lane(ego"].problem
    assert told[f"{path}:10", "nobody else (left_to_right)", "objections right"].problem == (
        "expected none, got no_lane"
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "scenes: expected a list of scenes"),
        ("scenes: 1", ":1: scenes: expected a list of scenes"),
        ("scenes: []", ":1: scenes: expected a list of scenes"),
        ("scene: []", ":1: scene is not a key of a table; expected scenes"),
        ("scenes:\n  - scene: a\n    actions: [keep]\n  - scene: b\n", ":4: b: expects nothing"),
        (
            "scenes:\n  - scene: a\n    actions: [keep, up]\n",
            ":3: actions.1: input should be 'keep', 'left' or",
        ),
        ("scenes:\n  - actions: [keep]\n", ":2: scene is missing"),
        (
            "scenes:\n  - scene: a\n    observation: {front: 1, fornt: 0}",
            ":3: observation.fornt: the rules observe front, front_right, ",
        ),
        (
            "scenes:\n  - scene: a\n    ego: {lane: 1, sped: 3}\n    actions: []",
            ":3: ego.sped is not a key of a table",
        ),
        ("scenes:\n  - scene: a\n    ego: {lane: 4}\n    actions: []", ":2: a: the road has no lane 4 here"),
        (
            "scenes:\n  - scene: a\n    actions: []\n    vehicles:\n      b: {speed: fast, ahead: 1.0}",
            ":5: vehicles.b.speed: input should be a valid number, got 'fast'",
        ),
        (
            "scenes:\n  - scene: a\n    actions: []\n    rows:\n      - {}\n      - {vehicles: {b: {}}}",
            ":6: vehicles.b: expected one of ahead, behind",
        ),
        (
            "scenes:\n  - scene: a\n    actions: []\n    vehicles: {ego: {ahead: 1.0}}",
            ":4: vehicles: 'ego' is the ego's",
        ),
        ("scenes:\n  - scene: a\n    scene: b\n", ":3:5: key 'scenes.scene' is given twice"),
        ("scenes:\n  - {scene: a, goals: {f(A, B): {A: 1}}}\n", ":2: goals: f\\(A has no answer; .*quotes"),
        ("scenes: [", "not valid YAML"),
    ],
)
def test_bad_tables_are_refused_with_file_line_and_reason(tmp_path: Path, text: str, message: str) -> None:
    path = table(tmp_path, text)
    with pytest.raises(UserError, match=message) as error:
        load_table(path, NAMES)
    assert str(error.value).startswith(str(path))


def test_a_table_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="cannot read"):
        load_table(tmp_path / "none.yaml", NAMES)
    (tmp_path / "bytes.yaml").write_bytes(b"\xff\xfe")
    with pytest.raises(UserError, match="not UTF-8"):
        load_table(tmp_path / "bytes.yaml", NAMES)


def test_rows_are_laid_over_scenes_and_scenes_over_the_file(tmp_path: Path) -> None:
    path = table(
        tmp_path,
        """
road: {lanes: 2}
ego: {lane: 2, speed: 10.0}
scenes:
  - scene: s
    ego: {speed: 12.0}
    vehicles: {a: {lane: right, ahead: 5.0}, b: {lane: own, behind: 7.0, speed: 3.0}}
    actions: [keep]
    rows:
      - {vehicles: {a: {behind: 9.0}, b: null}, directions: left_to_right}
""",
    )
    (case,) = load_table(path, NAMES)
    scene = case.state
    assert case.place == f"{path}:10"
    assert len(scene.road.lanes) == 2
    assert (scene.ego.lane, scene.ego.vx) == (1, 12.0)
    (car,) = scene.vehicles
    assert (car.id, car.lane, car.x - scene.ego.x) == ("a", 2, -9.0 - 4.5)


def laid_out(direction: Direction, **car: object) -> Scene:
    vehicles = {"a": VehicleRow.model_validate(car)}
    return scene_of(RoadRow(lanes=3, oncoming=2), EgoRow(lane=2), vehicles, direction)


@pytest.mark.parametrize("direction", Direction)
def test_left_right_ahead_and_behind_are_those_of_the_driver(direction: Direction) -> None:
    sign = direction.sign
    for word, number, step in (("left", 3, -1), ("right", 1, 1), ("own", 2, 0)):
        named = laid_out(direction, lane=word, ahead=10.0, shift=0.5, drift=0.25)
        assert named == laid_out(direction, lane=number, ahead=10.0, shift=0.5, drift=0.25)
        ego, (car,) = named.ego, named.vehicles
        assert car.lane - ego.lane == step * sign
        assert sign * (car.x - ego.x) == 14.5
        assert sign * (car.y - ego.y) == step * 3.5 - 0.5
        assert (sign * car.vx, sign * car.vy) == (20.0, -0.25)
    (oncoming,) = laid_out(direction, lane=-1, behind=10.0, speed=30.0).vehicles
    assert sign * (oncoming.x - 256.0) == -14.5
    assert sign * oncoming.vx == -30.0
    assert sign * (oncoming.y - named.ego.y) == -(1.75 + 3.5 + 2.0 + 1.75)
    lane = named.road.lane(oncoming.lane)
    assert lane is not None
    assert lane.direction is not direction


@given(
    lanes=st.integers(1, 4),
    oncoming=st.integers(0, 3),
    width=st.sampled_from([3.0, 3.5]),
    direction=st.sampled_from(Direction),
)
def test_lanes_are_numbered_from_the_top_and_touch(
    lanes: int, oncoming: int, width: float, direction: Direction
) -> None:
    road = scene_of(RoadRow(lanes=lanes, oncoming=oncoming, lane_width=width), EgoRow(), {}, direction).road
    assert [lane.id for lane in road.lanes] == list(range(1, lanes + oncoming + 1))
    assert len(road.lanes_of(direction)) == lanes
    centres = [lane.centre for lane in road.lanes]
    assert centres == sorted(centres)
    steps = [below - above for above, below in pairwise(centres)]
    assert sorted(set(steps)) in ([], [width], [width + 2.0], [width, width + 2.0])
    assert all(math.isfinite(centre) and centre > 0 for centre in centres)
