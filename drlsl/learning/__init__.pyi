from .any_driver import load_driver
from .checkpoint import Kind, load_state
from .config import (
    EXAMPLE,
    NetworkConfig,
    PpoConfig,
    TrainConfig,
    dump_yaml,
    load_config,
    make_config,
    merged,
    preset_names,
    preset_values,
    with_value,
)
from .dqn import greedy_choice
from .episode import EpisodeSummary, evaluation_seed
from .evaluation import EVALUATION_KEY, ShieldState, as_record, drive, make_evaluation_env
from .figures import FIGURES, moving_average
from .fleet import VectorHighway, space_sizes
from .masked_ppo import require_masked_ppo, train_masked_ppo
from .network_factory import factory_file
from .onnx_export import export_onnx
from .overview import RunOverview, differing_settings, find_runs, overview_of
from .replay import Replay
from .rundir import CHECKPOINT, METRIC_COLUMNS, METRICS, MODEL, RunFolder, next_free_folder
from .session import Session, changed_rules, load_policy, make_training_env, train
from .stacked_session import StackedSession
from .stacked_trainer import StackedTrainer, check_stackable
from .totals import Totals, time_saved, times_of
from .trainer import StepEvent, Trainer, make_learner

__all__ = [
    "CHECKPOINT",
    "EVALUATION_KEY",
    "EXAMPLE",
    "FIGURES",
    "METRICS",
    "METRIC_COLUMNS",
    "MODEL",
    "EpisodeSummary",
    "Kind",
    "NetworkConfig",
    "PpoConfig",
    "Replay",
    "RunFolder",
    "RunOverview",
    "Session",
    "ShieldState",
    "StackedSession",
    "StackedTrainer",
    "StepEvent",
    "Totals",
    "TrainConfig",
    "Trainer",
    "VectorHighway",
    "as_record",
    "changed_rules",
    "check_stackable",
    "differing_settings",
    "drive",
    "dump_yaml",
    "evaluation_seed",
    "export_onnx",
    "factory_file",
    "find_runs",
    "greedy_choice",
    "load_config",
    "load_driver",
    "load_policy",
    "load_state",
    "make_config",
    "make_evaluation_env",
    "make_learner",
    "make_training_env",
    "merged",
    "moving_average",
    "next_free_folder",
    "overview_of",
    "preset_names",
    "preset_values",
    "require_masked_ppo",
    "space_sizes",
    "time_saved",
    "times_of",
    "train",
    "train_masked_ppo",
    "with_value",
]
