from .action_space import one_action, several_actions
from .actions import ATOMS, Action, action_of_atom
from .batch import EGO_ID, SceneBatch
from .ego_limits import ACCELERATION_LIMIT, BRAKING_LIMIT, CENTRE_TOLERANCE, EGO_LIMITS
from .facts import SCHEMA, Facts, Row, facts_of, road_facts, scene_facts
from .model import EGO, Road, Scene, Vehicle, bumper_gap
from .rows import copied, put_rows, taken_rows, with_rows
from .scene_file import load_scene, parse_scene, scene_defaults, scene_json, write_scenes

__all__ = [
    "ACCELERATION_LIMIT",
    "ATOMS",
    "BRAKING_LIMIT",
    "CENTRE_TOLERANCE",
    "EGO",
    "EGO_ID",
    "EGO_LIMITS",
    "SCHEMA",
    "Action",
    "Facts",
    "Road",
    "Row",
    "Scene",
    "SceneBatch",
    "Vehicle",
    "action_of_atom",
    "bumper_gap",
    "copied",
    "facts_of",
    "load_scene",
    "one_action",
    "parse_scene",
    "put_rows",
    "road_facts",
    "scene_defaults",
    "scene_facts",
    "scene_json",
    "several_actions",
    "taken_rows",
    "with_rows",
    "write_scenes",
]
