"""Validation of actions that are given to an environment.

The criterion is Gymnasium's `Discrete`: integers from 0 to 2 of any type, NumPy's included, and arrays of no
dimension. A float is refused, 2.0 included, because a computed number may be 2.9999 the next time. So is a
bool, though Python counts it among the integers: it comes from a mask, not from a choice.
"""

from __future__ import annotations

import reprlib
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from drlsl.driving.scene.actions import ATOMS, Action
from drlsl.traffic import Integers

COUNT: Final = len(Action)
KNOWN: Final = ", ".join(f"{number} {atom}" for number, atom in enumerate(ATOMS))


def one_action(given: Any) -> int:
    """Return the number of an action.

    Raises:
        TypeError: it is not an integer.
        ValueError: no action has that number.
    """
    if isinstance(given, int) and not isinstance(given, bool):
        number = given
    elif isinstance(given, np.integer | np.ndarray) and given.shape == () and given.dtype.kind in "iu":
        number = int(given)
    else:
        raise TypeError(f"the action is {_shown(given)}; expected an integer: {KNOWN}")
    if not 0 <= number < COUNT:
        raise ValueError(f"unknown action {_shown(given)}; expected {KNOWN}")
    return number


def several_actions(given: Any, count: int) -> Integers:
    """Return the numbers of `count` actions, shape (N,), from an array of integers or a sequence of them.

    Raises:
        TypeError: they are not integers.
        ValueError: their number or shape is wrong, or a number is not an action's.
    """
    numbers = given if type(given) is np.ndarray else _array(given, count)
    if numbers.dtype.kind not in "iu":
        raise TypeError(f"the actions are {_shown(given)}; expected {count} integers: {KNOWN}")
    if numbers.shape != (count,):
        raise ValueError(
            f"the actions {_shown(given)} are of shape {numbers.shape}; expected ({count},), one for each "
            "environment"
        )
    if count == 1:  # sooner than by NumPy's functions
        return np.array([one_action(numbers.item())], dtype=np.int64)
    unsigned = numbers.astype(np.uint64)  # in which a negative number is a large one
    if np.maximum.reduce(unsigned) >= COUNT:
        raise ValueError(f"unknown action in {_shown(given)}; expected {KNOWN}")
    return unsigned.view(np.int64)


def _array(given: Any, count: int) -> npt.NDArray[Any]:
    """Return the given actions as an array; a sequence must hold integers, which NumPy would not check."""
    if isinstance(given, list | tuple):
        if len(given) != count:
            raise ValueError(
                f"{len(given)} actions {_shown(given)}; expected {count}: one for each environment"
            )
        return np.array([one_action(item) for item in given], dtype=np.int64)
    if isinstance(given, np.ma.MaskedArray) or not hasattr(given, "__array__"):
        raise TypeError(f"the actions are {_shown(given)}; expected an array of {count} integers: {KNOWN}")
    return np.asarray(given)


def _shown(given: object) -> str:
    """Return the given value as text, short and in one line."""
    return " ".join(reprlib.repr(given).split())
