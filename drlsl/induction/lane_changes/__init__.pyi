from .change_examples import ChangeExamples
from .examination import BadChange, Stressed, stressed
from .label_cache import cached_changes
from .labelled_changes import Changes, Label, Labelling, label_changes
from .lane_change_domain import LaneChanges, LearnRequest
from .learning_report import LearningReport, ReportRequest
from .learnt_table import write_table
from .scene_bias import OPENINGS, SceneBias

__all__ = [
    "OPENINGS",
    "BadChange",
    "ChangeExamples",
    "Changes",
    "Label",
    "Labelling",
    "LaneChanges",
    "LearnRequest",
    "LearningReport",
    "ReportRequest",
    "SceneBias",
    "Stressed",
    "cached_changes",
    "label_changes",
    "stressed",
    "write_table",
]
