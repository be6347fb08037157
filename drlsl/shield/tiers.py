"""The choice of the tier that runs a rule program."""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from typing import Any, Final, TypeAlias, TypeVar

from drlsl.errors import UserError
from drlsl.files import cache_folder
from drlsl.lowering.backends import BatchProgram, compile_numpy
from drlsl.lowering.frontend import Lowered
from drlsl.lowering.ir import NotLowerable

_LOG: Final = logging.getLogger(__name__)

TIERS: Final = ("auto", "interpreter", "scalar", "numpy", "numba", "torch")

ARRAY_TIERS: Final = ("numpy", "numba", "torch")
"""Those that answer for many scenes in one call."""

Compiler: TypeAlias = Callable[[Lowered], BatchProgram[Any]]
"""Makes an array program."""

T = TypeVar("T")


def check_tier(name: str) -> str:
    """Return the name of a tier.

    Raises:
        UserError: there is none of this name, or its library is not installed.
    """
    if name not in TIERS:
        raise UserError.no_such("tier", name, TIERS)
    if name in ("numba", "torch"):
        array_compiler(name)
    return name


def choose_tier(requested: str, interpreter: T, lowered: Callable[[str], T], fastest: Callable[[], T]) -> T:
    """Return the tier of the name `requested`, made by `lowered`; `auto` is the one that `fastest` makes.

    Raises:
        UserError: the tier cannot run the program, or its library is missing.
    """
    if requested == "interpreter":
        return interpreter
    try:
        return fastest() if requested == "auto" else lowered(requested)
    except NotLowerable as problem:
        if requested != "auto":
            raise UserError(f"the {requested} tier cannot run these rules: {problem}") from problem
        _LOG.warning("the rules run on the interpreter, which is slow: %s", problem)
        return interpreter


def fastest_for_many(lowered: Callable[[str], T], by_size: Callable[[T, T], T]) -> T:
    """Return the Numba tier if Numba is installed, else scalar for few and NumPy for many, joined `by_size`.

    Raises:
        NotLowerable: only the interpreter can run the program.
    """
    if find_spec("numba") is not None:
        try:
            return lowered("numba")
        except ImportError as problem:
            _LOG.warning("the rules run on the numpy tier, since numba does not load: %s", problem)
    return by_size(lowered("scalar"), lowered("numpy"))


def array_compiler(name: str) -> Compiler:
    """Return the compiler of a tier's array programs; its library is loaded here.

    Raises:
        UserError: the library is not installed.
    """
    if name == "numpy":
        return compile_numpy
    if name == "torch":
        if find_spec("torch") is None:
            raise UserError("the torch tier needs PyTorch, which is missing: pip install 'drlsl[train]'")
        from drlsl.lowering.backends import compile_torch

        return compile_torch
    if find_spec("numba") is None:
        raise UserError("the numba tier needs numba, which is not installed: pip install numba")
    from drlsl.lowering.backends import compile_numba

    return partial(compile_numba, folder=cache_folder() / "rules")
