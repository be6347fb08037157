"""The names of vehicles that matter: those that a program mentions distinguish scenes, others do not."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from drlsl.driving.scene import EGO, SCHEMA
from drlsl.logic.terms import Atom
from drlsl.lowering.ir import Node, Relation, reach
from drlsl.traffic import Direction

VEHICLE: Final = SCHEMA.relations["vehicle", 8]

LANE_END: Final = SCHEMA.relations["lane_end", 2]


@dataclass(frozen=True, slots=True)
class OpenRelation(Relation):
    """A relation that may have any number of rows, each of which is like any other."""


_ROAD_LANE: Final = SCHEMA.relations["road_lane", 5]

_DIRECTIONS: Final = frozenset(Atom(direction.value) for direction in Direction)


def mentioned(roots: Iterable[Node], focus: Relation) -> frozenset[Atom]:
    """Return the atoms besides `ego` with which nodes compare a vehicle's name, or that of `focus`."""
    named = {(VEHICLE, VEHICLE.key), (focus, 0)}
    found: set[Atom] = set()
    for node in reach(roots):
        if node.op != "eq" or node.args[0].kind != "atom":
            continue
        atoms: set[Atom] = set()
        columns: set[tuple[Relation, int | None]] = set()
        for side in node.args:
            _sources(side, atoms, columns)
        if columns & named:
            found |= atoms
            if any(relation == _ROAD_LANE for relation, _ in columns):
                found |= _DIRECTIONS
    return frozenset(found - {Atom(EGO)})


def reads_lane_ends(roots: Iterable[Node]) -> bool:
    """Return whether nodes depend on where lanes end."""
    return any(node.op == "facts" and node.data == LANE_END for node in reach(roots))


def _sources(node: Node, atoms: set[Atom], columns: set[tuple[Relation, int | None]]) -> None:
    """Collect the constants and the columns that an atom may come from."""
    if node.op == "const":
        atoms.add(node.data)
    elif node.op == "col":
        columns.add(node.data)
    else:
        for arg in node.args[1:]:
            _sources(arg, atoms, columns)
