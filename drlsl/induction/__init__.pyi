from .clause_search import SECONDS, Found, search
from .domain import Domain, Effort, Examined, Progress, unseen
from .examples import Examples
from .learning_rounds import LearningRun, Learnt, Round
from .quantities import Bias, Quantity
from .search_problem import LearntClause, SearchProblem, covered

__all__ = [
    "SECONDS",
    "Bias",
    "Domain",
    "Effort",
    "Examined",
    "Examples",
    "Found",
    "LearningRun",
    "Learnt",
    "LearntClause",
    "Progress",
    "Quantity",
    "Round",
    "SearchProblem",
    "covered",
    "search",
    "unseen",
]
