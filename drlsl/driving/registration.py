"""Tells Gymnasium about the environments; Gymnasium calls `register_envs` through its plug-in entry point."""

from __future__ import annotations

ENV_ID = "drlsl/Highway-v0"


def register_envs() -> None:
    """Register the highway environment under its id; once registered, nothing happens again."""
    import gymnasium

    if ENV_ID not in gymnasium.registry:
        gymnasium.register(
            ENV_ID,
            entry_point="drlsl.driving.env:HighwayEnv",
            disable_env_checker=False,
        )
