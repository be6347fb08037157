"""Driving under stress: what is counted, and that the shield holds."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from drlsl.benchmarks import random_scenes
from drlsl.cli import run
from drlsl.driving import POLICIES, EnvConfig, StressReport, stress, stress_test
from drlsl.driving.drivers import DRIVERS, Driver, Situations, make_driver
from drlsl.driving.scene import Scene, SceneBatch, load_scene
from drlsl.driving.shield import Shield
from drlsl.driving.stress_test import MARGIN_HORIZON, margins
from drlsl.traffic import Recording, load_recording
from tests.driving.recordings import Drive, recording

ROOT = Path(__file__).parents[2]
BLIND = """
safe_actions(lane_keeping).  safe_actions(left_lane_change).  safe_actions(right_lane_change).
front_is_free.  longitudinal_velocity(30.0).  state([0, 0, 0, 0, 0, 0, 0, 0, 0, 0]).  entry_is_safe.
"""


def run_stress(
    made: Recording,
    shield: Shield,
    policies: list[str],
    episodes: int,
    drivers: Mapping[str, Driver] | None = None,
    egos: int = 8,
    **settings: object,
) -> StressReport:
    report = StressReport()
    config = EnvConfig(recording="by-hand", **settings)
    for report in stress(  # noqa: B007
        config, [made], shield, policies, episodes=episodes, seed=1, egos=egos, drivers=drivers
    ):
        pass
    return report


@pytest.mark.parametrize("policy", POLICIES)
@pytest.mark.parametrize("name", ["highway-test", "freeway"])
def test_the_shield_holds(name: str, policy: str) -> None:
    counts = run_stress(load_recording(name), Shield.default(tier="auto"), [policy], 12).total
    assert counts.episodes == 12
    assert counts.steps > 1000
    assert counts.off_road == counts.contacts_at_fault == counts.fail_safe == 0


def test_what_a_blind_program_does_is_counted(tmp_path: Path) -> None:
    (tmp_path / "blind.pl").write_text(BLIND)
    drives = [Drive(lane, x, 12.0 + 2.0 * lane) for lane in range(1, 6) for x in range(0, 420, 60)]
    made = recording(drives, frames=100)
    report = run_stress(made, Shield.from_files([tmp_path / "blind.pl"], tier="auto"), list(POLICIES), 30)
    counts = report.total
    assert counts.off_road + counts.contacts_at_fault > 0
    assert counts.lane_changes > 0
    assert counts.contacts_at_fault + counts.contacts_not_at_fault == counts.contacts.total()
    assert counts.off_road + counts.contacts.total() <= counts.episodes == 30
    assert [one.episodes for one in report.policies.values()] == [10, 10, 10]
    kept = [(record.verdict != "at_fault", -record.closing_speed) for record in report.worst]
    assert kept == sorted(kept)
    assert len({speed for _, speed in kept}) > 1
    for record in report.worst:
        ego, other = (
            record.scene.ego,
            next(one for one in record.scene.vehicles if one.id == f"v{record.vehicle}"),
        )
        assert record.closing_speed == pytest.approx(abs(ego.vx - other.vx))
        assert abs(ego.x - other.x) < (ego.length + other.length) / 2


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


def test_an_episode_is_a_function_of_its_seed_and_number() -> None:
    made, shield = load_recording("highway-test"), Shield.default(tier="auto")
    few, many = (
        run_stress(made, shield, list(POLICIES), 12, egos=egos, track_length=400.0) for egos in (2, 12)
    )
    assert few.policies["random"].lane_changes > 0
    assert few == many


@pytest.mark.parametrize("more", [["--offers", "all"], ["--driver", "mobil", "--decision-period", "1"]])
def test_blocks_of_episodes_add_up_for_any_number_of_processes(
    more: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    told = []
    for block, jobs in ((12, 1), (5, 1), (5, 2)):
        monkeypatch.setattr(stress_test, "BLOCK", block)
        assert run(["stress", "freeway", "--episodes", "12", "--json", "--jobs", str(jobs), *more]) == 0
        told.append(json.loads(capsys.readouterr().out))
    assert told[0]["episodes"] == 12
    assert told[0] == told[1] == told[2]


@pytest.mark.parametrize("offers", ["prediction", "all"])
def test_each_shield_says_what_is_offered(offers: str) -> None:
    made = load_recording("highway-test")
    counts = run_stress(
        made, Shield.default(tier="auto"), ["random"], 8, offers=offers, track_length=200.0
    ).total
    assert (counts.off_road > 0) == (offers == "all")
    assert counts.lane_changes > 0


def margin_of(scene: Scene, target: float) -> float:
    """The margin of an action that leads to `target`, vehicle by vehicle."""
    ego, found = scene.ego, math.inf
    sign = 1 if ego.vx > 0 else -1
    for car in scene.in_range():
        if abs(car.y - target) >= (car.width + ego.width) / 2:
            continue
        length = (car.length + ego.length) / 2
        speeds = max(sign * car.vx, 0.0), max(sign * ego.vx, 0.0)
        now = sign * (car.x - ego.x)
        later = now + (speeds[0] - speeds[1]) * MARGIN_HORIZON
        gap = -length if (now > 0) != (later > 0) else min(abs(now), abs(later)) - length
        found = min(found, gap / max(speeds[1] if now > 0 else speeds[0], 1.0))
    return found


# The oracle tries out what it chooses, which takes a second at every frame.
@pytest.mark.parametrize(
    ("name", "period"),
    [(name, None) for name in DRIVERS if name != "oracle"] + [(name, 1.0) for name in DRIVERS],
)
def test_the_shield_holds_for_drivers(name: str, period: float | None) -> None:
    driver = {name: make_driver(name, {"horizon": 8.0} if name == "oracle" else None)}
    made = load_recording("overtake-test")
    counts = run_stress(made, Shield.default(tier="auto"), [], 8, driver, decision_period=period).total
    assert counts.episodes == 8
    assert counts.off_road == counts.contacts_at_fault == counts.fail_safe == 0
    assert (counts.lane_changes == 0) == (name == "keep")


class Watching:
    """Keeps the lane, and remembers what it was shown."""

    window = 3

    def __init__(self) -> None:
        self.seen: list[np.ndarray] = []

    def preferences(self, situations: Situations) -> np.ndarray:
        self.seen.append(situations.observations)
        return np.tile([1.0, 0.0, 0.0], (len(situations.offered), 1))


def test_a_driver_is_shown_its_window_of_observations() -> None:
    driver = Watching()
    made = load_recording("highway-test")
    run_stress(made, Shield.default(tier="auto"), [], 4, {"watching": driver}, egos=2, track_length=20.0)
    size = Shield.default().observation
    shown = np.array(driver.seen)
    assert shown.shape[1:] == (2, 3 * len(size))
    earlier, before, now = np.split(shown, 3, axis=2)
    first = (now == before).all(axis=2) & (before == earlier).all(axis=2)
    assert first[0].all()
    assert 4 <= first.sum() <= 6, "two egos begin two episodes each, and wait for nobody"
    later = ~first[1:]
    assert (before[1:][later] == now[:-1][later]).all()
    assert (earlier[1:][later] == before[:-1][later]).all()


def test_drivers_by_flag(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mine.py").write_text("def right(s): return [2] * len(s.offered)\n")
    for name, parameters in (("mobil", ["--set", "driver.threshold=0"]), (f"{tmp_path}/mine.py:right", [])):
        arguments = ["stress", "highway-test", "--episodes", "3", "--driver", name, *parameters, "--json"]
        assert run(arguments) == 0
        data = json.loads(capsys.readouterr().out)
        assert list(data["policies"]) == [name]
        assert (data["episodes"], data["contacts_at_fault"], data["off_road"]) == (3, 0, 0)


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (["--driver", "mobil", "--policy", "random"], "--driver and --policy: expected one of them"),
        (["--set", "driver.threshold=0"], "--set: expected parameters of --driver"),
        (["--driver", "mobil", "--set", "env.traffic=reactive"], "--set: expected parameters of --driver"),
        (["--driver", "mobil", "--set", "driver.speed=1"], "driver mobil: speed: there is no such"),
        (["--driver", "nobody"], "nobody: no run here"),
        (["--decision-period", "0.05"], "decision_period 0.05 s is no multiple"),
    ],
)
def test_flags_that_no_driver_can_have(
    flags: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["stress", "highway-test", "--episodes", "2", *flags]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line


def test_the_margin_is_the_least_predicted_headway_in_the_way() -> None:
    scenes = random_scenes(50, 12, seed=3)
    targets = np.array([[scene.ego.y, scene.ego.y - 3.75, np.nan] for scene in scenes])
    ours = margins(SceneBatch.of(scenes), targets)
    for scene, row, mine in zip(scenes, targets, ours, strict=True):
        assert mine[2] == math.inf
        assert mine[:2].tolist() == pytest.approx([margin_of(scene, y) for y in row[:2]])


def test_an_adversary_chooses_the_least_margin_among_what_is_offered() -> None:
    class World:
        seen = SceneBatch.of(random_scenes(40, 30, seed=5))

        class decisions:
            action_mask = np.random.default_rng(0).random((40, 3)) < 0.6

        decisions.action_mask[:, 0] |= ~decisions.action_mask.any(axis=1)

        def targets(self) -> np.ndarray:
            centres: np.ndarray = self.seen.y[:, :1] + np.array([0.0, -3.75, 3.75])
            return centres

    world = World()
    chosen = POLICIES["adversarial"](world, np.zeros((40, 3)))  # type: ignore[arg-type]  # all it asks for
    margin, mask = margins(world.seen, world.targets()), world.decisions.action_mask
    assert len(set(chosen.tolist())) == 3
    for row, action in enumerate(chosen):
        assert mask[row, action]
        assert margin[row, action] == margin[row][mask[row]].min()


def test_json_counts_for_all_policies_and_for_each(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["stress", "freeway", "--episodes", "6", "--traffic", "reactive", "--drop-rate", "0.1"]
    assert run([*arguments, "--position-noise", "0.5", "--latency", "0.2", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["episodes"] == 6
    assert {"contacts_at_fault", "contacts_not_at_fault", "off_road", "fail_safe", "worst"} <= set(told)
    assert {name: one["episodes"] for name, one in told["policies"].items()} == dict.fromkeys(POLICIES, 2)
    for key in ("contacts_at_fault", "contacts_not_at_fault", "off_road", "steps", "lane_changes"):
        assert told[key] == sum(one[key] for one in told["policies"].values())


def test_numbers_out_of_range_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["stress", "freeway", "--drop-rate", "1.5"]) == 2
    assert "--drop-rate: input should be less than 1, got 1.5" in capsys.readouterr().err
    assert run(["stress", "freeway", "--offers", "prediction", "--horizon", "0"]) == 2
    assert "--horizon" in capsys.readouterr().err


def test_the_old_name_of_a_flag_still_works_and_says_what_it_is_called_now(
    capsys: pytest.CaptureFixture[str],
) -> None:
    command = ["stress", "highway-test", "--episodes", "1", "--policy", "random", "--json"]
    assert run([*command, "--shield", "none"]) == 0
    old = capsys.readouterr()
    assert old.err == "drlsl: --shield none is now --offers all; --shield goes with 0.3\n"
    assert run([*command, "--offers", "all"]) == 0
    new = capsys.readouterr()
    assert (new.out, new.err) == (old.out, "")
    assert run([*command, "--offers", "all", "--shield", "rules"]) == 2
    assert "give --offers alone" in capsys.readouterr().err
