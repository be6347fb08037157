import importlib.util
import json

import pytest

from drlsl.benchmarks import training_speed as bench
from drlsl.cli import run

pytestmark = pytest.mark.usefixtures("fake_driving")

KEYS = {"num_envs", "batch_size", "runs", "updates_per_s", "bare_updates_per_s", "ratio"}
KEYS |= {"updates_per_s_at_first", "module_updates_per_s", "module_ratio"}
THEIRS = {"stable_baselines3_updates_per_s", "stable_baselines3_ratio"}


@pytest.fixture(autouse=True)
def _few_updates(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "UPDATES", 6)


def without_stable_baselines3(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)


def test_it_prints_json(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    without_stable_baselines3(monkeypatch)
    assert run(["bench", "train", "--runs", "2", "--num-envs", "3", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert set(found) == KEYS
    assert (found["num_envs"], found["batch_size"], found["runs"]) == (3, 128, 2)
    assert all(value > 0 for value in found.values())


def test_it_prints_a_few_lines(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    without_stable_baselines3(monkeypatch)
    assert run(["bench", "train", "--runs", "1", "--num-envs", "1"]) == 0
    out = capsys.readouterr().out
    assert "bare updates" in out
    assert "of bare" in out
    assert "as a plain module" in out
    assert "Stable" not in out


def test_seeds_are_trained_together(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    without_stable_baselines3(monkeypatch)
    small = ["--runs", "1", "--num-envs", "2", "--set", "learning.replay_capacity=500", "--seeds", "3"]
    assert run(["bench", "train", *small, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert set(found) == KEYS | {"stacked_updates_per_s", "stacked_ratio", "seeds"}
    assert found["stacked_updates_per_s"] > 0
    assert run(["bench", "train", *small]) == 0
    assert "3 seeds together" in capsys.readouterr().out
    assert run(["bench", "train", *small, "--set", "learning.overlap=true"]) == 2
    assert "learning.overlap is true" in capsys.readouterr().err


def test_settings_are_those_of_the_training(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    without_stable_baselines3(monkeypatch)
    settings = ["--set", "learning.precision=bfloat16", "--set", "learning.batch_size=64"]
    assert run(["bench", "train", "--runs", "1", "--num-envs", "2", *settings, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["batch_size"] == 64
    assert run(["bench", "train", "--set", "learning.precision=float8"]) == 2
    assert "learning.precision" in capsys.readouterr().err


def test_stable_baselines3_is_measured_where_it_is() -> None:
    pytest.importorskip("stable_baselines3", reason="the comparison needs stable-baselines3")
    assert set(bench.training_speeds(1, 2)) == KEYS | THEIRS
