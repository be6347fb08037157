"""Models that Stable-Baselines3 and sb3-contrib saved, as drivers."""

import importlib
import json
import zipfile
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray

from drlsl.driving.drivers import Driver, Situations
from drlsl.errors import UserError
from drlsl.files import users_code

SUFFIX: Final = ".zip"
"""The end of the names of these models' files."""

_ALGORITHMS: Final = {
    "stable_baselines3.dqn.policies": ("stable_baselines3", "DQN"),
    "stable_baselines3.common.policies": ("stable_baselines3", "PPO"),
    "sb3_contrib.common.maskable.policies": ("sb3_contrib", "MaskablePPO"),
    "sb3_contrib.qrdqn.policies": ("sb3_contrib", "QRDQN"),
}
"""By the module of a model's policy: the package and the class that load it.

Of the algorithms with a common policy, any can load the others' models to drive.
"""


def load_model(path: Path, size: int, actions: int) -> Driver:
    """Return the driver of a saved model: its Q-values, or the logarithms of its probabilities.

    The file holds pickled Python objects, which may run any code when they are loaded.

    Raises:
        UserError: the file cannot be read, the package is missing, or the model does not observe `size`
            numbers or choose among `actions`.
    """
    package, kind = _algorithm(path)
    try:
        algorithm = getattr(importlib.import_module(package), kind)
    except ModuleNotFoundError as error:
        raise UserError(
            f"{path}: a model of {package}, which is missing: pip install 'drlsl[sb3]'"
        ) from error
    with users_code(f"{path}: cannot load the model"):
        model = algorithm.load(path, device="cpu")
    seen, chosen = model.observation_space, model.action_space
    if seen.shape != (size,) or getattr(chosen, "n", None) != actions:
        raise UserError(
            f"{path}: the model observes {seen} and chooses from {chosen}; the environment has {size} "
            f"numbers and {actions} actions"
        )
    return _Model(model.policy)


class _Model:
    """A policy of Stable-Baselines3."""

    window = 1

    def __init__(self, policy: Any) -> None:
        self._policy = policy
        policy.set_training_mode(False)

    @torch.inference_mode()
    def preferences(self, situations: Situations) -> NDArray[np.float32]:
        """Return Q-values, or the logarithms of the probabilities of the actions."""
        observations = torch.from_numpy(situations.observations)
        policy = self._policy
        if hasattr(policy, "quantile_net"):
            values = policy.quantile_net(observations).mean(dim=1)
        elif hasattr(policy, "q_net"):
            values = policy.q_net(observations)
        else:
            values = policy.get_distribution(observations).distribution.logits
        result: NDArray[np.float32] = values.numpy()
        return result


def _algorithm(path: Path) -> tuple[str, str]:
    """Return the package and the class that load a saved model.

    Raises:
        UserError: it is no such file, or of an algorithm that is not known here.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            module = json.loads(archive.read("data"))["policy_class"]["__module__"]
    except OSError as error:
        raise UserError(f"{path}: cannot read it: {error.strerror or error}") from error
    except (zipfile.BadZipFile, KeyError, TypeError, ValueError) as error:
        raise UserError(f"{path}: expected a model that Stable-Baselines3 saved") from error
    if module not in _ALGORITHMS:
        raise UserError(f"{path}: a policy of {module}; expected one of {', '.join(_ALGORITHMS)}")
    return _ALGORITHMS[module]
