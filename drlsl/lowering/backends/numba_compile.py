"""Numba as the compiler of generated text, with what it compiled kept on disk.

Numba keeps machine code beside the file of a function, so the text is written to a file of its own, named
after all that the code depends on: the text, the functions that it calls, and Numba's version.
"""

from __future__ import annotations

import ctypes
import hashlib
import importlib.util
import inspect
import logging
import pickle
import sys
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, Final

import llvmlite.binding
import numba
from numba import types
from numba.extending import overload, register_jitable

from drlsl.files import written_whole
from drlsl.logic.core import NODES, Operation
from drlsl.lowering.backends import loop_ops
from drlsl.lowering.backends.array_loops import ArrayLoopPrinter, Kind, Parameter
from drlsl.lowering.backends.loop_ops import CALLED, LIBRARY, OPS

_LOG: Final = logging.getLogger(__name__)
_TYPES: Final[dict[Kind, Any]] = {"bool": types.boolean, "int": types.int64, "float": types.float64}
_BROKEN: Final = (
    OSError,
    EOFError,
    pickle.UnpicklingError,
    ValueError,
    RuntimeError,
    AttributeError,
    ImportError,
)
"""Exceptions of numba if its cache cannot be used or is damaged."""


def compiled(printer: ArrayLoopPrinter, folder: Path | None) -> Callable[..., bool]:
    """Return the function of `printer`'s text as machine code, from `folder` if it was compiled before.

    If the folder cannot be used, a warning is logged and the function compiled anew.
    """
    _make_known()
    text = printer.module()
    signature = types.boolean(
        *(
            _type(parameter, readonly=True)
            for given in printer.given.values()
            for parameter in given.parameters
        ),
        *(_type(parameter, readonly=False) for parameter in printer.results),
    )
    if folder is not None:
        try:
            return _cached(text, signature, folder)
        except _BROKEN as error:
            _LOG.warning("%s: the machine code of rules cannot be kept there (%s)", folder, error)
    namespace = dict(CALLED)
    exec(compile(text, "<lowered rules>", "exec"), namespace)  # noqa: S102  (the text is made here)
    return _jit(namespace["answer"], signature, keep=False)


def _type(parameter: Parameter, *, readonly: bool) -> Any:
    return types.Array(_TYPES[parameter.kind], parameter.axes, "C", readonly=readonly)


def _jit(function: Callable[..., Any], signature: Any, *, keep: bool) -> Callable[..., bool]:
    jitted = numba.njit(cache=keep, error_model="numpy", nogil=True)(function)
    if keep:
        folder, name = Path(str(jitted.stats.cache_path)), function.__module__
        _drop_damaged(folder, name)
        jitted.compile(signature)
        _seal(folder, name)
    else:
        jitted.compile(signature)
    jitted.disable_compile()
    checked: Callable[..., bool] = jitted
    return checked


def _drop_damaged(folder: Path, name: str) -> None:
    """Remove Numba's files for a text if they were changed: machine code is run unchecked."""
    for path in _kept(folder, name):
        seal = _seal_of(path)
        known = seal.read_text(encoding="utf-8") if seal.is_file() else None
        if known != _digest_of(path):
            if known is not None:
                _LOG.warning("%s: damaged machine code of rules, made anew", path)
            path.unlink(missing_ok=True)


def _seal(folder: Path, name: str) -> None:
    """Write the checksums of Numba's files for a text."""
    for path in _kept(folder, name):
        _write(_seal_of(path), _digest_of(path))


def _kept(folder: Path, name: str) -> list[Path]:
    return [path for path in folder.glob(f"{name}.*") if path.suffix in (".nbi", ".nbc")]


def _seal_of(path: Path) -> Path:
    return path.with_name(f"{path.name}.sha256")


def _digest_of(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _cached(text: str, signature: Any, folder: Path) -> Callable[..., bool]:
    name = f"rules_{_digest(text)}"
    known = sys.modules.get(name)
    if known is None:
        path = folder / f"{name}.py"
        _write(path, text)
        spec = importlib.util.spec_from_file_location(name, path)
        assert spec is not None
        known = importlib.util.module_from_spec(spec)
        vars(known).update(CALLED)
        exec(compile(text, path, "exec"), vars(known))  # noqa: S102  (the text is made here)
        sys.modules[name] = known  # where numba searches it when it loads machine code
        try:
            known.answer = _jit(known.answer, signature, keep=True)  # type: ignore[attr-defined]  # made by the text
        except BaseException:
            del sys.modules[name]
            raise
    function: Callable[..., bool] = known.answer
    return function


def _digest(text: str) -> str:
    digest = hashlib.sha256(f"{numba.__version__}\n{text}".encode())
    for called in (str(loop_ops.__file__), inspect.getfile(NODES["round"].compute)):
        digest.update(Path(called).read_bytes())
    return digest.hexdigest()[:24]


def _write(path: Path, text: str) -> None:
    """Write a file, whole or not at all, unless it is there already."""
    if path.is_file() and path.read_text(encoding="utf-8") == text:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    with written_whole(path) as file:
        file.write(text.encode())


@cache
def _make_known() -> Sequence[Any]:
    """Register with numba the functions that generated code calls; the result must be kept.

    The functions of the C library are called through Python: compilers know some of them too well, and
    replace them by others that differ in the last bit.
    """
    for function in OPS.values():
        register_jitable(function)
    return [_make_library_known(name, row) for name, row in LIBRARY.items()]


def _make_library_known(name: str, row: Operation) -> Any:
    whole = row.kind == "whole"
    number, word = (types.int64, ctypes.c_int64) if whole else (types.float64, ctypes.c_double)
    callback = ctypes.CFUNCTYPE(word, *[word] * row.arity)(row.compute)
    llvmlite.binding.add_symbol(f"drlsl_{name}", ctypes.cast(callback, ctypes.c_void_p).value)
    called = types.ExternalFunction(f"drlsl_{name}", number(*[number] * row.arity))
    if row.arity == 2:
        overload(row.compute)(lambda left, right: lambda left, right: called(left, right))
    else:
        overload(row.compute)(lambda value: lambda value: called(value))
    return callback
