from .case_rows import EgoRow, LaneRow, RoadRow, Staging, VehicleRow
from .case_runs import Outcome, run_cases
from .coverage import Coverage, measure
from .driving_rules import DrivingRules
from .driving_table import load_table
from .mutation import Score, Verdict, score
from .survivors import reasons_of
from .tables import load_tables, load_told_rules, tables_of
from .tested_rules import TestedRules
from .told_facts import ToldFacts, facts_row, flow
from .witness import Witness

__all__ = [
    "Coverage",
    "DrivingRules",
    "EgoRow",
    "LaneRow",
    "Outcome",
    "RoadRow",
    "Score",
    "Staging",
    "TestedRules",
    "ToldFacts",
    "VehicleRow",
    "Verdict",
    "Witness",
    "facts_row",
    "flow",
    "load_table",
    "load_tables",
    "load_told_rules",
    "measure",
    "reasons_of",
    "run_cases",
    "score",
    "tables_of",
]
