from .booleans import Bool, leaves
from .formula import Finite, Formula, NotTranslatable, Row
from .polynomials import Polynomial, Rational
from .second import Judges, SolverChoice
from .solver import Outcome, Solver
from .symbolic import FOCUS, NOBODY, Model, SymbolicScene
from .values import Algebra, Value

__all__ = [
    "FOCUS",
    "NOBODY",
    "Algebra",
    "Bool",
    "Finite",
    "Formula",
    "Judges",
    "Model",
    "NotTranslatable",
    "Outcome",
    "Polynomial",
    "Rational",
    "Row",
    "Solver",
    "SolverChoice",
    "SymbolicScene",
    "Value",
    "leaves",
]
