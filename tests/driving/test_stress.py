"""Driving under stress: what is counted, and that the shield holds."""

from __future__ import annotations

from pathlib import Path

import pytest

from drlsl.cli import run
from drlsl.driving.config import EnvConfig
from drlsl.driving.scene_file import load_scene
from drlsl.driving.shield import Shield
from drlsl.driving.stress import POLICIES, StressReport, stress
from drlsl.traffic.load import load_recording
from drlsl.traffic.recording import Recording
from tests.driving.recordings import Drive, recording

ROOT = Path(__file__).parents[2]
BLIND = """
safe_actions(lane_keeping).  safe_actions(left_lane_change).  safe_actions(right_lane_change).
front_is_free.  longitudinal_velocity(30.0).  state([0, 0, 0, 0, 0, 0, 0, 0, 0, 0]).  entry_is_safe.
"""


def run_stress(made: Recording, shield: Shield, policy: str, episodes: int) -> StressReport:
    report = StressReport()
    config = EnvConfig(recording="by-hand")
    for report in stress(config, [made], shield, POLICIES[policy], episodes=episodes, seed=1, egos=8):  # noqa: B007
        pass
    return report


@pytest.mark.parametrize("policy", POLICIES)
@pytest.mark.parametrize("name", ["highway-test", "freeway"])
def test_the_shield_holds(name: str, policy: str) -> None:
    report = run_stress(load_recording(name), Shield.default(tier="auto"), policy, 12)
    assert report.episodes == 12
    assert report.steps > 1000
    assert report.off_road == report.contacts_at_fault == report.fail_safe == 0


def test_what_a_blind_program_does_is_counted(tmp_path: Path) -> None:
    (tmp_path / "blind.pl").write_text(BLIND)
    made = recording([Drive(lane, x, 20.0) for lane in range(1, 6) for x in range(0, 420, 60)], frames=100)
    report = run_stress(made, Shield.from_files([tmp_path / "blind.pl"], tier="auto"), "always-change", 20)
    assert report.off_road + report.contacts_at_fault > 0
    assert report.lane_changes > 0
    assert report.contacts_at_fault + report.contacts_not_at_fault == report.contacts.total()
    assert report.off_road + report.contacts.total() <= report.episodes == 20
    kept = [record.verdict == "at_fault" for record in report.worst]
    assert kept == sorted(kept, reverse=True)


def test_worst_contacts_become_scenes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "blind.pl").write_text(BLIND)
    out = tmp_path / "worst"
    arguments = [
        "stress",
        "freeway",
        "--episodes",
        "6",
        "--rules",
        str(tmp_path / "blind.pl"),
        "--out",
        str(out),
    ]
    assert run(arguments) == 0
    assert "contacts at fault" in capsys.readouterr().out
    scenes = list(out.glob("*.json"))
    assert scenes
    for path in scenes:
        assert load_scene(path).vehicles
    assert run(arguments) == 2
    assert "exists" in capsys.readouterr().err
