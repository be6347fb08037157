"""A vehicle that comes the other way in the ego's carriageway, as the users of `drlsl query` meet it."""

from __future__ import annotations

import itertools
import json
from importlib.util import find_spec
from pathlib import Path

import pytest

from drlsl.cli import run
from drlsl.driving.scene import Action, SceneBatch, load_scene
from drlsl.driving.shield import Shield, default_rules
from tests.installed import needs_torch

RULES = default_rules()[0].parent
PROGRAMS = ["highway.pl", "un_r157.pl", "follower_brakes.pl", "overtake_left.pl"]
NEEDED = 247.634583
"""Of 30 m/s and 40 m/s [m]: 91.026 m and 154.609 m until each stands, and 2 m."""


def scene_file(folder: Path, lane: int, speed: float, gap: float = 95.0) -> str:
    """The ego at 30 m/s in the middle one of three lanes, and one vehicle ahead of it."""
    lanes = [
        {
            "id": number,
            "direction": "left_to_right",
            "centre_m": 3.5 * number,
            "width_m": 3.5,
            "speed_limit_mps": 36.0,
        }
        for number in (1, 2, 3)
    ]
    size = {"length_m": 4.5, "width_m": 2.0}
    scene = {
        "road": {"lanes": lanes, "time_step_s": 0.04, "radar_range_m": 100.0},
        "ego": {"x_m": 100.0, "y_m": 7.0, "vx_mps": 30.0, **size},
        "vehicles": [{"id": "stray", "x_m": 104.5 + gap, "y_m": 3.5 * lane, "vx_mps": speed, **size}],
    }
    path = folder / "scene.json"
    path.write_text(json.dumps(scene), encoding="utf-8")
    return str(path)


def asked(capsys: pytest.CaptureFixture[str], state: str, *arguments: str) -> str:
    assert run(["query", "--state", state, *arguments]) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    return printed.out


@pytest.mark.parametrize(
    ("program", "tier"),
    [
        *itertools.product(PROGRAMS, ("interpreter", "scalar", "numpy")),
        ("highway.pl", "numba"),
        pytest.param("highway.pl", "torch", marks=needs_torch),
    ],
)
def test_every_tier_refuses_the_change_and_brakes(tmp_path: Path, program: str, tier: str) -> None:
    shield = Shield.from_files([RULES / program], tier=tier)
    left, own, right = (load_scene(scene_file(tmp_path, lane, -40.0)) for lane in (1, 2, 3))
    assert shield.decide(left).safe_actions == (Action.LANE_KEEPING, Action.RIGHT_LANE_CHANGE)
    assert shield.decide(right).safe_actions == (Action.LANE_KEEPING, Action.LEFT_LANE_CHANGE)
    assert shield.decide(left).target_speed == pytest.approx(30.12)
    assert shield.decide(own).target_speed == pytest.approx(30.0 - 8.0 * 0.04)
    assert set(shield.decide(own).safe_actions) == set(Action)
    batch = shield.decide_batch(SceneBatch.of([left]))
    assert batch.action_mask[0].tolist() == [True, False, True]
    assert batch.target_speed[0] == shield.decide(left).target_speed


def test_who_drives_away_may_be_followed(tmp_path: Path) -> None:
    assert len(Shield.default().decide(load_scene(scene_file(tmp_path, 1, 40.0))).safe_actions) == 3


@pytest.mark.parametrize("program", PROGRAMS)
def test_the_answer_for_machines(tmp_path: Path, capsys: pytest.CaptureFixture[str], program: str) -> None:
    rules = str(RULES / program)
    data = json.loads(asked(capsys, scene_file(tmp_path, 1, -40.0), "--rules", rules, "--json"))
    assert data["safe_actions"] == ["lane_keeping", "right_lane_change"]
    (objection,) = data["unsafe_actions"]["left_lane_change"]
    assert (objection["vehicle"], objection["gap"]) == ("stray", pytest.approx(95.0))
    assert objection["needed"] == pytest.approx(NEEDED)
    assert objection["missing"] == pytest.approx(NEEDED - 95.0)


def test_the_explanation_names_the_distance_for_opposite_directions(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = asked(capsys, scene_file(tmp_path, 1, -40.0), "--explain")
    assert "left_lane_change is not offered: stray is 95.0 m away, 247.6 m needed: 152.6 m missing" in text
    assert "opposite_distance(30.0,40.0,245.635)" in text


def test_the_picture_is_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "stray.png"
    asked(capsys, scene_file(tmp_path, 1, -40.0), "--picture", str(picture))
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.skipif(find_spec("z3") is None, reason="what-ifs need z3-solver, the extra verify")
def test_what_would_have_to_change(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = asked(capsys, scene_file(tmp_path, 1, -40.0), "--what-if", "left_lane_change")
    assert text.splitlines() == [
        "left_lane_change   is not offered; it would be if",
        "                     stray were 0.44 m further ahead, out of sight",
        "                     or stray drove 37.7 m/s slower, at 2.3 m/s",
    ]
