"""Plain functions as machine code, compiled when they are first used."""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import cache
from typing import Any, Final, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

from drlsl.files import cache_folder

_LOG: Final = logging.getLogger(__name__)

F = TypeVar("F", bound=Callable[..., Any])

Floats1: TypeAlias = npt.NDArray[np.float64]
Floats2: TypeAlias = npt.NDArray[np.float64]
Floats3: TypeAlias = npt.NDArray[np.float64]
Singles1: TypeAlias = npt.NDArray[np.float32]
Singles2: TypeAlias = npt.NDArray[np.float32]
Halves1: TypeAlias = npt.NDArray[np.uint16]
Halves2: TypeAlias = npt.NDArray[np.uint16]
Integers1: TypeAlias = npt.NDArray[np.int64]
Integers2: TypeAlias = npt.NDArray[np.int64]
Mask1: TypeAlias = npt.NDArray[np.bool_]
Mask2: TypeAlias = npt.NDArray[np.bool_]
Words1: TypeAlias = npt.NDArray[np.int32]
Words2: TypeAlias = npt.NDArray[np.int32]
"""Arrays that machine code takes, of so many axes, in C order; words may be read-only, halves are bits."""


def machine_code(function: F) -> F:
    """Return a function of numbers and arrays as machine code, which gives the same results to the bit.

    Its annotations say what it takes: `bool`, `int`, `float`, and `Floats1` to `Words2` for arrays. Where a
    number of float32 meets a Python float, it must say which type is meant: NumPy takes the former, Numba the
    latter. If Numba does not load, the function itself is returned, and a warning is logged once.

    Raises:
        TypeError: an annotation is another one.
    """
    compiled: F = _machine_code(function)
    return compiled


@cache
def _machine_code(function: Callable[..., Any]) -> Any:
    compiled = _compiler()
    return function if compiled is None else compiled(function)


@cache
def _compiler() -> Callable[[Callable[..., Any]], Callable[..., Any]] | None:
    try:
        from drlsl.lowering.backends.numba_compile import compiled_function
    except ImportError as problem:
        _LOG.warning("driving is slow, since numba does not load: %s", problem)
        return None
    return lambda function: compiled_function(function, cache_folder() / "code")
