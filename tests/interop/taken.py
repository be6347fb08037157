"""The actions that trainings take, and those of them that were not offered."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from drlsl.driving import HighwayEnv, HighwayVectorEnv

ID = "drlsl/Highway-v0"
SETTINGS: dict[str, Any] = {"recording": "overtake-train", "track_length": 100.0}
"""Short episodes, so that many begin and end in a training, in traffic with many offers of a lane change."""

VECTOR = 4
"""Environments of a vector environment."""


@dataclass
class Taken:
    """The actions that were taken, in their order, and how many of them were not offered."""

    actions: list[int] = field(default_factory=list)
    refused: int = 0

    def add(self, info: dict[str, Any]) -> None:
        """Add those of a step of one environment or of several; a step that begins an episode takes none."""
        taken, offered = np.atleast_1d(info["taken"]), np.atleast_1d(info["offered"])
        driven = taken >= 0
        self.actions += taken[driven].tolist()
        self.refused += int((~offered[driven]).sum())


@contextmanager
def told() -> Iterator[Taken]:
    """Note what every environment of this process is told to do."""
    taken = Taken()
    with pytest.MonkeyPatch.context() as patch:
        # In front of the format of the library, which may leave out what is read here.
        for made in (HighwayEnv, HighwayVectorEnv):
            patch.setattr(made, "step", _noting(made, taken))
        yield taken


def _noting(made: Any, taken: Taken) -> Any:
    step = made.step

    def noting(self: Any, actions: Any) -> Any:
        answer = step(self, actions)
        # With SAME_STEP the actions that ended episodes stand in final_info.
        info = dict(answer[-1])
        if "final_info" in info:
            last, over = info["final_info"], info["_final_info"]
            for key in ("taken", "offered"):
                info[key] = np.where(over, last[key], info[key])
        taken.add(info)
        return answer

    return noting
