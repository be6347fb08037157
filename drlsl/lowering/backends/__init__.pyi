from .arrays import ArrayPrinter
from .batch_program import BatchAnswer, BatchProgram, Rows, TextProgram
from .numba_backend import compile_numba, numba_source
from .numpy_backend import ArrayProgram, compile_numpy, numpy_source
from .numpy_ops import Array, Ops
from .scalar import Scalar, compile_scalar, scalar_source
from .torch_backend import compile_torch

__all__ = [
    "Array",
    "ArrayPrinter",
    "ArrayProgram",
    "BatchAnswer",
    "BatchProgram",
    "Ops",
    "Rows",
    "Scalar",
    "TextProgram",
    "compile_numba",
    "compile_numpy",
    "compile_scalar",
    "compile_torch",
    "numba_source",
    "numpy_source",
    "scalar_source",
]
