from .frozen_lake import frozen_lake_facts, shield_frozen_lake

__all__ = ["frozen_lake_facts", "shield_frozen_lake"]
