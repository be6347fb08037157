from .comparison import MEASUREMENTS, Comparison, compare_checkouts
from .inference_speed import inferences_per_second, program_times
from .program_set import Times, compare_folder, geometric_mean
from .rule_speed import array_facts, random_scenes, rule_speeds
from .step_speed import VEHICLES, env_speeds
from .training_speed import training_speeds

__all__ = [
    "MEASUREMENTS",
    "VEHICLES",
    "Comparison",
    "Times",
    "array_facts",
    "compare_checkouts",
    "compare_folder",
    "env_speeds",
    "geometric_mean",
    "inferences_per_second",
    "program_times",
    "random_scenes",
    "rule_speeds",
    "training_speeds",
]
