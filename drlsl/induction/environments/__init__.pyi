from .environment_domain import EnvironmentDomain, EnvRequest
from .environment_report import write_environment_report
from .learning_domain import SHIPPED, LearningDomain, NamedDomain, Step, find_domain
from .learnt_states import write_states_table
from .lookahead import Lookahead, Verdict
from .shipped_domains import frozen_lake, highway_env
from .state_bias import StateBias

__all__ = [
    "SHIPPED",
    "EnvRequest",
    "EnvironmentDomain",
    "LearningDomain",
    "Lookahead",
    "NamedDomain",
    "StateBias",
    "Step",
    "Verdict",
    "find_domain",
    "frozen_lake",
    "highway_env",
    "write_environment_report",
    "write_states_table",
]
