from .benchmark import benchmark
from .folder import STUDY, StudyFolder
from .plan import StudyConfig, dump_study, load_study, preset_study, with_changes
from .report import write_report
from .results import collect
from .task_order import Progress, work, workers_of
from .tasks import inputs_of, perform

__all__ = [
    "STUDY",
    "Progress",
    "StudyConfig",
    "StudyFolder",
    "benchmark",
    "collect",
    "dump_study",
    "inputs_of",
    "load_study",
    "perform",
    "preset_study",
    "with_changes",
    "work",
    "workers_of",
    "write_report",
]
