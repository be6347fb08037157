from .decision_picture import draw_decision as draw_decision
from .drawing import check_picture_path as check_picture_path
from .drawing import draw_scene as draw_scene
from .drawing import save_picture as save_picture
from .reasons import SECTIONS as SECTIONS
from .reasons import BusySection as BusySection
from .reasons import Objection as Objection
from .reasons import busy_sections as busy_sections
from .reasons import objections as objections
from .reasons import objections_to as objections_to
from .reasons import speed_reason as speed_reason

__all__ = [
    "SECTIONS",
    "BusySection",
    "Objection",
    "busy_sections",
    "check_picture_path",
    "draw_decision",
    "draw_scene",
    "objections",
    "objections_to",
    "save_picture",
    "speed_reason",
]
