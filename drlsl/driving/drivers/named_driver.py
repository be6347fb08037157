"""Drivers by name: those that come with the package, and a user's own Python code."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Final

import numpy as np
from pydantic import ValidationError

from drlsl.driving.config import Section
from drlsl.driving.drivers.driver import Driver, Preferences, Situations, wanting
from drlsl.driving.drivers.fixed_rule import AlwaysChange, Keep
from drlsl.driving.drivers.mobil import Mobil
from drlsl.driving.drivers.oracle import Oracle
from drlsl.driving.scene import Action
from drlsl.errors import UserError
from drlsl.files import find_object, reason_of, users_code

KEEP: Final = "keep"
"""The driver whose time the others are compared with."""

DRIVERS: Final[Mapping[str, type[Section]]] = {
    KEEP: Keep,
    "always-change": AlwaysChange,
    "mobil": Mobil,
    "oracle": Oracle,
}
"""The drivers that come with the package, by name."""


def is_driver(name: str) -> bool:
    """Return whether a name means a driver that needs no PyTorch, and not a run folder or a file."""
    return name in DRIVERS or ":" in name


def make_driver(name: str, arguments: Mapping[str, Any] | None = None) -> Driver:
    """Return the driver of a name: one of `DRIVERS`, or FILE.py:NAME or PACKAGE.MODULE:NAME.

    The object of that name is a function of `Situations`, or a class whose instances are drivers or such
    functions. Such a function returns the action that each ego prefers, integers (N,), or `Preferences`. A
    class, and a driver of the package, takes the `arguments` by name.

    Raises:
        UserError: there is no such driver, or it does not take these arguments.
    """
    if name in DRIVERS:
        return _shipped(name, arguments or {})
    if ":" not in name:
        raise UserError(f"no driver '{name}': expected {', '.join(DRIVERS)}, FILE.py:NAME or MODULE:NAME")
    return driver_of(find_object(name, f"driver {name}"), f"driver {name}", arguments)


def driver_of(found: object, what: str, arguments: Mapping[str, Any] | None = None) -> Driver:
    """Return the driver that a user's class or function makes; `what` names it in errors.

    Raises:
        UserError: it is neither, does not take these arguments, or raises an error.
    """
    if inspect.isclass(found):
        with users_code(f"{what}: cannot make it"):
            found = found(**arguments or {})
    elif arguments:
        raise UserError(f"{what}: it takes no parameters, got {', '.join(arguments)}")
    if hasattr(found, "preferences"):
        return UsersDriver(what, found.preferences, getattr(found, "window", 1))
    if not callable(found):
        raise UserError(f"{what}: expected a function or a class, found a {type(found).__name__}")
    return UsersDriver(what, found, getattr(found, "window", 1))


class UsersDriver:
    """A driver of a user's own, whose answers are checked."""

    def __init__(self, what: str, choose: Callable[[Situations], Any], window: object) -> None:
        if not isinstance(window, int) or window < 1:
            raise UserError(f"{what}: its window is {window!r}; expected an integer of 1 or more")
        self._what = what
        self._choose = choose
        self.window = window
        """Number of observations that it needs."""

    def preferences(self, situations: Situations) -> Preferences:
        """Return how much it wants each action.

        Raises:
            UserError: it raised an error, or returned neither actions nor preferences.
        """
        with users_code(f"{self._what} fails"):
            answer = np.asarray(self._choose(replace(situations, branch=None)))
        count = len(situations.offered)
        if answer.shape == (count,) and np.issubdtype(answer.dtype, np.integer):
            if np.isin(answer, [*Action]).all():
                return wanting(answer)
        elif answer.shape == (count, len(Action)) and answer.dtype.kind in "fiu":
            wanted = answer.astype(np.float64)
            if (wanted < np.inf).all():
                return wanted
        raise UserError(
            f"{self._what} returned {_shown(answer)}; expected {count} actions from 0 to {len(Action) - 1}, "
            f"as integers, or preferences of shape ({count}, {len(Action)}) below infinity"
        )


def _shipped(name: str, arguments: Mapping[str, Any]) -> Driver:
    kind = DRIVERS[name]
    try:
        made: Any = kind(**arguments)
    except ValidationError as error:
        problem = error.errors()[0]
        key = ".".join(map(str, problem["loc"]))
        known = ", ".join(kind.model_fields) or "none"
        raise UserError(f"driver {name}: {key}: {reason_of(problem)}; its parameters: {known}") from error
    driver: Driver = made
    return driver


def _shown(answer: Any) -> str:
    text = " ".join(str(answer).split())
    return f"an array of {answer.dtype} of shape {answer.shape}, {text[:60]}{'…' * (len(text) > 60)}"
