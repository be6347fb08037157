from .benchmark import benchmark
from .cluster import RayWorkers
from .computer import cores
from .folder import STUDY, StudyFolder
from .local import LocalWorkers
from .plan import StudyConfig, dump_study, load_study, preset_study, with_changes
from .report import write_report
from .results import collect
from .task_order import Progress, work
from .tasks import inputs_of, perform
from .workers import Workers

__all__ = [
    "STUDY",
    "LocalWorkers",
    "Progress",
    "RayWorkers",
    "StudyConfig",
    "StudyFolder",
    "Workers",
    "benchmark",
    "collect",
    "cores",
    "dump_study",
    "inputs_of",
    "load_study",
    "perform",
    "preset_study",
    "with_changes",
    "work",
    "write_report",
]
