"""A user's own function that makes a Q-network: naming, finding and calling it."""

import inspect
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from drlsl.errors import UserError
from drlsl.files import find_object, users_code
from drlsl.learning.config import NetworkConfig

Factory = Callable[..., Any]
"""Makes a torch.nn.Module from the numbers of observed values and of actions, and keyword arguments."""


def find_factory(name: str) -> Factory:
    """Find a function or class by FILE.py:NAME or PACKAGE.MODULE:NAME, running its file at most once.

    Raises:
        UserError: there is no such file, module or function, or the file cannot be run.
    """
    what = f"network.factory {name}"
    factory = find_object(name, what)
    if not (inspect.isfunction(factory) or inspect.isclass(factory)):
        raise UserError(f"{what}: expected a function or a class, found a {type(factory).__name__}")
    made: Factory = factory
    return made


def call_factory(config: NetworkConfig, observation_size: int, actions: int) -> Any:
    """Call the function that a configuration names.

    Raises:
        UserError: it cannot be found or called.
    """
    factory = find_factory(config.factory)
    with users_code(f"network.factory {config.factory}: cannot make the network"):
        return factory(observation_size, actions, **config.arguments)


def factory_file(name: str) -> Path:
    """Return the file that a function or class is defined in.

    Raises:
        UserError: it cannot be found.
    """
    with users_code(f"network.factory {name}: cannot find its file"):
        return Path(inspect.getfile(find_factory(name)))


def factory_name(factory: Factory) -> str:
    """Return the name by which another process finds a function or class.

    Raises:
        UserError: it was not defined at the top level of a file.
    """
    name = getattr(factory, "__qualname__", "")
    module = sys.modules.get(getattr(factory, "__module__", ""))
    if module is None or not name.isidentifier() or getattr(module, name, None) is not factory:
        raise UserError(
            f"network {factory!r}: expected a function at the top level of a file, "
            "where `drlsl eval` finds it"
        )
    dotted = module.__spec__.name if module.__spec__ is not None else module.__name__
    if "." in dotted:
        return f"{dotted}:{name}"
    file = getattr(module, "__file__", None)
    if file is None:
        raise UserError(
            f"network {name}: put it into a file, such as networks.py, so that `drlsl eval` finds it"
        )
    path = Path(file).resolve()
    here = Path.cwd()
    return f"{path.relative_to(here) if path.is_relative_to(here) else path}:{name}"
