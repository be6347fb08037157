"""The files that belong to a recording of vehicles on a map: its road, and what SUMO says of its vehicles."""

from __future__ import annotations

from pathlib import Path
from typing import Final

OPENDRIVE: Final = ".xodr"

NETWORKS: Final = (".net.xml", ".net.xml.gz")
"""Endings of SUMO's networks."""


VEHICLE_TYPES: Final = (".rou.xml", ".add.xml")
"""Endings of SUMO's files that may define vehicle types."""


def is_road(path: Path) -> bool:
    """Return whether a file is called as a road's."""
    return path.name.endswith((*NETWORKS, OPENDRIVE))


def vehicle_types_beside(path: Path) -> tuple[Path, ...]:
    """Return the files beside a recording that may define SUMO's vehicle types, sorted by name."""
    return tuple(one for one in sorted(path.parent.iterdir()) if one.name.endswith(VEHICLE_TYPES))


def road_beside(path: Path) -> Path | None:
    """Return the file of the road that belongs to a recording: called like it, or the only one beside it."""
    found = [one for one in sorted(path.parent.iterdir()) if is_road(one) and one.is_file()]
    stem = path.name.split(".")[0]
    alike = [one for one in found if one.name.split(".")[0] == stem] or found
    return alike[0] if len(alike) == 1 else None
