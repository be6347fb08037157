"""Loops in which a row is its place in an array of rows."""

from __future__ import annotations

from abc import abstractmethod

from drlsl.lowering.backends.expressions import ATOMIC, COMPARISON, is_lookup
from drlsl.lowering.backends.loops import LoopPrinter
from drlsl.lowering.ir import Node, Relation, relation_of


class PlaceLoops(LoopPrinter):
    """Searches the place of a row with a given key once, and names it."""

    @abstractmethod
    def search(self, node: Node) -> str:
        """Return the call that searches the row of a lookup."""

    @abstractmethod
    def is_some(self, place: str, relation: Relation) -> str:
        """Return the test whether a place is that of a row."""

    def is_expensive(self, node: Node) -> bool:
        return is_lookup(node)

    def assign(self, node: Node) -> str:
        if node.op == "any" and is_lookup(node):
            self._place(node)
        return super().assign(node)

    def _place(self, node: Node) -> str:
        """Return the variable for the place of the row of a lookup."""
        place = self.pool.make("first", "index", node.args)
        return self.known.get(place) or super().assign(place)

    def lookup(self, node: Node) -> tuple[str, int]:
        if node.op == "any":
            place = self.known.get(self.pool.make("first", "index", node.args)) or self.search(node)
            return self.is_some(place, relation_of(node.args[0])), COMPARISON
        return self.search(node), ATOMIC
