from .action_rules import ASK, LIMITS, REASONS, ActionRules
from .asked import read_asked
from .fact_batch import ManyFacts
from .fact_forms import FactForms, Facts
from .named_actions import NamedActions, told_facts
from .offers import Counts, Offer, Offers
from .rule_answers import Interpreter
from .rule_failure import RuleFailure
from .rule_files import consult_rules, own_files, program_files, rule_file, rules_folder
from .tiers import array_compiler, choose_tier, fastest_for_many
from .vector_wrapper import LogicVectorShield, of_each
from .wrapper import LogicShield

__all__ = [
    "ASK",
    "LIMITS",
    "REASONS",
    "ActionRules",
    "Counts",
    "FactForms",
    "Facts",
    "Interpreter",
    "LogicShield",
    "LogicVectorShield",
    "ManyFacts",
    "NamedActions",
    "Offer",
    "Offers",
    "RuleFailure",
    "array_compiler",
    "choose_tier",
    "consult_rules",
    "fastest_for_many",
    "of_each",
    "own_files",
    "program_files",
    "read_asked",
    "rule_file",
    "rules_folder",
    "told_facts",
]
