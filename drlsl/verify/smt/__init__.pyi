from .booleans import Bool, Booleans, holds, leaves
from .formula import Constant, Finite, Formula, NotTranslatable, Row
from .known_answers import KnownAnswers
from .polynomials import Polynomial, Rational, evaluate
from .second import Judges, SolverChoice
from .solver import Outcome, Solver, answers_file
from .symbolic import FOCUS, NOBODY, Model, SymbolicScene
from .values import Algebra, Value

__all__ = [
    "FOCUS",
    "NOBODY",
    "Algebra",
    "Bool",
    "Booleans",
    "Constant",
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
    "evaluate",
    "holds",
    "leaves",
]
