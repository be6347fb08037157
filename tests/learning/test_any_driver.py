"""Any driver in the place of a trained policy: `drlsl eval` and `load_driver`."""

import importlib.util
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from drlsl.cli import run
from drlsl.driving import EnvConfig
from drlsl.driving.drivers import Situations
from drlsl.driving.scene import SceneBatch
from drlsl.errors import UserError
from drlsl.learning import load_driver

from .fake import EMPTY, FakeHighway, fakes

SHORT = ["--recording", "highway-test", "--track-length", "80", "--episodes", "3", "--json"]

USERS = """
import numpy as np
import torch
from torch import nn

def keep(situations):
    return np.zeros(len(situations.offered), int)

class Net(nn.Module):
    def __init__(self, best=1):
        super().__init__()
        self.layer = nn.Linear(10, 3)
        with torch.no_grad():
            self.layer.weight.zero_()
            self.layer.bias.copy_(torch.eye(3)[best])
        self.dropout = nn.Dropout(0.9)
    def forward(self, observations):
        return self.dropout(self.layer(observations))

net = Net(2)

class Wide(nn.Module):
    def forward(self, observations):
        return observations

class Broken(nn.Module):
    def forward(self, observations):
        return observations[:, :3] / 0
"""


@pytest.fixture
def users(tmp_path: Path) -> str:
    (tmp_path / "mine.py").write_text(USERS)
    return str(tmp_path / "mine.py")


def preferred(name: str, **arguments: Any) -> list[int]:
    driver = load_driver(name, fakes(2), arguments)
    seen = Situations(np.ones((2, 10), np.float32), np.ones((2, 3), bool), SceneBatch.of([EMPTY] * 2))
    found: list[int] = driver.preferences(seen).argmax(axis=1).tolist()
    return found


def test_modules_drive_in_the_mode_of_evaluation(users: str) -> None:
    assert preferred(f"{users}:net") == [2, 2]
    assert preferred(f"{users}:Net") == [1, 1]
    assert preferred(f"{users}:Net", best=0) == [0, 0]
    assert preferred(f"{users}:keep") == [0, 0]
    assert preferred("always-change") == [1, 1]


@pytest.mark.parametrize(
    ("name", "message"),
    [("Wide", r"returned \(2, 10\); expected values of shape \(2, 3\)"), ("Broken", "that are not finite")],
)
def test_modules_that_are_no_driver(users: str, name: str, message: str) -> None:
    with pytest.raises(UserError, match=f"driver .*:{name} .*{message}"):
        preferred(f"{users}:{name}")


def evaluated(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, Any]:
    assert run(["eval", *arguments, *SHORT]) == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


def test_drivers_are_evaluated_as_runs_are(
    users: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "keep.json"
    keep = evaluated(capsys, "keep", "--out", str(out))
    assert json.loads(out.read_text()) == keep
    assert keep["driver"] == "keep"
    on, off = keep["evaluations"]
    assert (on["shield"], off["shield"]) == ("on", "off")
    assert on["totals"]["lane_changes"] == on["totals"]["interventions"] == 0
    assert on["env"] == EnvConfig.model_validate(on["env"]).model_dump(mode="json")
    mine = evaluated(capsys, f"{users}:keep")["evaluations"]
    assert [{**one, "driver": "keep"} for one in mine] == keep["evaluations"]
    change = evaluated(capsys, "always-change")["evaluations"]
    assert change[0]["totals"]["interventions"] == 0
    assert change[0]["totals"]["off_road"] == 0
    assert change[1]["totals"]["interventions"] > 0, "without the shield every change counts as offered"
    ten = ["--rules", "paper_observation.pl"]
    right = evaluated(capsys, f"{users}:Net", "--set", "driver.best=2", "--shield", "on", *ten)["evaluations"]
    assert right[0]["totals"]["interventions"] > 0
    assert right[0]["totals"]["off_road"] == 0


def test_settings_of_a_driver_and_of_its_road(capsys: pytest.CaptureFixture[str]) -> None:
    free = ["--set", "driver.threshold=0", "--set", "env.traffic=reactive"]
    (found,) = evaluated(capsys, "mobil", "--shield", "on", *free)["evaluations"]
    assert found["env"]["traffic"] == "reactive"
    for wrong, message in (
        ("driver.speed=1", "driver mobil: speed: there is no such setting; its parameters: politeness"),
        ("method=dqn", "--set: expected settings of env or of the driver"),
        ("driver=1", "--set: expected settings of env or of the driver"),
        ("env.speed=1", "env.speed"),
    ):
        assert run(["eval", "mobil", *SHORT, "--set", wrong]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert message in line


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("mobile", "mobile: expected a run folder, keep, always-change, mobil, oracle, FILE.py:NAME"),
        ("no.py:right", "no file no.py"),
        ("no.zip", "no.zip: cannot read it: No such file"),
        ("mine.zip", "mine.zip: expected a model that Stable-Baselines3 saved"),
    ],
)
def test_what_cannot_drive(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    name: str,
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine.zip").write_text("no archive")
    assert run(["eval", name, *SHORT]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line


@pytest.mark.skipif(importlib.util.find_spec("stable_baselines3") is None, reason="the extra sb3")
@pytest.mark.parametrize("kind", ["DQN", "PPO", "MaskablePPO", "QRDQN"])
def test_models_of_stable_baselines(tmp_path: Path, kind: str) -> None:
    contributed = kind in ("MaskablePPO", "QRDQN")
    package = importlib.import_module("sb3_contrib" if contributed else "stable_baselines3")
    model = getattr(package, kind)("MlpPolicy", FakeHighway(), device="cpu", seed=3)
    path = str(tmp_path / "model.zip")
    model.save(path)
    observations = np.random.default_rng(0).random((50, 10), np.float32)
    seen = Situations(observations, np.ones((50, 3), bool), SceneBatch.of([EMPTY] * 50))
    driver = load_driver(path, fakes(1))
    expected, _ = model.predict(observations, deterministic=True)
    assert driver.preferences(seen).argmax(axis=1).tolist() == expected.tolist()
    with torch.inference_mode(), pytest.raises(UserError, match="takes no parameters"):
        load_driver(path, fakes(1), {"a": 1})
