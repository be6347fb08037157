from .case_rows import EgoRow, LaneRow, RoadRow, Staging, VehicleRow
from .case_runs import Outcome, run_cases
from .coverage import Coverage, measure
from .mutation import Score, Verdict, score
from .survivors import reasons_of
from .tables import load_table, tables_of
from .witness import Witness

__all__ = [
    "Coverage",
    "EgoRow",
    "LaneRow",
    "Outcome",
    "RoadRow",
    "Score",
    "Staging",
    "VehicleRow",
    "Verdict",
    "Witness",
    "load_table",
    "measure",
    "reasons_of",
    "run_cases",
    "score",
    "tables_of",
]
