"""`drlsl query --what-if` as its users meet it."""

from __future__ import annotations

import json
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

import drlsl.cli.what_if
from drlsl.cli import run
from drlsl.driving.scene import load_scene, scene_json
from drlsl.driving.shield import default_rules

needs_z3 = pytest.mark.skipif(find_spec("z3") is None, reason="what-ifs need z3-solver, the extra verify")

RULES = default_rules()[0].parent
SCENE = str(RULES.parent / "examples" / "scene.json")
CHANGE = {"vehicle", "field", "change", "before", "after", "out_of_sight"}


def ask(capsys: pytest.CaptureFixture[str], *arguments: str, state: str = SCENE) -> str:
    assert run(["query", "--state", state, "--what-if", *arguments]) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    return printed.out


def refusal(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert run(["query", "--state", SCENE, "--what-if", *arguments]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    return printed.err


@needs_z3
def test_the_answer_for_people(capsys: pytest.CaptureFixture[str]) -> None:
    assert ask(capsys).splitlines() == [
        "lane_keeping       is offered; no change of one gap or speed would alter that",
        "left_lane_change   is not offered; it would be if",
        "                     sports_car were 44.7 m further ahead, past the ego, with a gap of 2.1 m",
        "                     or sports_car were 56.2 m further back, with a gap of 89.6 m",
        "                     or sports_car drove 9.2 m/s slower, at 29.0 m/s",
        "                     or the ego drove 12.6 m/s faster, at 42.1 m/s",
        "right_lane_change  is offered; it would not be if",
        "                     hatchback were 11.4 m further back, with a gap of 33.25 m",
        "                     or hatchback drove 3.2 m/s slower, at 27.0 m/s",
        "                     or the ego drove 2.1 m/s faster, at 31.6 m/s",
    ]


@needs_z3
def test_the_documentation_shows_what_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    shown = "".join(f"    {line}\n" for line in ask(capsys, "left_lane_change").splitlines())
    for page in ("docs/explain.md", "README.md"):
        assert shown in (RULES.parent / page).read_text(encoding="utf-8")


@needs_z3
def test_the_answer_for_machines(capsys: pytest.CaptureFixture[str]) -> None:
    data: dict[str, Any] = json.loads(ask(capsys, "--json"))
    assert list(data) == ["lane_keeping", "left_lane_change", "right_lane_change"]
    for one in data.values():
        assert set(one) == {"offered", "gap", "gap_without_passing", "speed", "ego_speed", "gaps"}
        for kind in ("gap", "speed", "ego_speed"):
            assert set(one[kind]) == {"status", "changes", "least", "reason"}
    (change,) = data["right_lane_change"]["ego_speed"]["changes"]
    assert set(change) == CHANGE
    assert change == {
        "vehicle": "ego",
        "field": "vx_mps",
        "change": 2.1,
        "before": 29.5,
        "after": 31.6,
        "out_of_sight": False,
    }
    assert data["lane_keeping"]["gap"] == {"status": "none", "changes": [], "least": None, "reason": ""}


@needs_z3
def test_changed_scenes_decide_otherwise(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out = tmp_path / "scenes"
    printed = ask(capsys, "right_lane_change", "left_lane_change", "--out", str(out))
    files = sorted(out.iterdir())
    assert [path.name for path in files] == [
        "left_lane_change.ego_speed.json",
        "left_lane_change.gap.json",
        "left_lane_change.gap_without_passing.json",
        "left_lane_change.speed.json",
        "right_lane_change.ego_speed.json",
        "right_lane_change.gap.json",
        "right_lane_change.speed.json",
    ]
    assert all(f"wrote {path}" in printed for path in files)
    for path in files:
        assert run(["query", "--state", str(path), "--json"]) == 0
        actions = json.loads(capsys.readouterr().out)["safe_actions"]
        name = path.name.split(".")[0]
        assert (name in actions) == (name == "left_lane_change")
        before, after = load_scene(SCENE), load_scene(path)
        pairs = zip((before.ego, *before.vehicles), (after.ego, *after.vehicles), strict=True)
        assert sum(one != other for one, other in pairs) == 1
    assert "exists; name a new folder" in refusal(capsys, "--out", str(out))


def altered(tmp_path: Path, **changes: tuple[float, float, float]) -> str:
    """The example with vehicles at another x, y and vx."""
    scene = load_scene(SCENE)
    cars = []
    for car in scene.vehicles:
        x, y, vx = changes.get(car.id, (car.x, car.y, car.vx))
        cars.append(car._replace(lane=scene.road.lane_at(y), x=x, y=y, vx=vx))
    path = tmp_path / "scene.json"
    path.write_text(scene_json(type(scene)(scene.road, scene.ego, tuple(cars), scene.target_lane)))
    return str(path)


@needs_z3
def test_two_that_object_and_no_lane(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    state = altered(tmp_path, van=(150.0, 12.4, 25.0), sports_car=(150.0 - 30.0, 12.5, 38.2))
    text = ask(capsys, "left_lane_change", state=state)
    assert "left_lane_change   is not offered" in text
    both = altered(tmp_path, van=(195.0, 12.4, 25.0))
    lines = ask(capsys, "left_lane_change", state=both).splitlines()
    assert lines[0] == "left_lane_change   is not offered; no change of one gap or speed would alter that"
    assert lines[1].strip() == "it would be if"
    assert lines[2].strip().startswith("sports_car were ")
    assert lines[3].strip().startswith("and van were ")
    assert lines[4].endswith(" m in all")

    edge = load_scene(SCENE)
    lane = edge.road.lanes[-1]
    ego = edge.ego._replace(y=lane.centre, lane=lane.id)
    path = tmp_path / "edge.json"
    path.write_text(scene_json(type(edge)(edge.road, ego, edge.vehicles, lane.id)))
    assert ask(capsys, "right_lane_change", state=str(path)) == (
        "right_lane_change  is not offered (no lane); "
        "no change of one gap or speed, or of several gaps, would alter that\n"
    )


@needs_z3
def test_what_is_not_known_is_said(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    rules = tmp_path / "mine.pl"
    rules.write_text(
        "front_is_free. longitudinal_velocity(20.0). entry_is_safe. state([0, 0, 0, 0, 0, 0, 0, 0, 0, 0]).\n"
        "safe_actions(lane_keeping).\n"
        "safe_actions(left_lane_change) :- vehicle(truck, _, X, _, _, _, _, _), 0 is truncate(X) mod 7.\n"
    )
    text = ask(capsys, "--rules", str(rules), "left_lane_change")
    assert "unknown for one vehicle elsewhere: the solver finds a change of" in text


@needs_z3
@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["overtake"], "there is no action overtake; there are lane_keeping, left_lane_change, right_"),
        (["--time-limit", "0"], "--time-limit"),
        (["--rules", "none.pl"], "none.pl"),
    ],
)
def test_bad_calls(capsys: pytest.CaptureFixture[str], arguments: list[str], expected: str) -> None:
    assert expected in refusal(capsys, *arguments)


@needs_z3
def test_rules_that_cannot_be_lowered(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "mine.pl"
    path.write_text(
        "front_is_free. longitudinal_velocity(20.0). entry_is_safe. state([0, 0, 0, 0, 0, 0, 0, 0, 0, 0]).\n"
        "safe_actions(lane_keeping) :- assertz(seen).\n"
    )
    message = refusal(capsys, "--rules", str(path))
    assert "a what-if needs rules that can be lowered" in message
    assert "mine.pl:2" in message


def test_without_z3_one_line_says_what_to_install(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(drlsl.cli.what_if, "find_spec", lambda name: None)
    assert refusal(capsys) == "drlsl: a what-if needs z3-solver: pip install 'drlsl[verify]'\n"


def test_a_query_loads_the_solver_only_when_it_is_asked_for() -> None:
    script = (
        "from drlsl.cli import run; import sys; "
        f"assert run(['query', '--state', {SCENE!r}, '--explain']) == 0; "
        "assert not {'z3', 'torch', 'matplotlib', 'numpy'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", script], check=True, capture_output=True)
