"""`drlsl query` as its users meet it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from drlsl.cli import run

ROOT = Path(__file__).parents[2]
SCENE = str(ROOT / "examples" / "scene.json")
ACTIONS = {"lane_keeping", "left_lane_change", "right_lane_change"}


def answer(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert run(["query", "--state", SCENE, *arguments]) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    return printed.out


def refusal(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert run(arguments) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert printed.err.startswith("drlsl: ")
    return printed.err


def test_the_answer_for_machines(capsys: pytest.CaptureFixture[str]) -> None:
    data: dict[str, Any] = json.loads(answer(capsys, "--json"))
    assert set(data) == {
        "safe_actions",
        "unsafe_actions",
        "target_speed",
        "comfortable_acceleration",
        "observation",
        "observation_names",
        "sections",
    }
    assert set(data["safe_actions"]) | set(data["unsafe_actions"]) == ACTIONS
    assert data["safe_actions"] == ["lane_keeping", "right_lane_change"]
    (objection,) = data["unsafe_actions"]["left_lane_change"]
    assert objection["vehicle"] == "sports_car"
    assert objection["gap"] == pytest.approx(33.4)
    assert objection["needed"] > objection["gap"]
    assert objection["missing"] == pytest.approx(objection["needed"] - objection["gap"])
    assert 0 < data["target_speed"] < 29.5
    assert -3.0 < data["comfortable_acceleration"] < -2.0
    assert len(data["observation"]) == len(data["observation_names"]) == 21
    assert data["sections"]["front"]["vehicle"] == "truck"
    assert data["sections"]["left"] is None


def test_the_answer_for_people(capsys: pytest.CaptureFixture[str]) -> None:
    text = answer(capsys)
    assert "left_lane_change   sports_car is 33.4 m away, 89.5 m needed: 56.1 m missing" in text
    assert "front        truck, 47.5 m" in text


def test_the_readme_shows_what_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    shown = "\n".join(f"    {line}" if line else "" for line in answer(capsys).rstrip().split("\n"))
    assert shown in (ROOT / "README.md").read_text(encoding="utf-8")


def test_explanations_name_who_decides_for_people(capsys: pytest.CaptureFixture[str]) -> None:
    lines = answer(capsys, "--explain").splitlines()
    assert [line for line in lines if line and not line.startswith(" ")] == [
        "lane_keeping is offered",
        "safe_actions(lane_keeping) holds",
        "left_lane_change is not offered: sports_car is 33.4 m away, 89.5 m needed: 56.1 m missing",
        "safe_actions(left_lane_change) fails",
        "right_lane_change is offered",
        "safe_actions(right_lane_change) holds",
        "target speed 29.49 m/s: truck decides it; without it 29.62 m/s",
        "longitudinal_velocity(Speed) holds with Speed = 29.488",
        "comfortable_acceleration(Acceleration) holds with Acceleration = -2.34236",
    ]


def test_explanations_name_who_decides_for_machines(capsys: pytest.CaptureFixture[str]) -> None:
    data = json.loads(answer(capsys, "--explain", "--json"))
    assert set(data) == {*ACTIONS, "target_speed", "comfortable_acceleration"}
    left = data["left_lane_change"]
    assert (left["offered"], left["holds"]) == (False, False)
    assert left["objections"][0]["vehicle"] == "sports_car"
    assert left["objections"][0]["missing"] == pytest.approx(56.143, abs=1e-3)
    assert left["steps"]
    assert data["lane_keeping"]["objections"] == []
    speed = data["target_speed"]
    assert speed["value"] == speed["bindings"]["Speed"] == pytest.approx(29.488)
    assert speed["decided_by"]["vehicle"] == "truck"
    assert speed["decided_by"]["without"] > speed["value"]
    comfort = data["comfortable_acceleration"]
    assert comfort["value"] == comfort["bindings"]["Acceleration"] < -2.0


@pytest.mark.parametrize("also", [[], ["--explain"], ["--json"], ["--goal", "front_is_busy"]])
@pytest.mark.parametrize(("ending", "start"), [("png", b"\x89PNG"), ("svg", b"<?xml")])
def test_pictures(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, also: list[str], ending: str, start: bytes
) -> None:
    path = tmp_path / f"decision.{ending}"
    assert answer(capsys, *also, "--picture", str(path)) == answer(capsys, *also)
    assert path.read_bytes().startswith(start)


def test_pictures_that_cannot_be(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    for name, expected in [
        ("decision.odt", "the name must end in ."),
        ("none/decision.png", "No such file"),
    ]:
        assert expected in refusal(capsys, "query", "--state", SCENE, "--picture", str(tmp_path / name))
    assert not list(tmp_path.iterdir())


def test_goals(capsys: pytest.CaptureFixture[str]) -> None:
    assert answer(capsys, "--goal", "front_is_busy") == "true.\n"
    assert answer(capsys, "--goal", "front_is_free") == "false.\n"
    assert answer(capsys, "--goal", "side_lane(left, Lane)") == "Lane = 3\n"
    data = json.loads(answer(capsys, "--json", "--goal", "busy_section(S, Car, _), S = back_left"))
    assert data["solutions"] == [{"S": "back_left", "Car": "sports_car"}]


def test_another_program(capsys: pytest.CaptureFixture[str]) -> None:
    data = json.loads(answer(capsys, "--json", "--rules", str(ROOT / "rules" / "paper.pl")))
    assert set(data["safe_actions"]) == ACTIONS


def test_more_files_than_one(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "mine.pl").write_text("mine(Car) :- busy_section(front, Car, _).\n")
    rules = ["--rules", str(ROOT / "rules" / "highway.pl"), "--rules", str(tmp_path / "mine.pl")]
    assert answer(capsys, *rules, "--goal", "mine(Car)") == "Car = truck\n"


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["query"], "--state"),
        (["query", "--state", "none.json"], "none.json"),
        (["query", "--state", SCENE, "--colour"], "--colour"),
        (["query", "--state", SCENE, "--goal", "front_is("], "query:1:"),
        (["query", "--state", SCENE, "--goal", "front_is_bussy"], "front_is_busy/0"),
        (["query", "--state", SCENE, "--goal", "X is 1 / 0"], "zero_divisor"),
        (
            ["query", "--state", SCENE, "--goal", "repeat, fail"],
            "gave up on repeat, fail: it went beyond 2,000,000 inferences",
        ),
        (["query", "--state", SCENE, "--rules", "none.pl"], "none.pl"),
        (["query", "--state", SCENE, "--explain", "--goal", "true"], "--goal and --explain print different"),
        (["query", "--state", SCENE, "--explain", "--what-if"], "--explain and --what-if print different"),
        (["query", "--state", SCENE, "left_lane_change"], "the action left_lane_change goes with --what-if"),
        (["query", "--state", SCENE, "--out", "scenes"], "--out goes with --what-if"),
        (["nothing"], "nothing"),
    ],
    ids=lambda value: " ".join(value[2:]) if isinstance(value, list) else "",
)
def test_bad_input_is_one_line_and_status_2(
    capsys: pytest.CaptureFixture[str], arguments: list[str], expected: str
) -> None:
    assert expected in refusal(capsys, *arguments)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("safe_actions(lane_keeping).\n", "does not define front_is_free/0"),
        ("front_is_free.\n", "does not define safe_actions/1"),
        ("safe_actions(lane_keeping.\n", "rules.pl:1:"),
        (":- include('nowhere.pl').\n", "nowhere.pl"),
    ],
)
def test_programs_that_cannot_be_used(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, text: str, expected: str
) -> None:
    (tmp_path / "rules.pl").write_text(text)
    assert expected in refusal(capsys, "query", "--state", SCENE, "--rules", str(tmp_path / "rules.pl"))


def test_an_action_that_the_agent_does_not_know(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "rules.pl").write_text(
        "safe_actions(lane_change).\nfront_is_free.\nlongitudinal_velocity(20.0).\nentry_is_safe.\n"
        "state([0, 0, 0, 0, 0, 0, 0, 0, 0, 0]).\n"
    )
    message = refusal(capsys, "query", "--state", SCENE, "--rules", str(tmp_path / "rules.pl"))
    assert "'lane_change', which the agent does not know" in message


@pytest.mark.parametrize(
    ("goal", "expected"),
    [
        ("X is 10 ^ 5000", "1" + "0" * 5000),
        ("X = f(Y, Z), Z is 10 ^ 5000", None),
        ("X is 2 ^ 100", 2**100),
    ],
)
def test_long_numbers_are_printed(goal: str, expected: object, capsys: pytest.CaptureFixture[str]) -> None:
    (solution,) = json.loads(answer(capsys, "--goal", goal, "--json"))["solutions"]
    assert solution["X"] == expected or (expected is None and solution["X"].startswith("f("))
    assert answer(capsys, "--goal", goal).startswith("X = ")


def test_infinity_in_an_answer_is_valid_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rules = tmp_path / "far.pl"
    rules.write_text(
        ":- ensure_loaded('highway.pl').\n:- set_prolog_flag(iso, false).\nfar(X) :- X is inf.\n"
    )
    text = answer(capsys, "--rules", str(rules), "--goal", "far(X)", "--json")
    assert json.loads(text, parse_constant=lambda name: pytest.fail(name))["solutions"] == [{"X": "inf"}]


def scene_file(tmp_path: Path, change: str) -> str:
    text = Path(SCENE).read_text(encoding="utf-8")
    assert '"sports_car"' in text
    path = tmp_path / "scene.json"
    path.write_text(text.replace('"sports_car"', change), encoding="utf-8")
    return str(path)


def test_control_characters_in_a_name_are_printed_escaped(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    state = scene_file(tmp_path, r'"red\u001b[31m\ncar"')
    for options in ([], ["--explain"], ["--goal", "busy_section(S, Car, _)"]):
        assert run(["query", "--state", state, *options]) == 0
        out = capsys.readouterr().out
        assert "\x1b" not in out
        assert "red\\x1b" in out
    assert run(["query", "--state", state, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["sections"]["back_left"]["vehicle"] == "red\x1b[31m\ncar"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ('"a", "id": "b"', 'the key "id" is given 2 times'),
        ("7" * 5000, "an integer of 5000 digits"),
        ('"van\\n\\u001b[2J"', "vehicles has 'van\\n\\x1b[2J' 2 times"),
    ],
)
def test_a_scene_that_readers_take_differently_is_one_line(
    change: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    state = scene_file(tmp_path, change)
    if "van" in change:
        path = Path(state)
        path.write_text(path.read_text(encoding="utf-8").replace('"van"', change), encoding="utf-8")
    assert message in refusal(capsys, "query", "--state", state)
