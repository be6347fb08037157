"""Drivers by name, for commands that need PyTorch only for some of them."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from drlsl.driving import EnvConfig
    from drlsl.driving.drivers import Driver
    from drlsl.driving.shield import Shield


def trained_env(driver: str | None) -> EnvConfig | None:
    """Return the environment that a run was trained in, if the driver is one."""
    from drlsl.driving.drivers import is_driver

    if driver is None or is_driver(driver) or driver.endswith(".zip"):
        return None
    from drlsl.learning import RunFolder

    return RunFolder.open(Path(driver)).config.env


def loaded_driver(driver: str, arguments: dict[str, Any], shield: Shield) -> Driver:
    """Return the driver; PyTorch is loaded only for one that may need it."""
    from drlsl.driving.drivers import DRIVERS, is_driver, make_driver

    if driver in DRIVERS or (is_driver(driver) and find_spec("torch") is None):
        return make_driver(driver, arguments)
    from drlsl.driving.envs import spaces_of
    from drlsl.learning import load_driver

    return load_driver(driver, spaces_of(shield), arguments)
