from .decision_picture import draw_decision
from .dimension_line import Dimension, dimension
from .drawing import check_picture_path, draw_scene, save_picture, scene_png
from .reason_clauses import Reason, ReasonClauses, RuleClause, clause_text, split_objections
from .reasons import SECTIONS, BusySection, Objection, busy_sections, objections, objections_to, speed_reason

__all__ = [
    "SECTIONS",
    "BusySection",
    "Dimension",
    "Objection",
    "Reason",
    "ReasonClauses",
    "RuleClause",
    "busy_sections",
    "check_picture_path",
    "clause_text",
    "dimension",
    "draw_decision",
    "draw_scene",
    "objections",
    "objections_to",
    "save_picture",
    "scene_png",
    "speed_reason",
    "split_objections",
]
