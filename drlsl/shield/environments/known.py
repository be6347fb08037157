"""A check that an environment is the one that rules are for."""

from __future__ import annotations

from typing import Any

import gymnasium

from drlsl.errors import UserError


def check_kind(env: gymnasium.Env[Any, Any], kind: str, *needed: str) -> None:
    """Check that an environment has the attributes from which the facts of a `kind` are read.

    Raises:
        UserError: it has not.
    """
    for name in needed:
        if not hasattr(getattr(env, "unwrapped", env), name):
            raise UserError(f"{env} has no {name}; expected {kind}; drlsl.LogicShield takes any")
