"""Masked PPO of sb3-contrib: what is driven, recorded and kept, and that it goes on where it was stopped."""

import importlib.util
import io
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
import torch

from drlsl.errors import UserError
from drlsl.learning import (
    MODEL,
    PpoConfig,
    RunFolder,
    TrainConfig,
    load_driver,
    make_config,
    train_masked_ppo,
)
from drlsl.learning import masked_ppo as module
from drlsl.learning.checkpoint import load_state, save_state
from drlsl.learning.session import make_training_env

needs_sb3 = pytest.mark.skipif(importlib.util.find_spec("sb3_contrib") is None, reason="the extra sb3")

SETTINGS = PpoConfig(steps=8, batch_size=16, epochs=2)


def config(**settings: Any) -> TrainConfig:
    values = {
        "episodes": 10,
        "num_envs": 3,
        "seed": 4,
        "network": {"hidden": [8]},
        "env": {"recording": "overtake-train", "track_length": 150.0, "decision_period": 0.5},
    }
    return make_config({**values, **settings}, "test")


def rows(folder: RunFolder) -> pd.DataFrame:
    return folder.metrics().drop(columns="wall_s")


def weights(folder: RunFolder) -> dict[str, list[Any]]:
    with zipfile.ZipFile(folder.root / MODEL) as archive:
        found = torch.load(io.BytesIO(archive.read("policy.pth")), weights_only=True)
    return {name: tensor.tolist() for name, tensor in found.items()}


def trained(root: Path, stop: Callable[[], bool] = lambda: False, **settings: Any) -> RunFolder:
    folder = train_masked_ppo(root, config(**settings), SETTINGS, stop)
    assert folder is not None
    return folder


@needs_sb3
def test_a_training_is_recorded_and_its_model_drives(tmp_path: Path) -> None:
    folder = trained(tmp_path / "run")
    found = rows(folder)
    assert found["episode"].tolist() == list(range(1, 11))
    assert found["off_road"].sum() == found["fail_safe"].sum() == 0
    assert (found["contact"] * found["at_fault"]).sum() == 0
    assert found["loss"].notna().any()
    assert (found["interventions"] <= found["steps"]).all()
    assert found["interventions"].sum() > 0, "an untrained policy wants only what is offered"
    terms = found[[name for name in found.columns if name.startswith("reward_")]].sum(axis=1)
    assert terms.tolist() == pytest.approx(found["return"].tolist())
    driver = load_driver(str(folder.root / MODEL), make_training_env(folder.config))
    assert driver.window == 1


@needs_sb3
def test_a_training_is_a_function_of_its_seed(tmp_path: Path) -> None:
    one, again = (trained(tmp_path / name) for name in ("a", "b"))
    assert rows(one).equals(rows(again))
    assert weights(one) == weights(again)
    other = trained(tmp_path / "c", seed=5)
    assert weights(one) != weights(other)
    assert rows(one)["distance"].tolist() != rows(other)["distance"].tolist()


@needs_sb3
def test_a_training_that_was_stopped_goes_on_bit_for_bit(tmp_path: Path) -> None:
    whole = trained(tmp_path / "whole")
    root, steps = tmp_path / "broken", 0
    for pause in (13, 21, 5):
        asked = 0

        def stop(limit: int = pause) -> bool:
            nonlocal asked, steps
            asked += 1
            steps += 1
            return asked > limit

        assert train_masked_ppo(root, config(), SETTINGS, stop) is None
        assert not (root / MODEL).exists()
        np.random.seed(1)  # noqa: NPY002  (another training in the same process would)
        torch.manual_seed(1)
    broken = trained(root)
    assert rows(broken).equals(rows(whole))
    assert weights(broken) == weights(whole)


@needs_sb3
def test_a_training_that_an_earlier_version_began_is_refused(tmp_path: Path) -> None:
    folder = trained(tmp_path / "run")
    state = load_state(folder.checkpoint, "checkpoint")
    save_state(folder.checkpoint, "checkpoint", state | {"envs": [state["envs"]] * 3})
    with pytest.raises(UserError, match="written by an earlier version of DRLSL"):
        trained(tmp_path / "run")


@needs_sb3
def test_a_loss_that_is_not_finite_ends_the_training(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "math", SimpleNamespace(isfinite=lambda value: False))
    with pytest.raises(UserError, match=r"the loss is .*: train again with a lower ppo.learning_rate"):
        trained(tmp_path / "run")


def test_without_the_package_a_line_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "sb3_contrib", None)
    with pytest.raises(UserError, match=r"sb3-contrib, which is missing: pip install 'drlsl\[sb3\]'"):
        trained(tmp_path / "run")
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"method": "dqn"}, "chooses among what is offered"),
        ({"network": {"window": 2}}, "of network only hidden may be set"),
        ({"network": {"noisy": True}}, "of network only hidden may be set"),
        ({"network": {"factory": "dueling"}}, "of network only hidden may be set"),
    ],
)
def test_trainings_that_it_cannot_do(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(UserError, match=message):
        SETTINGS.check_fits(config(**settings))
