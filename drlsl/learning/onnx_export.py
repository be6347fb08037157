"""A trained policy as an ONNX model: the Q-values of observations, checked against the policy itself."""

import json
import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from drlsl.driving import HighwayVectorEnv, Shield
from drlsl.driving.drivers import Situations, most_wanted
from drlsl.driving.scene import Action
from drlsl.errors import UserError
from drlsl.files import digest, write_atomic
from drlsl.learning.evaluation import make_evaluation_env
from drlsl.learning.network import Policy
from drlsl.learning.rundir import RunFolder
from drlsl.learning.session import load_policy
from drlsl.version import __version__

OBSERVATIONS: Final = 1_000
"""Observations of driving on which a model is checked before it is written."""

TOLERANCE: Final = 1e-5
"""Largest difference of a Q-value, as a share of it where it is above 1."""

INPUT, OUTPUT = "observations", "q_values"
"""Names of the model's input, shape (batch, S), and output, shape (batch, A); both float32."""


def export_onnx(folder: RunFolder, out: Path) -> dict[str, str]:
    """Write a run's policy as an ONNX model; return the metadata that it holds.

    The model gives the Q-values and not the action: which actions are offered is up to the rules, and whether
    an argmax in ONNX Runtime notices a NaN depends on where it stands.

    Raises:
        UserError: packages are missing, the network cannot be exported, the model's values are not those of
            the policy, or the file cannot be written.
    """
    try:
        import onnx
        import onnxruntime  # noqa: F401  # needed by the check
        import onnxscript  # noqa: F401  # needed by torch.onnx
    except ModuleNotFoundError as error:
        raise UserError(
            f"exporting needs {error.name}, which is missing: pip install 'drlsl[onnx]'"
        ) from error
    env = make_evaluation_env(folder.config.env)
    policy = load_policy(folder, env)
    model = _model(policy, policy.window * len(env.shield.observation))
    metadata = _metadata(folder, env.shield, policy)
    onnx.helper.set_model_props(model, metadata)
    onnx.checker.check_model(model, full_check=True)
    content = model.SerializeToString()
    _check(content, policy, observed(env, policy, OBSERVATIONS, folder.config.seed))
    write_atomic(out, content)
    return metadata


def observed(env: HighwayVectorEnv, policy: Policy, count: int, seed: int) -> NDArray[np.float32]:
    """Return windows of observations of driving with a policy, shape (count, W · S)."""
    everyone = np.ones(env.num_envs, np.bool_)
    shown, _ = env.reset(seed=seed, options={"reset_mask": everyone})
    seen = np.tile(shown, policy.window)
    found = [seen]
    while len(found) * env.num_envs < count:
        offered = env.action_masks()
        choice = most_wanted(policy.preferences(Situations(seen, offered, env.scenes())), offered)
        shown, _, terminated, truncated, _ = env.step(choice.actions)
        over = terminated | truncated
        if over.any():
            shown, _ = env.reset(options={"reset_mask": over})
        later = np.concatenate([seen[:, shown.shape[1] :], shown], axis=1)
        seen = np.where(over[:, None], np.tile(shown, policy.window), later)
        found.append(seen)
    return np.concatenate(found)[:count]


def _model(policy: Policy, size: int) -> Any:
    """Return the ONNX model of a policy, for any number of observations at once.

    Raises:
        UserError: PyTorch cannot export the network.
    """
    batch = torch.export.Dim("batch")
    try:
        with _quiet():
            program = torch.onnx.export(
                _Values(policy).eval(),
                (torch.zeros(2, size),),
                dynamo=True,
                input_names=[INPUT],
                output_names=[OUTPUT],
                dynamic_shapes=({0: batch},),
                verbose=False,
            )
    except Exception as error:
        first = next(iter(str(error).splitlines()), "")
        raise UserError(f"PyTorch cannot export the network: {type(error).__name__}: {first}") from error
    assert program is not None
    return program.model_proto


class _Values(nn.Module):
    """A policy's Q-values as a module."""

    def __init__(self, policy: Policy) -> None:
        super().__init__()
        self._module = policy.module()

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        values: torch.Tensor = self._module(observations)
        return values


def _metadata(folder: RunFolder, shield: Shield, policy: Policy) -> dict[str, str]:
    """Return what a user of the model must know, as the strings that ONNX allows."""
    space = shield.observation
    return {
        "drlsl": __version__,
        "observation": json.dumps(space.names),
        "observation_low": json.dumps(space.low),
        "observation_high": json.dumps(space.high),
        "window": str(policy.window),
        "actions": json.dumps([action.atom for action in Action]),
        "rules": json.dumps({path.name: digest([path]) for path in shield.files()}),
        "decision_period": json.dumps(folder.config.env.decision_period),
        "method": folder.config.method,
        "seed": str(folder.config.seed),
    }


def _check(content: bytes, policy: Policy, observations: NDArray[np.float32]) -> None:
    """Check a model against the policy on the processor.

    Raises:
        UserError: a value or a preferred action differs.
    """
    import onnxruntime

    session = onnxruntime.InferenceSession(content, providers=["CPUExecutionProvider"])
    (found,) = session.run([OUTPUT], {INPUT: observations})
    expected = policy.values(observations)
    off = np.abs(found - expected) / np.maximum(np.abs(expected), 1.0)
    other = found.argmax(axis=1) != expected.argmax(axis=1)
    if not (off <= TOLERANCE).all() or other.any():
        raise UserError(
            f"the ONNX model is not the policy: of {len(observations)} observations, values are off by up to "
            f"{float(off.max()):.1g}, and {int(other.sum())} actions differ; nothing was written"
        )


@contextmanager
def _quiet() -> Iterator[None]:
    """Leave out what PyTorch says about packages that it does not need."""
    logger = logging.getLogger("torch.onnx")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.setLevel(level)
