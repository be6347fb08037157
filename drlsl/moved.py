"""Modules that have moved since 0.1, and a finder that says where to."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from types import ModuleType
from typing import Final

MOVED: Final = {
    "drlsl.driving.actions": "drlsl.driving.scene",
    "drlsl.driving.action_space": "drlsl.driving.scene",
    "drlsl.driving.batch": "drlsl.driving.scene",
    "drlsl.driving.limits": "drlsl.driving.scene",
    "drlsl.driving.scene_file": "drlsl.driving.scene",
    "drlsl.driving.lowered": "drlsl.driving.shield",
    "drlsl.driving.tiers": "drlsl.driving.shield",
    "drlsl.driving.contacts": "drlsl.driving.simulation",
    "drlsl.driving.control": "drlsl.driving.simulation",
    "drlsl.driving.egos": "drlsl.driving.simulation",
    "drlsl.driving.entry": "drlsl.driving.simulation",
    "drlsl.driving.fault": "drlsl.driving.simulation",
    "drlsl.driving.idm": "drlsl.driving.simulation",
    "drlsl.driving.playback": "drlsl.driving.simulation",
    "drlsl.driving.prediction": "drlsl.driving.simulation",
    "drlsl.driving.reactive": "drlsl.driving.simulation",
    "drlsl.driving.reward": "drlsl.driving.simulation",
    "drlsl.driving.sensing": "drlsl.driving.simulation",
    "drlsl.driving.world": "drlsl.driving.simulation",
    "drlsl.driving.env": "drlsl.driving.envs",
    "drlsl.driving.vector": "drlsl.driving.envs",
    "drlsl.driving.decision_picture": "drlsl.driving.explain",
    "drlsl.driving.picture": "drlsl.driving.explain",
    "drlsl.driving.reasons": "drlsl.driving.explain",
    "drlsl.driving.stress": "drlsl.driving",
    "drlsl.driving.registration": "drlsl.registration",
    "drlsl.driving.bench": "drlsl.benchmarks",
    "drlsl.driving.bench_env": "drlsl.benchmarks",
    "drlsl.learning.bench": "drlsl.benchmarks",
    "drlsl.logic.bench": "drlsl.benchmarks",
    "drlsl.logic.bench_set": "drlsl.benchmarks",
}
"""By old name, the package that offers now what the module did."""


class _Signpost(MetaPathFinder):
    """Asked last, for modules that nobody has found."""

    def find_spec(self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None) -> None:
        """Say where a module has moved to.

        Raises:
            ModuleNotFoundError: it has moved.
        """
        if home := MOVED.get(fullname):
            raise ModuleNotFoundError(f"{fullname} has moved; import from {home} instead", name=fullname)


def say_where() -> None:
    """Have the import of a module that has moved fail with a line that says where to."""
    sys.meta_path.append(_Signpost())
