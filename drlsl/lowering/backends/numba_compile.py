"""Numba as the compiler of generated text and of plain functions, with what it compiled kept on disk.

Numba keeps machine code beside the file of a function, so the text is written to a file of its own, named
after all that the code depends on: the text, the functions and constants that it uses, and Numba's version.
"""

from __future__ import annotations

import ctypes
import hashlib
import importlib.util
import inspect
import logging
import pickle
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any, Final

import llvmlite.binding
import numba
from numba import types
from numba.extending import overload, register_jitable

from drlsl.files import written_whole
from drlsl.logic.core import NODES, Operation
from drlsl.lowering.backends import loop_ops, numba_operations
from drlsl.lowering.backends.array_loops import ArrayLoopPrinter, Kind, Parameter
from drlsl.lowering.backends.loop_ops import CALLED, LIBRARY, OPS
from drlsl.lowering.backends.numba_operations import make_operations_known

_LOG: Final = logging.getLogger(__name__)
_TYPES: Final[dict[Kind, Any]] = {"bool": types.boolean, "int": types.int64, "float": types.float64}
_ANNOTATED: Final[dict[str, Any]] = {
    "None": types.void,
    "bool": types.boolean,
    "int": types.int64,
    "float": types.float64,
    **{
        f"{name}{axes}": types.Array(kind, axes, "C")
        for name, kind in (
            ("Mask", types.boolean),
            ("Integers", types.int64),
            ("Floats", types.float64),
            ("Singles", types.float32),
            ("Halves", types.uint16),
        )
        for axes in (1, 2, 3)
    },
    **{f"Words{axes}": types.Array(types.int32, axes, "C", readonly=True) for axes in (1, 2)},
}
_LEAN: Final = {"no_cfunc_wrapper": True, "_nrt": False}
"""Options that leave out a third of the work: no code for calls from C, and none that counts references.

No function that is compiled here makes an array; one that did would be refused.
"""
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
    taken = {parameter.name for given in printer.given.values() for parameter in given.parameters}
    signature = types.boolean(
        *(_type(parameter, readonly=parameter.name in taken) for parameter in printer.parameters)
    )
    files = str(loop_ops.__file__), str(numba_operations.__file__), inspect.getfile(NODES["round"].compute)
    uses = [Path(file).read_text(encoding="utf-8") for file in files]
    return _kept_or_compiled(_Text("rules", text, "answer", CALLED, uses), signature, folder)


def compiled_function(function: Callable[..., Any], folder: Path | None) -> Callable[..., Any]:
    """Return a plain function as machine code, from `folder` if it was compiled before.

    The types of its arguments and of its result are its annotations, names of `_ANNOTATED`. The functions
    that it calls, and constants of their modules that are numbers or texts, are compiled into it.

    Raises:
        TypeError: an annotation is none of these names.
    """
    called, written = list(_functions_of(function)), make_operations_known()
    for one in called:
        if one not in written:
            register_jitable(**_LEAN)(one)
    taken: list[Any] = []
    given = types.void
    for name, annotation in function.__annotations__.items():
        if annotation not in _ANNOTATED:
            raise TypeError(f"{function.__qualname__}: {name} is {annotation}, no type of `machine_code`")
        if name == "return":
            given = _ANNOTATED[annotation]
        else:
            taken.append(_ANNOTATED[annotation])
    sources = [inspect.getsource(one) for one in (function, *called)]
    text = f"from __future__ import annotations\n\n\n{sources[0]}"
    # Numba keeps where it found the functions, too.
    homes = [f"{one.__module__}.{one.__qualname__}" for one in (function, *called)]
    uses = [*homes, *sources[1:], *map(repr, _constants_of([function, *called]))]
    if any(one in written for one in called):
        uses.append(Path(str(numba_operations.__file__)).read_text(encoding="utf-8"))
    return _kept_or_compiled(
        _Text(function.__name__, text, function.__name__, function.__globals__, uses), given(*taken), folder
    )


def _functions_of(function: Callable[..., Any]) -> Iterator[Callable[..., Any]]:
    """Yield the functions of this package that a function calls, and those that they call, each once."""
    found: dict[Callable[..., Any], None] = {}
    waiting = [function]
    while waiting:
        for value in _globals_of(waiting.pop()).values():
            if isinstance(value, FunctionType) and value is not function and value not in found:
                found[value] = None
                waiting.append(value)
    yield from found


def _constants_of(functions: Sequence[Callable[..., Any]]) -> Iterator[tuple[str, Any]]:
    for function in functions:
        for name, value in sorted(_globals_of(function).items()):
            if isinstance(value, int | float | str | tuple):
                yield name, value


def _globals_of(function: Callable[..., Any]) -> dict[str, Any]:
    """Return the globals that a function names."""
    names = function.__code__.co_names
    return {name: function.__globals__[name] for name in names if name in function.__globals__}


@dataclass(frozen=True, slots=True, eq=False)
class _Text:
    """The text of one function, the names that it knows, and all else that its machine code depends on."""

    kind: str
    text: str
    name: str
    known: Mapping[str, Any]
    uses: Sequence[str]

    @property
    def module(self) -> str:
        """The name of the module that is made of the text: another one if anything differs."""
        whole = "\n".join([numba.__version__, self.text, *self.uses])
        return f"{self.kind}_{hashlib.sha256(whole.encode()).hexdigest()[:24]}"

    def tell(self) -> None:
        """Log that this is compiled now, which takes from half a second to some seconds."""
        _LOG.info("compiling %s to machine code, once", self.kind)


def _kept_or_compiled(text: _Text, signature: Any, folder: Path | None) -> Callable[..., Any]:
    """Return the function of a text as machine code; if the folder cannot be used, a warning is logged."""
    if folder is not None:
        try:
            return _cached(text, signature, folder)
        except _BROKEN as error:
            _LOG.warning("%s: machine code cannot be kept there (%s)", folder, error)
    namespace = dict(text.known)
    exec(compile(text.text, f"<{text.kind}>", "exec"), namespace)  # noqa: S102  (the text is this package's)
    return _jit(namespace[text.name], signature, text, keep=False)


def _type(parameter: Parameter, *, readonly: bool) -> Any:
    return types.Array(_TYPES[parameter.kind], parameter.axes, "C", readonly=readonly)


def _jit(function: Callable[..., Any], signature: Any, text: _Text, *, keep: bool) -> Callable[..., bool]:
    options: dict[str, Any] = {"error_model": "numpy", "nogil": True, **_LEAN}  # Numba's types lack some
    jitted = numba.njit(cache=keep, **options)(function)
    if keep:
        folder, name = Path(str(jitted.stats.cache_path)), function.__module__
        _drop_damaged(folder, name)
        if not _kept(folder, name):
            text.tell()
        jitted.compile(signature)
        _seal(folder, name)
    else:
        text.tell()
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
                _LOG.warning("%s: damaged machine code, made anew", path)
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


def _cached(text: _Text, signature: Any, folder: Path) -> Callable[..., Any]:
    name = text.module
    known = sys.modules.get(name)
    if known is None:
        path = folder / f"{name}.py"
        _write(path, text.text)
        spec = importlib.util.spec_from_file_location(name, path)
        assert spec is not None
        known = importlib.util.module_from_spec(spec)
        vars(known).update({key: value for key, value in text.known.items() if not key.startswith("__")})
        exec(compile(text.text, path, "exec"), vars(known))  # noqa: S102  (the text is this package's)
        sys.modules[name] = known  # where numba searches it when it loads machine code
        try:
            setattr(known, text.name, _jit(getattr(known, text.name), signature, text, keep=True))
        except BaseException:
            del sys.modules[name]
            raise
    function: Callable[..., Any] = getattr(known, text.name)
    return function


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
    written = make_operations_known()
    for function in OPS.values():
        if function not in written:
            register_jitable(**_LEAN)(function)
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
