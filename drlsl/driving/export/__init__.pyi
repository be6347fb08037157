from .exported_folder import FORMATS, Format, export_rules
from .js_files import js_page_module
from .rule_program import RuleProgram
from .scenes import draw_scenes
from .stored import StoredDecision, decide_all

__all__ = [
    "FORMATS",
    "Format",
    "RuleProgram",
    "StoredDecision",
    "decide_all",
    "draw_scenes",
    "export_rules",
    "js_page_module",
]
