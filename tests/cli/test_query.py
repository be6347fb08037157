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
    assert set(data) == {"safe_actions", "unsafe_actions", "target_speed", "observation", "sections"}
    assert set(data["safe_actions"]) | set(data["unsafe_actions"]) == ACTIONS
    assert data["safe_actions"] == ["lane_keeping", "right_lane_change"]
    (objection,) = data["unsafe_actions"]["left_lane_change"]
    assert objection["vehicle"] == "sports_car"
    assert objection["gap"] == pytest.approx(33.4)
    assert objection["needed"] > objection["gap"]
    assert 0 < data["target_speed"] < 29.5
    assert len(data["observation"]) == 10
    assert data["sections"]["front"]["vehicle"] == "truck"
    assert data["sections"]["left"] is None


def test_the_answer_for_people(capsys: pytest.CaptureFixture[str]) -> None:
    text = answer(capsys)
    assert "left_lane_change   sports_car is 33.4 m away, 89.5 m needed" in text
    assert "front        truck, 47.5 m" in text


def test_the_readme_shows_what_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    shown = "\n".join(f"    {line}" if line else "" for line in answer(capsys).rstrip().split("\n"))
    assert shown in (ROOT / "README.md").read_text(encoding="utf-8")


def test_goals(capsys: pytest.CaptureFixture[str]) -> None:
    assert answer(capsys, "--goal", "front_is_busy") == "true.\n"
    assert answer(capsys, "--goal", "left_is_safe") == "false.\n"
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
        (["query", "--state", SCENE, "--goal", "repeat, fail"], "gave up on repeat, fail"),
        (["query", "--state", SCENE, "--rules", "none.pl"], "none.pl"),
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
