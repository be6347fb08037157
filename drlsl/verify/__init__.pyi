from .gallery import write_counterexample
from .prove import Prover, Status, Task
from .ranges import NAMES, RANGES, Case, decimal
from .report import Report, Request, Result, verify

__all__ = [
    "NAMES",
    "RANGES",
    "Case",
    "Prover",
    "Report",
    "Request",
    "Result",
    "Status",
    "Task",
    "decimal",
    "verify",
    "write_counterexample",
]
