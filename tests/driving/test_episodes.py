"""Episodes: what is recorded is what was driven, and files hold all of it."""

from __future__ import annotations

import json
import zipfile
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drlsl.cli import run
from drlsl.driving.drivers import make_driver
from drlsl.driving.episodes import Episode, load_episode, save_episode
from drlsl.driving.explain import objections
from drlsl.driving.scene import Action, load_scene
from drlsl.driving.shield import Shield
from drlsl.errors import UserError
from tests.driving.driven import drive

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def episodes() -> list[Episode]:
    return drive()


def test_what_is_recorded_is_what_the_rules_say_of_it(episodes: list[Episode]) -> None:
    shield = Shield.default()
    refused = 0
    for episode in episodes:
        for frame in range(0, len(episode), 7):
            scene = episode.scene(frame)
            decision = shield.decide(scene)
            assert episode.offered(frame) == tuple(sorted(decision.safe_actions))
            answers = episode.answers
            assert answers.target_speed[frame] == decision.target_speed
            assert tuple(answers.observation[frame]) == decision.observation
            assert bool(answers.front_is_free[frame]) is decision.front_is_free
            assert answers.lane_to_keep[frame] == decision.lane_to_keep
            assert answers.comfortable_acceleration[frame] == decision.comfortable_acceleration
            found: dict[Action, list[object]] = {
                action: [] for action in Action if action not in decision.safe_actions
            }
            for reason in episode.reasons[frame]:
                found[reason.action].append(reason.objection)
            assert found == objections(shield, scene, decision)
            refused += sum(map(len, found.values()))
    assert refused > 20


def test_an_episode_moves_as_its_ego_does(episodes: list[Episode]) -> None:
    for episode in episodes:
        places = np.array([episode.scene(frame).ego.x for frame in range(len(episode))])
        driven = np.diff(episode.distance)
        same = ~episode.entered[1:]
        assert np.abs(np.abs(np.diff(places)) - driven)[same].max() < 0.05
        assert episode.ending.kind == "completed"
        assert episode.distance[-1] >= 300.0
        assert episode.action[-1] == -1
        assert (episode.action[:-1] >= 0).all()
        assert np.isnan(episode.preferences[-1]).all()


def test_a_change_is_marked_where_it_was_decided() -> None:
    (episode,) = drive(make_driver("always-change"), seeds=(11,), decision_period=1.0)
    changes = np.flatnonzero(episode.changed)
    assert len(changes)
    for frame in changes.tolist():
        assert episode.action[frame] in (1, 2)
        assert Action(episode.action[frame]) in episode.offered(frame)
        assert episode.target_lane[frame] != episode.target_lane[frame + 1]
    assert (np.diff(np.flatnonzero(episode.action >= 0)) == 10).all()


@pytest.mark.parametrize(
    ("rules", "clauses"),
    [
        ("highway.pl", {"changing_lanes": "settled", "no_lane": "no_lane", "too_close": "obstacle"}),
        ("paper.pl", {"no_lane": "is_valid", "too_close": "too_close"}),
    ],
)
def test_each_reason_has_the_clause_that_gives_it(rules: str, clauses: dict[str, str]) -> None:
    found = set()
    for episode in drive(rules=(rules,)):
        for reason in [reason for reasons in episode.reasons for reason in reasons]:
            assert reason.clause is not None
            clause = episode.clauses[reason.clause]
            assert clause.file == rules
            text = (ROOT / "rules" / rules).read_text(encoding="utf-8").splitlines()
            assert clause.text.splitlines()[0] == text[clause.line - 1]
            assert clauses[reason.objection.reason] in clause.text
            if rules == "paper.pl":
                assert reason.action.atom in clause.text
            found.add(reason.objection.reason)
    assert found == set(clauses)


def test_what_faulty_sensing_saw_is_kept_beside_what_was_there() -> None:
    episode = drive(seeds=(5,), sensing={"position_noise": 1.0, "drop_rate": 0.2})[0]
    shield, differs = Shield.default(), 0
    for frame in range(0, len(episode), 9):
        decision = shield.decide(episode.seen_scene(frame))
        assert episode.offered(frame) == tuple(sorted(decision.safe_actions))
        assert episode.answers.target_speed[frame] == decision.target_speed
        found = [one.objection for one in episode.reasons[frame]]
        against = objections(shield, episode.seen_scene(frame), decision)
        assert found == [one for action in sorted(against) for one in against[action]]
        differs += episode.scene(frame).in_range() != episode.seen_scene(frame).vehicles
    assert differs > 3


def same(one: Episode, other: Episode) -> bool:
    """Return whether two episodes are equal to the bit."""
    return all(_equal(getattr(one, field.name), getattr(other, field.name)) for field in fields(Episode))


def _equal(one: Any, other: Any) -> bool:
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and np.array_equal(one, other, equal_nan=one.dtype.kind == "f")
    if hasattr(one, "__dataclass_fields__"):
        return all(_equal(getattr(one, name), getattr(other, name)) for name in one.__dataclass_fields__)
    return bool(one == other)


def test_a_file_holds_all_of_an_episode(tmp_path: Path) -> None:
    for number, episode in enumerate(
        drive(rules=("overtake_left.pl",), sensing={"position_noise": 0.5}, decision_period=0.5)
    ):
        path = tmp_path / f"{number}.npz"
        save_episode(path, episode)
        assert same(load_episode(str(path)), episode)
        before = path.read_bytes()
        save_episode(path, load_episode(path))
        assert path.read_bytes() == before
        assert json.loads(np.load(path)["header"].item())["origin"]["driver"] == "mobil"


def test_an_episode_is_drawn_as_its_moments(episodes: list[Episode]) -> None:
    frame = next(n for n, reasons in enumerate(episodes[0].reasons) if len(reasons) > 1)
    moment = episodes[0].moment(frame)
    assert moment.scene == episodes[0].scene(frame)
    assert sum(map(len, moment.unsafe.values())) == len(episodes[0].reasons[frame])
    assert moment.alarm == ""


@pytest.mark.parametrize(
    ("damage", "problem"),
    [
        ({"header": None}, "has no header"),
        ({"header": "{}"}, "format"),
        ({"header": "{"}, "not JSON"),
        ({"target_speed": None}, "target_speed is missing"),
        ({"target_speed": np.zeros(3)}, "target_speed has shape"),
        ({"offered": np.zeros((2, 3))}, "offered is missing, or of another kind"),
        ({"vehicle_name": -1}, "vehicle_name is out of range"),
        ({"vehicle_begin": 1}, "vehicle_begin do not fit"),
        ({"reason_kind": 99}, "reason_kind is out of range"),
        ({"reason_clause": 99}, "reason_clause is out of range"),
    ],
)
def test_a_damaged_file_is_refused_in_one_line(
    tmp_path: Path, episodes: list[Episode], damage: dict[str, Any], problem: str
) -> None:
    path = tmp_path / "one.npz"
    save_episode(path, episodes[0])
    arrays: dict[str, Any] = dict(np.load(path))
    for name, value in damage.items():
        if value is None:
            del arrays[name]
        elif isinstance(value, int):
            arrays[name][0] = value
        else:
            arrays[name] = np.array(value)
    np.savez(path, **arrays)
    with pytest.raises(UserError, match=problem) as caught:
        load_episode(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_what_is_no_archive_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "one.npz"
    with pytest.raises(UserError, match="cannot read the episode"):
        load_episode(path)
    path.write_bytes(b"hello")
    with pytest.raises(UserError, match=r"not an episode, which is an \.npz archive; drlsl eval"):
        load_episode(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("other.txt", "hello")
    with pytest.raises(UserError, match="no header"):
        load_episode(path)


def test_stress_writes_how_its_worst_contacts_came_about(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "worst"
    asked = ["stress", "freeway", "--offers", "all", "--episodes", "12", "--out", str(out), "--json"]
    assert run(asked) == 0
    worst = json.loads(capsys.readouterr().out)["worst"]
    assert worst
    against = 0
    for contact in worst:
        name = f"episode-{contact['episode']}-{contact['verdict']}-v{contact['vehicle']}"
        episode = load_episode(out / f"{name}.npz")
        assert episode.ending.kind == "contact"
        assert episode.ending.verdict == contact["verdict"]
        assert not episode.origin.enforced
        assert episode.answers.offered.all()
        against += sum(map(len, episode.reasons))
        scene = load_scene(out / f"{name}.json")
        last = episode.scene(len(episode) - 1)
        assert last.ego == scene.ego
        assert set(scene.vehicles) == set(last.in_range())
        assert episode.moment(len(episode) - 1).alarm.startswith(f"contact with v{contact['vehicle']}")
        assert not episode.moment(0).unsafe
    assert against > 0, "what the rules would have refused is told, too"
    assert (out / "worst.html").stat().st_size > 10_000


RESTLESS = """
import numpy as np

DRAWN = np.random.default_rng(1)

def restless(situations):
    return DRAWN.integers(0, 3, len(situations.offered))
"""


def test_a_driver_that_never_drives_alike_is_told_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its contacts cannot be driven again, so no episode may pass for how they came about."""
    (tmp_path / "mine.py").write_text(RESTLESS)
    out = tmp_path / "worst"
    asked = ["stress", "freeway", "--driver", f"{tmp_path}/mine.py:restless", "--offers", "all"]
    assert run([*asked, "--episodes", "12", "--out", str(out)]) == 2
    problem = capsys.readouterr().err
    assert "went otherwise when it was driven again" in problem
    assert not list(out.glob("*.npz"))
    assert list(out.glob("*.json")), "the scenes of the contacts are there all the same"
