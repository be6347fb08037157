from .action_names import unknown_actions
from .compiled import ASKED, query_of
from .decision import OBSERVATION_SIZE, Decision, Decisions, RuleFailure
from .questions import ACTIONS, ENTRY, FREE, LANE, SPEED, STATE
from .rule_files import consult_rules, default_rules, rule_file, rules_folder
from .shield import LIMITS, Shield

__all__ = [
    "ACTIONS",
    "ASKED",
    "ENTRY",
    "FREE",
    "LANE",
    "LIMITS",
    "OBSERVATION_SIZE",
    "SPEED",
    "STATE",
    "Decision",
    "Decisions",
    "RuleFailure",
    "Shield",
    "consult_rules",
    "default_rules",
    "query_of",
    "rule_file",
    "rules_folder",
    "unknown_actions",
]
