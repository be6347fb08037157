"""A Prolog to embed: standard library only.

from drlsl.logic import Engine

engine = Engine()
engine.consult_text("parent(ada, byron). parent(byron, clara).")
[solution["X"] for solution in engine.query("parent(X, _)")]
"""

from drlsl.logic.conversion import Compound, Solution, String, Variable, to_plain
from drlsl.logic.engine import Engine, Query
from drlsl.logic.errors import (
    DomainError,
    EvaluationError,
    ExistenceError,
    Halt,
    InstantiationError,
    PrologError,
    PrologPermissionError,
    PrologSyntaxError,
    PrologTypeError,
    RepresentationError,
    ResourceError,
)
from drlsl.logic.limits import LimitExceeded, Limits
from drlsl.logic.loading import ConsultError, LoadWarning

__all__ = [
    "Compound",
    "ConsultError",
    "DomainError",
    "Engine",
    "EvaluationError",
    "ExistenceError",
    "Halt",
    "InstantiationError",
    "LimitExceeded",
    "Limits",
    "LoadWarning",
    "PrologError",
    "PrologPermissionError",
    "PrologSyntaxError",
    "PrologTypeError",
    "Query",
    "RepresentationError",
    "ResourceError",
    "Solution",
    "String",
    "Variable",
    "to_plain",
]
