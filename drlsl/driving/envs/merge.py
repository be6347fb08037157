"""The environments in which the ego merges: it enters on a ramp, whose lane it must leave before it ends."""

from __future__ import annotations

from types import MappingProxyType
from typing import Final

from drlsl.driving.envs.single import HighwayEnv
from drlsl.driving.envs.vector import HighwayVectorEnv

MERGING: Final = MappingProxyType({"recording": "merge-train", "rules": ("merge.pl",), "entry": "ramp"})
"""Settings of a merge; all others are those of the highway."""


class MergeEnv(HighwayEnv):
    """Merge into recorded traffic: `HighwayEnv` with the settings of `MERGING` where none are given."""

    DEFAULTS = MERGING


class MergeVectorEnv(HighwayVectorEnv):
    """Merge many times at once: `HighwayVectorEnv` with the settings of `MERGING` where none are given."""

    DEFAULTS = MERGING
