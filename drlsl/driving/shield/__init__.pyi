from .action_names import unknown_actions
from .compiled import ASKED, check_state, query_of
from .decision import NO_WISH, Decision, Decisions, RuleFailure
from .highway_rules import default_rules
from .observation import PAPER_OBSERVATION, ObservationSpace, declared_observation
from .questions import (
    ACTIONS,
    BOUNDS,
    COMFORT,
    ENTRY,
    FREE,
    LANE,
    NAMES,
    SPEED,
    STATE,
    Question,
    questions_of_a_decision,
)
from .scene_program import SceneProgram
from .shield import LIMITS, Shield

__all__ = [
    "ACTIONS",
    "ASKED",
    "BOUNDS",
    "COMFORT",
    "ENTRY",
    "FREE",
    "LANE",
    "LIMITS",
    "NAMES",
    "NO_WISH",
    "PAPER_OBSERVATION",
    "SPEED",
    "STATE",
    "Decision",
    "Decisions",
    "ObservationSpace",
    "Question",
    "RuleFailure",
    "SceneProgram",
    "Shield",
    "check_state",
    "declared_observation",
    "default_rules",
    "query_of",
    "questions_of_a_decision",
    "unknown_actions",
]
