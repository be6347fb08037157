"""Evaluations that are recorded: nothing is changed by it, and what is counted is what is recorded."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drlsl.cli import run
from drlsl.driving.episodes import Episode, load_episode

TINY = ["--preset", "tiny", "--device", "cpu", "--episodes", "1", "--set", "env.track_length=150"]


def check(record: dict[str, Any], episodes: list[Episode]) -> None:
    """Check that an evaluation counted what its episodes show."""
    for episode, counted in zip(episodes, record["per_episode"], strict=True):
        decided = episode.action >= 0
        preferences, offered = episode.preferences[decided], episode.answers.offered[decided]
        wanted = preferences.argmax(axis=1)
        possible = offered if record["shield"] == "on" else np.ones_like(offered)
        best = np.where(possible, np.maximum(preferences, -1e300), -np.inf).argmax(axis=1)
        assert np.array_equal(episode.action[decided], best)
        assert decided.sum() == counted["steps"]
        assert (~offered[np.arange(len(wanted)), wanted]).sum() == counted["interventions"]
        assert episode.changed.sum() == counted["lane_changes"]
        assert episode.distance[-1] == counted["distance"]


def loaded(folder: str, driver: str, shield: str) -> list[Episode]:
    return [load_episode(path) for path in sorted(Path(folder).glob(f"{driver}-shield-{shield}-*.npz"))]


def test_eval_records_its_episodes_and_a_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["train", *TINY, "--out", "run", "--set", "evaluation.episodes_after_training=0"]) == 0
    asked = ["eval", "run", "--episodes", "2", "--track-length", "150", "--json"]
    capsys.readouterr()
    assert run(asked) == 0
    plain = capsys.readouterr().out
    assert run([*asked, "--episodes-out", "run/episodes"]) == 0
    told = capsys.readouterr()
    assert told.out == plain
    assert "wrote 4 episodes to run/episodes, and run/episodes/view.html" in told.err
    for record, shield in zip(json.loads(plain)["evaluations"], ("on", "off"), strict=True):
        episodes = loaded("run/episodes", "run", shield)
        check(record, episodes)
        assert {episode.origin.wants for episode in episodes} == {"Q-values"}
    assert run(["view", "run", "--out", "page.html"]) == 0
    capsys.readouterr()
    assert run([*asked, "--episodes-out", "run/episodes"]) == 2
    assert "run/episodes exists" in capsys.readouterr().err


def test_interventions_are_recorded_where_they_are_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    asked = ["eval", "mobil", "--recording", "overtake-test", "--episodes", "4", "--json"]
    assert run([*asked, "--episodes-out", "episodes"]) == 0
    records = json.loads(capsys.readouterr().out)["evaluations"]
    assert all(record["totals"]["interventions"] > 0 for record in records)
    for record, shield in zip(records, ("on", "off"), strict=True):
        check(record, loaded("episodes", "mobil", shield))
