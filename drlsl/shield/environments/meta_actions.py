"""The meta-actions of highway-env, under the names that the rules of rules/envs/ use."""

from __future__ import annotations

from typing import Any, Final

import gymnasium

from drlsl.errors import UserError

FALLBACK: Final = "slower"
"""The action that is left where the rules fail: highway-env has none that brakes harder."""


def meta_actions(env: gymnasium.Env[Any, Any], *, lateral: bool) -> dict[str, int]:
    """Return the numbers of an environment's meta-actions by name.

    `lateral` says whether lane changes must be among them.

    Raises:
        UserError: the environment is not of highway-env, or has other actions.
    """
    kind = getattr(env.unwrapped, "action_type", None)
    found = {str(name).lower(): int(number) for name, number in getattr(kind, "actions_indexes", {}).items()}
    missing = {"faster", "slower", "idle", *(("lane_left", "lane_right") if lateral else ())} - found.keys()
    if missing:
        raise UserError(
            f"{env} has no action {min(missing)}; expected an environment of highway-env with the action "
            f"type DiscreteMetaAction, longitudinal{' and lateral' if lateral else ''}"
        )
    return found
