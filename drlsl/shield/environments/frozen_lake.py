"""Gymnasium's FrozenLake, with the rules of rules/envs/frozen_lake.pl."""

from __future__ import annotations

from typing import Any, Final

import gymnasium
import numpy as np

from drlsl.logic import Limits
from drlsl.shield.environments.known import check_kind
from drlsl.shield.fact_forms import Facts
from drlsl.shield.wrapper import LogicShield

RULES: Final = "envs/frozen_lake.pl"

ACTIONS: Final = {"left": 0, "down": 1, "right": 2, "up": 3}

SETTINGS: Final[dict[str, Any]] = {
    "fallback": "left",
    "tier": "interpreter",
    "limits": Limits(inferences=20_000_000),
    "remember": 10_000,
}
"""Only the interpreter can look several moves ahead; there are no more states than cells."""


def shield_frozen_lake(env: gymnasium.Env[Any, Any], **settings: Any) -> LogicShield:
    """Return FrozenLake of any map, slippery or not, behind a shield; `settings` are those of `LogicShield`.

    Raises:
        UserError: a setting is not usable, or the environment is another.
    """
    check_kind(env, "FrozenLake", "desc", "nrow", "ncol", "P")
    return LogicShield(env, RULES, actions=ACTIONS, facts=frozen_lake_facts, **{**SETTINGS, **settings})


def frozen_lake_facts(lake: Any) -> Facts:
    """Return the facts of the present state of FrozenLake, the environment without its wrappers."""
    holes, goals = (np.argwhere(lake.desc == letter).tolist() for letter in (b"H", b"G"))
    return {
        ("size", 2): [(lake.nrow, lake.ncol)],
        ("at", 2): [divmod(int(lake.s), lake.ncol)],
        ("hole", 2): holes,
        ("goal", 2): goals,
        ("straight", 1): [(_chance_to_go_straight(lake),)],
    }


def _chance_to_go_straight(lake: Any) -> float:
    """Return the chance that a move goes where it should.

    Source: `FrozenLakeEnv.P` of Gymnasium, which lists the way to one side, straight on, and to the other.
    """
    ways = next((moves[0] for moves in lake.P.values() if len(moves[0]) > 1), None)
    return 1.0 if ways is None else float(ways[1][0])
