"""Any driver by name: a run's policy, a saved model, a PyTorch module, or one that needs no PyTorch."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from drlsl.driving.drivers import DRIVERS, Driver, Situations, driver_of, is_driver, make_driver
from drlsl.errors import UserError
from drlsl.files import find_object, users_code
from drlsl.learning.fleet import HasSpaces, space_sizes
from drlsl.learning.rundir import RunFolder
from drlsl.learning.session import load_policy
from drlsl.learning.stable_baselines import SUFFIX, load_model


def load_driver(name: str, env: HasSpaces, arguments: Mapping[str, Any] | None = None) -> Driver:
    """Return the driver of a name, for an environment: a run folder, a model's .zip, or as `make_driver`.

    FILE.py:NAME and PACKAGE.MODULE:NAME may be a PyTorch module as well, or a class of one, made with the
    `arguments`: from observations (N, S) float32 to the values of the actions (N, A).

    Raises:
        UserError: there is no such driver, it cannot be loaded, or it does not fit the environment.
    """
    size, actions = space_sizes(env.single_observation_space, env.single_action_space)
    if is_driver(name):
        if name in DRIVERS:
            return make_driver(name, arguments)
        what = f"driver {name}"
        found = find_object(name, what)
        if isinstance(found, type) and issubclass(found, nn.Module):
            with users_code(f"{what}: cannot make it"):
                found, arguments = found(**arguments or {}), None
        if isinstance(found, nn.Module) and not arguments:
            return ModuleDriver(what, found, actions)
        return driver_of(found, what, arguments)
    if arguments:
        raise UserError(f"{name}: it takes no parameters, got {', '.join(arguments)}")
    if name.endswith(SUFFIX):
        return load_model(Path(name), size, actions)
    return load_policy(RunFolder.open(Path(name)), env)


class ModuleDriver:
    """A user's own PyTorch module as a driver, evaluated on the processor."""

    window = 1

    def __init__(self, what: str, module: nn.Module, actions: int) -> None:
        """Take over a module, in the mode of evaluation; `what` names it in errors."""
        self._what = what
        self._module = module.eval()
        self._actions = actions

    @torch.inference_mode()
    def preferences(self, situations: Situations) -> NDArray[np.float32]:
        """Return the module's values of the actions.

        Raises:
            UserError: it raised an error, or returned anything but finite values.
        """
        observations = torch.from_numpy(situations.observations)
        with users_code(f"{self._what}: its forward pass fails"):
            values = self._module(observations)
        wanted = (len(observations), self._actions)
        if not isinstance(values, torch.Tensor) or tuple(values.shape) != wanted:
            shape = tuple(values.shape) if isinstance(values, torch.Tensor) else type(values).__name__
            raise UserError(f"{self._what} returned {shape}; expected values of shape {wanted}")
        result = values.to(torch.float32).numpy()
        if not np.isfinite(result).all():
            raise UserError(f"{self._what} returned values that are not finite: {result.tolist()}")
        return result
