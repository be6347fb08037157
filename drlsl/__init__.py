"""Safe reinforcement learning for highway driving, shielded by readable Prolog rules."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from drlsl.driving.registration import register_with_gymnasium

if TYPE_CHECKING:
    from drlsl.driving.actions import Action as Action
    from drlsl.driving.scene import Scene as Scene
    from drlsl.driving.shield import Decision as Decision
    from drlsl.driving.shield import Shield as Shield

__all__ = ["Action", "Decision", "Scene", "Shield"]


def __getattr__(name: str) -> Any:
    """Load a public name's module when it is first asked for."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from drlsl import driving

    return getattr(driving, name)


register_with_gymnasium()
