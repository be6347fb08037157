"""The loops that Numba compiles, run by Python instead: that tests what they say, and compiles nothing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np

from drlsl.lowering.backends.array_loops import ArrayLoopPrinter
from drlsl.lowering.backends.loop_ops import CALLED
from drlsl.lowering.backends.numba_backend import NumbaProgram
from drlsl.lowering.frontend import Lowered

_KINDS: Final = {"bool": np.dtype(np.bool_), "int": np.dtype(np.int64), "float": np.dtype(np.float64)}


def compile_plain(lowered: Lowered) -> NumbaProgram:
    """The program of `compile_numba`, slow."""
    printer = ArrayLoopPrinter(lowered)
    return NumbaProgram(lowered, printer, _function(printer))


def _function(printer: ArrayLoopPrinter) -> Callable[..., bool]:
    """As choosy about its arguments as machine code is."""
    namespace = dict(CALLED)
    exec(compile(printer.module(), "<loops>", "exec"), namespace)  # noqa: S102  (the text is made by the printer)
    parameters = printer.parameters

    def answer(*arguments: Any) -> bool:
        for parameter, array in zip(parameters, arguments, strict=True):
            fits = isinstance(array, np.ndarray) and array.dtype == _KINDS[parameter.kind]
            if not fits or array.ndim != parameter.axes or not array.flags.c_contiguous:
                raise TypeError(f"{parameter.name}: {array!r}")
        with np.errstate(all="ignore"):
            return bool(namespace["answer"](*arguments))

    return answer
