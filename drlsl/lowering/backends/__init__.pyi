from .answer_lists import tree_nodes
from .arrays import ArrayPrinter
from .batch_program import BatchAnswer, BatchProgram, Rows, TextProgram
from .c_backend import CProgram, c_program, c_support
from .js_backend import js_source, js_support
from .numba_backend import compile_numba, numba_source
from .numpy_backend import ArrayProgram, compile_numpy, numpy_source
from .numpy_ops import Array, Ops
from .plain_functions import (
    Floats1,
    Floats2,
    Floats3,
    Halves1,
    Halves2,
    Integers1,
    Integers2,
    Mask1,
    Mask2,
    Singles1,
    Singles2,
    Words1,
    Words2,
    machine_code,
)
from .prefetching import prefetch
from .scalar import Scalar, compile_scalar, scalar_source
from .torch_backend import compile_torch

__all__ = [
    "Array",
    "ArrayPrinter",
    "ArrayProgram",
    "BatchAnswer",
    "BatchProgram",
    "CProgram",
    "Floats1",
    "Floats2",
    "Floats3",
    "Halves1",
    "Halves2",
    "Integers1",
    "Integers2",
    "Mask1",
    "Mask2",
    "Ops",
    "Rows",
    "Scalar",
    "Singles1",
    "Singles2",
    "TextProgram",
    "Words1",
    "Words2",
    "c_program",
    "c_support",
    "compile_numba",
    "compile_numpy",
    "compile_scalar",
    "compile_torch",
    "js_source",
    "js_support",
    "machine_code",
    "numba_source",
    "numpy_source",
    "prefetch",
    "scalar_source",
    "tree_nodes",
]
