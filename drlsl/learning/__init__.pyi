from .checkpoint import Kind, load_state, write_atomic
from .dqn import greedy_choice
from .evaluation import EVALUATION_KEY, ShieldState, Totals, as_record, drive, make_evaluation_env
from .figures import FIGURES, moving_average
from .fleet import VectorHighway, space_sizes
from .lock import FolderLock
from .network_factory import factory_file
from .rundir import CHECKPOINT, METRIC_COLUMNS, METRICS, RunFolder, next_free_folder
from .seal import check_text, open_values, seal_text, seal_values
from .session import Session, load_policy, make_training_env, train
from .trainer import StepEvent, Trainer, make_learner

__all__ = [
    "CHECKPOINT",
    "EVALUATION_KEY",
    "FIGURES",
    "METRICS",
    "METRIC_COLUMNS",
    "FolderLock",
    "Kind",
    "RunFolder",
    "Session",
    "ShieldState",
    "StepEvent",
    "Totals",
    "Trainer",
    "VectorHighway",
    "as_record",
    "check_text",
    "drive",
    "factory_file",
    "greedy_choice",
    "load_policy",
    "load_state",
    "make_evaluation_env",
    "make_learner",
    "make_training_env",
    "moving_average",
    "next_free_folder",
    "open_values",
    "seal_text",
    "seal_values",
    "space_sizes",
    "train",
    "write_atomic",
]
