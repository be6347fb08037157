"""The conditions under which the values of a loop over rows count: elsewhere the loop need not run."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import Final

from drlsl.lowering.backends.expressions import is_loop
from drlsl.lowering.ir import Node, Pool, conjuncts


class Needs:
    """Finds the condition without which a value has no influence on any result.

    All values are total (see `numbers.py`), so whatever stands for a value that does not count does no harm,
    not even to the conditions of loops that come later: those read the same value as the results.
    """

    def __init__(self, pool: Pool, results: Sequence[tuple[Node, Node]], reached: Collection[Node]) -> None:
        """Take over the results, each with the condition under which it uses, and all nodes below them.

        `reached` are the nodes in an order in which arguments come first.
        """
        self._pool: Final = pool
        self._results: Final = results
        self._reached: Final = reached

    def of(self, members: Collection[Node], known: Collection[Node]) -> Node:
        """Return a condition without which none of some loops uses, in terms of those that are known."""
        pool = self._pool
        above: set[Node] = set()  # what depends on a member
        for node in self._reached:
            if node in members or not above.isdisjoint(node.args):
                above.add(node)
        is_known = _Known(known)
        uses: dict[Node, list[Node]] = {node: [] for node in above}
        for node, when in self._results:
            if node in above:
                uses[node].append(pool.and_(filter(is_known, conjuncts(when))))
        for node in reversed([node for node in self._reached if node in above and node not in members]):
            when = pool.or_(uses[node])
            for place, arg in enumerate(node.args):
                if arg in above:
                    beside = filter(is_known, self._beside(node, place))
                    uses[arg].append(pool.and_([when, *beside]))
        found = pool.or_(when for member in members for when in uses[member])
        return found if is_known(found) else pool.true

    def _beside(self, node: Node, place: int) -> Iterable[Node]:
        """Return conditions without which an argument of a node does not count."""
        if node.op == "and":
            return node.args[:place] + node.args[place + 1 :]
        if node.op == "select" and place > 0:
            return [node.args[0] if place == 1 else self._pool.not_(node.args[0])]
        return []


class _Known:
    """Tells whether a value depends on no row, and on no loop but those that are known."""

    def __init__(self, loops: Collection[Node]) -> None:
        self._found = dict.fromkeys(loops, True)

    def __call__(self, node: Node) -> bool:
        return not node.free and self._reads_known(node)

    def _reads_known(self, node: Node) -> bool:
        found = self._found.get(node)
        if found is None:
            found = self._found[node] = not is_loop(node) and all(map(self._reads_known, node.args))
        return found
