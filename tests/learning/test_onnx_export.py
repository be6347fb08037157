"""A policy as an ONNX model: the same values on observations of driving, or nothing is written."""

import importlib.util
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from drlsl.cli import run
from drlsl.driving.scene import Action
from drlsl.driving.shield import Shield
from drlsl.files import digest
from drlsl.learning import RunFolder, load_policy, make_evaluation_env
from drlsl.learning import onnx_export as module

MISSING = importlib.util.find_spec("onnxruntime") is None or importlib.util.find_spec("onnxscript") is None
needs_onnx = pytest.mark.skipif(MISSING, reason="the extra onnx")
TINY = ["--preset", "tiny", "--episodes", "2", "--track-length", "40", "--device", "cpu"]
NETWORKS: dict[str, list[str]] = {
    "mlp": [],
    "noisy": ["--set", "network.noisy=true"],
    "dueling": ["--network", "dueling"],
    "window": ["--set", "network.window=3"],
    "recurrent": ["--network", "tests/learning/networks.py:Recurrent", "--set", "network.window=3"],
}


def trained(root: Path, *settings: str) -> RunFolder:
    assert run(["train", *TINY, *settings, "--out", str(root / "run")]) == 0
    return RunFolder.open(root / "run")


@pytest.mark.skipif(not MISSING, reason="the extra onnx is installed")
def test_without_the_extra_it_says_what_is_missing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    trained(tmp_path)
    capsys.readouterr()
    assert run(["export", str(tmp_path / "run"), "--out", str(tmp_path / "policy.onnx")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "pip install 'drlsl[onnx]'" in line


@needs_onnx
@pytest.mark.parametrize("network", NETWORKS)
def test_the_model_has_the_values_of_the_policy(
    tmp_path: Path, network: str, capsys: pytest.CaptureFixture[str]
) -> None:
    import onnxruntime

    folder = trained(tmp_path, *NETWORKS[network])
    capsys.readouterr()
    out = tmp_path / "policy.onnx"
    assert run(["export", str(tmp_path / "run"), "--out", str(out), "--json"]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    metadata = json.loads(captured.out)["metadata"]
    session = onnxruntime.InferenceSession(out, providers=["CPUExecutionProvider"])
    assert session.get_modelmeta().custom_metadata_map == metadata
    shield = Shield.default()
    assert json.loads(metadata["observation"]) == list(shield.observation.names)
    assert json.loads(metadata["actions"]) == [action.atom for action in Action]
    assert json.loads(metadata["rules"]) == {path.name: digest([path]) for path in shield.files()}
    env = make_evaluation_env(folder.config.env)
    policy = load_policy(folder, env)
    rows = module.observed(env, policy, 1_000, seed=7)
    assert rows.shape == (1_000, policy.window * len(shield.observation))
    (found,) = session.run(["q_values"], {"observations": rows})
    expected = policy.values(rows)
    assert np.abs(found - expected).max() <= 1e-5 * max(1.0, np.abs(expected).max())
    assert (found.argmax(axis=1) == expected.argmax(axis=1)).all()
    (one,) = session.run(["q_values"], {"observations": rows[:1]})
    assert one == pytest.approx(found[:1], abs=1e-6)


@needs_onnx
def test_a_model_that_is_not_the_policy_is_not_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    trained(tmp_path)
    capsys.readouterr()
    forward: Any = module._Values.forward
    off = torch.tensor([0.0, 0.0, 1e-3])
    monkeypatch.setattr(module._Values, "forward", lambda self, seen: forward(self, seen) + off)
    out = tmp_path / "policy.onnx"
    assert run(["export", str(tmp_path / "run"), "--out", str(out)]) == 2
    assert "the ONNX model is not the policy" in capsys.readouterr().err
    assert not out.exists()
