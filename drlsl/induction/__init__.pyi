from .bias import OPENINGS, Bias, Quantity
from .clause_search import SECONDS, Found, search
from .examination import BadChange, Stressed, stressed
from .examples import Examples
from .label_cache import cached_changes
from .labelled_changes import Changes, Label, Labelling, label_changes
from .learning_report import LearningReport, ReportRequest
from .learning_rounds import LearningRun, LearnRequest, Learnt, Round
from .learnt_table import write_table
from .search_problem import LearntClause, SearchProblem, covered

__all__ = [
    "OPENINGS",
    "SECONDS",
    "BadChange",
    "Bias",
    "Changes",
    "Examples",
    "Found",
    "Label",
    "Labelling",
    "LearnRequest",
    "LearningReport",
    "LearningRun",
    "Learnt",
    "LearntClause",
    "Quantity",
    "ReportRequest",
    "Round",
    "SearchProblem",
    "Stressed",
    "cached_changes",
    "covered",
    "label_changes",
    "search",
    "stressed",
    "write_table",
]
