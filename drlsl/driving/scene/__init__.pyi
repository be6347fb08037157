from .action_space import one_action as one_action
from .action_space import several_actions as several_actions
from .actions import ATOMS as ATOMS
from .actions import Action as Action
from .actions import action_of_atom as action_of_atom
from .batch import EGO_ID as EGO_ID
from .batch import FAIL_SAFE_MASK as FAIL_SAFE_MASK
from .batch import Decisions as Decisions
from .batch import SceneBatch as SceneBatch
from .batch import fail_safe_speed as fail_safe_speed
from .ego_limits import ACCELERATION_LIMIT as ACCELERATION_LIMIT
from .ego_limits import BRAKING_LIMIT as BRAKING_LIMIT
from .ego_limits import CENTRE_TOLERANCE as CENTRE_TOLERANCE
from .model import EGO as EGO
from .model import SCHEMA as SCHEMA
from .model import Facts as Facts
from .model import Road as Road
from .model import Row as Row
from .model import Scene as Scene
from .model import Vehicle as Vehicle
from .model import bumper_gap as bumper_gap
from .model import road_facts as road_facts
from .model import scene_facts as scene_facts
from .scene_file import load_scene as load_scene
from .scene_file import parse_scene as parse_scene
from .scene_file import scene_json as scene_json

__all__ = [
    "ACCELERATION_LIMIT",
    "ATOMS",
    "BRAKING_LIMIT",
    "CENTRE_TOLERANCE",
    "EGO",
    "EGO_ID",
    "FAIL_SAFE_MASK",
    "SCHEMA",
    "Action",
    "Decisions",
    "Facts",
    "Road",
    "Row",
    "Scene",
    "SceneBatch",
    "Vehicle",
    "action_of_atom",
    "bumper_gap",
    "fail_safe_speed",
    "load_scene",
    "one_action",
    "parse_scene",
    "road_facts",
    "scene_facts",
    "scene_json",
    "several_actions",
]
