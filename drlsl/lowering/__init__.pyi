from .backends import (
    ArrayProgram,
    BatchAnswer,
    BatchProgram,
    Rows,
    Scalar,
    compile_numba,
    compile_numpy,
    compile_scalar,
    compile_torch,
)
from .check import Finding, PredicateReport, Report, check_program, find_mistakes
from .frontend import Answer, Lowered, Mode, Query, lower
from .ir import NotLowerable, Relation, Schema, Undecided

__all__ = [
    "Answer",
    "ArrayProgram",
    "BatchAnswer",
    "BatchProgram",
    "Finding",
    "Lowered",
    "Mode",
    "NotLowerable",
    "PredicateReport",
    "Query",
    "Relation",
    "Report",
    "Rows",
    "Scalar",
    "Schema",
    "Undecided",
    "check_program",
    "compile_numba",
    "compile_numpy",
    "compile_scalar",
    "compile_torch",
    "find_mistakes",
    "lower",
]
