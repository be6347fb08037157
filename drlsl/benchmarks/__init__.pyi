from .inference_speed import inferences_per_second as inferences_per_second
from .inference_speed import program_times as program_times
from .program_set import Times as Times
from .program_set import compare_folder as compare_folder
from .program_set import geometric_mean as geometric_mean
from .rule_speed import array_facts as array_facts
from .rule_speed import random_scenes as random_scenes
from .rule_speed import rule_speeds as rule_speeds
from .step_speed import VEHICLES as VEHICLES
from .step_speed import env_speeds as env_speeds
from .training_speed import training_speeds as training_speeds

__all__ = [
    "VEHICLES",
    "Times",
    "array_facts",
    "compare_folder",
    "env_speeds",
    "geometric_mean",
    "inferences_per_second",
    "program_times",
    "random_scenes",
    "rule_speeds",
    "training_speeds",
]
