from .compiled import ASKED as ASKED
from .compiled import ENTRY as ENTRY
from .compiled import FREE as FREE
from .compiled import SPEED as SPEED
from .compiled import STATE as STATE
from .dispatch import choose_tier as choose_tier
from .shield import LIMITS as LIMITS
from .shield import OBSERVATION_SIZE as OBSERVATION_SIZE
from .shield import Decision as Decision
from .shield import RuleFailure as RuleFailure
from .shield import Shield as Shield
from .shield import consult_rules as consult_rules
from .shield import default_rules as default_rules
from .shield import rule_file as rule_file
from .shield import rules_folder as rules_folder

__all__ = [
    "ASKED",
    "ENTRY",
    "FREE",
    "LIMITS",
    "OBSERVATION_SIZE",
    "SPEED",
    "STATE",
    "Decision",
    "RuleFailure",
    "Shield",
    "choose_tier",
    "consult_rules",
    "default_rules",
    "rule_file",
    "rules_folder",
]
