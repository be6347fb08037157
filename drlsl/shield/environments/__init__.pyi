from .crossing import crossing_facts, shield_crossing
from .frozen_lake import frozen_lake_facts, shield_frozen_lake
from .minigrid import minigrid_facts, shield_minigrid
from .straight_road import ROAD_SCHEMA, shield_straight_road, straight_road_facts

__all__ = [
    "ROAD_SCHEMA",
    "crossing_facts",
    "frozen_lake_facts",
    "minigrid_facts",
    "shield_crossing",
    "shield_frozen_lake",
    "shield_minigrid",
    "shield_straight_road",
    "straight_road_facts",
]
