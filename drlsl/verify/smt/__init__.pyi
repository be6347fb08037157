from .booleans import Bool, leaves
from .formula import Finite, Formula, NotTranslatable, Row
from .known_answers import KnownAnswers
from .polynomials import Polynomial, Rational
from .second import Judges, SolverChoice
from .solver import Outcome, Solver, answers_file
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
    "KnownAnswers",
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
    "answers_file",
    "leaves",
]
