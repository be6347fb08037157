"""Driving in recorded traffic: scenes, the shield, control, reward, fault, the world and its env."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from drlsl.driving.actions import Action as Action
    from drlsl.driving.config import EnvConfig as EnvConfig
    from drlsl.driving.env import HighwayEnv as HighwayEnv
    from drlsl.driving.env import make_env as make_env
    from drlsl.driving.scene import Scene as Scene
    from drlsl.driving.shield import Decision as Decision
    from drlsl.driving.shield import Shield as Shield
    from drlsl.driving.vector import HighwayVectorEnv as HighwayVectorEnv
    from drlsl.driving.vector import make_vec as make_vec

_HOME = {
    "Action": "actions",
    "Decision": "shield",
    "EnvConfig": "config",
    "HighwayEnv": "env",
    "HighwayVectorEnv": "vector",
    "Scene": "scene",
    "Shield": "shield",
    "make_env": "env",
    "make_vec": "vector",
}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    """Load a name's module when it is first asked for, so that a query does not pay for training."""
    from importlib import import_module

    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
