"""A memory of values of a lowered program's nodes, for all rows of the loops around them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar

from drlsl.lowering.ir import Node

R = TypeVar("R")
T = TypeVar("T")


class RowMemory(Generic[R]):
    """Computes nodes inside loops; R is what a loop stands for meanwhile: a row, several, or an axis."""

    def __init__(self) -> None:
        self._loops: dict[Node, R] = {}
        self._done: dict[object, Any] = {}

    def _once(self, what: object, node: Node, make: Callable[[Node], T]) -> T:
        """Return `make(node)`, computed once for each choice of the rows of the node's loops."""
        place = (what, node, *[self._loops[loop] for loop in node.loops])
        if place not in self._done:
            self._done[place] = make(node)
        known: T = self._done[place]
        return known

    def _leave(self, loop: Node, outer: R | None) -> None:
        """Restore what a loop stood for: a quantifier inside may use the same loop."""
        if outer is None:
            self._loops.pop(loop, None)
        else:
            self._loops[loop] = outer
