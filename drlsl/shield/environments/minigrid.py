"""MiniGrid, with the rules of rules/envs/minigrid.pl."""

from __future__ import annotations

from typing import Any, Final

import gymnasium

from drlsl.shield.environments.known import check_kind
from drlsl.shield.fact_forms import Facts
from drlsl.shield.wrapper import LogicShield

RULES: Final = "envs/minigrid.pl"

ACTIONS: Final = {"left": 0, "right": 1, "forward": 2, "pickup": 3, "drop": 4, "toggle": 5, "done": 6}


def shield_minigrid(env: gymnasium.Env[Any, Any], **settings: Any) -> LogicShield:
    """Return a MiniGrid with all seven actions behind a shield; `settings` are those of `LogicShield`.

    Raises:
        UserError: a setting is not usable, or the environment is another, or has other actions.
    """
    check_kind(env, "an environment of MiniGrid", "agent_pos", "agent_dir")
    given = {"fallback": "left", **settings}
    return LogicShield(env, RULES, actions=ACTIONS, facts=minigrid_facts, **given)


def minigrid_facts(world: Any) -> Facts:
    """Return the facts of the present state of an environment of MiniGrid, without its wrappers."""
    width, height = world.grid.width, world.grid.height
    cells = ((x, y, world.grid.get(x, y)) for x in range(width) for y in range(height))
    return {
        ("agent", 3): [(*map(int, world.agent_pos), int(world.agent_dir))],
        ("thing", 3): [(x, y, thing.type) for x, y, thing in cells if thing is not None],
    }
