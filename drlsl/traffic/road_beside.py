"""The file of the road that belongs to a recording of vehicles on a map."""

from __future__ import annotations

from pathlib import Path
from typing import Final

OPENDRIVE: Final = ".xodr"

NETWORKS: Final = (".net.xml", ".net.xml.gz")
"""Endings of SUMO's networks."""


def road_beside(path: Path) -> Path | None:
    """Return the file of the road that belongs to a recording: called like it, or the only one beside it."""
    found = [
        one
        for one in sorted(path.parent.iterdir())
        if one.name.endswith((*NETWORKS, OPENDRIVE)) and one.is_file()
    ]
    stem = path.name.split(".")[0]
    alike = [one for one in found if one.name.split(".")[0] == stem] or found
    return alike[0] if len(alike) == 1 else None
