from .comparison import Comparison, compare
from .inference_speed import inferences_per_second, program_times
from .measurements import MEASUREMENTS
from .program_set import Times, compare_folder, geometric_mean
from .rule_speed import array_facts, random_scenes, rule_speeds
from .step_speed import VEHICLES, any_offered, env_speeds, steady_envs, steady_traffic
from .training_speed import training_speeds

__all__ = [
    "MEASUREMENTS",
    "VEHICLES",
    "Comparison",
    "Times",
    "any_offered",
    "array_facts",
    "compare",
    "compare_folder",
    "env_speeds",
    "geometric_mean",
    "inferences_per_second",
    "program_times",
    "random_scenes",
    "rule_speeds",
    "steady_envs",
    "steady_traffic",
    "training_speeds",
]
