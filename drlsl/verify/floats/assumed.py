"""Simplify conditions by the conjuncts before them, so that equal numbers become equal nodes.

Two clauses often compute the same number under conditions that are written differently. Once the evaluation
has passed a conjunct, it is true for all that follows; with it substituted, more nodes are equal, and no
evaluated value changes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from drlsl.lowering.ir import QUANTIFIERS, Node, Pool, conjuncts


class Simplifier:
    """Substitutes known conditions; `settled` returns whether one always holds, or never."""

    def __init__(self, pool: Pool, settled: Callable[[Node], bool | None]) -> None:
        self._pool = pool
        self._settled = settled
        self._done: dict[tuple[Node, frozenset[tuple[Node, bool]]], Node] = {}

    def simplified(self, node: Node, known: Mapping[Node, bool]) -> Node:
        """Return the node, given the truth of some conditions."""
        if node in known:
            return self._pool.const(known[node])
        if not node.args:
            return node
        place = (node, frozenset(known.items()))
        made = self._done.get(place)
        if made is None:
            made = self._made(node, known)
            truth = self._settled(made) if made.kind == "bool" else None
            made = self._done[place] = made if truth is None else self._pool.const(truth)
            self._pool.keep_source(node, made)
        return made

    def _made(self, node: Node, known: Mapping[Node, bool]) -> Node:
        pool = self._pool
        if node.op in ("and", "or"):
            return self._junction(node, known)
        if node.op == "select":
            cond = self.simplified(node.args[0], known)
            sides = [
                self.simplified(arg, _with(known, cond, holds=holds))
                for arg, holds in zip(node.args[1:], (True, False), strict=True)
            ]
            return self._choice(cond, *sides)
        if node.op in QUANTIFIERS:
            return self._quantifier(node, known)
        if node.op == "where":
            rows, loop, cond = node.args
            outside = _outside(known, loop)
            return pool.make(
                "where", "rows", (self.simplified(rows, known), loop, self.simplified(cond, outside))
            )
        if node.op == "loop":
            return node
        return pool.rebuild(node, tuple(self.simplified(arg, known) for arg in node.args))

    def _choice(self, cond: Node, then: Node, els: Node) -> Node:
        """Return a choice between two numbers; one that takes the lesser or greater becomes min or max.

        Taking the wrong one of two numbers that hardly differ does no harm, so no comparison is left.
        """
        pool = self._pool
        test = _comparison_of(cond, then, els) if then.kind in ("int", "float") else None
        if test is None or then.kind != els.kind:
            return pool.choose(cond, then, els)
        low, high = ("min", "max") if test.args[0] is then else ("max", "min")
        if_less, if_not = (self.simplified(cond, {test: holds}) for holds in (True, False))
        by_test, against_test = (pool.make(op, then.kind, (then, els)) for op in (low, high))
        return pool.choose(
            if_less, pool.choose(if_not, then, by_test), pool.choose(if_not, against_test, els)
        )

    def _junction(self, node: Node, known: Mapping[Node, bool]) -> Node:
        parts: list[Node] = []
        for arg in node.args:
            part = self.simplified(arg, known)
            parts.append(part)
            known = _with(known, part, holds=node.op == "and")
        return self._pool.and_(parts) if node.op == "and" else self._pool.or_(parts)

    def _quantifier(self, node: Node, known: Mapping[Node, bool]) -> Node:
        """Return a quantifier over the same rows; its values are evaluated only if its condition holds."""
        pool, loop = self._pool, node.args[0]
        inner: Mapping[Node, bool] = _outside(known, loop)
        cond = self.simplified(node.args[1], inner)
        inner = _with(inner, cond, holds=True)
        values = [self.simplified(value, inner) for value in node.args[2:3]]
        if node.op == "any":
            return pool.exists(loop, cond)
        if node.op == "first":
            return pool.first(loop, cond)
        if node.op == "count":
            return pool.count(loop, cond)
        if node.op == "sum":
            start = self.simplified(node.args[3], known)
            return pool.total(loop, cond, values[0], start, (node.low, node.high))
        return pool.extreme(node.op, loop, cond, values[0])


def _with(known: Mapping[Node, bool], cond: Node, *, holds: bool) -> Mapping[Node, bool]:
    """Return the known conditions, extended by one."""
    if cond.is_const:
        return known
    if cond.op == "not":
        return _with(known, cond.args[0], holds=not holds)
    if cond.op == "and" and holds:
        for part in conjuncts(cond):
            known = _with(known, part, holds=True)
        return known
    if cond.op == "or" and not holds:
        for part in cond.args:
            known = _with(known, part, holds=False)
        return known
    return {**known, cond: holds}


def _comparison_of(cond: Node, one: Node, other: Node) -> Node | None:
    """Return a comparison of these two numbers among the parts of a condition."""
    if cond.op == "lt" and set(cond.args) == {one, other}:
        return cond
    if cond.op in ("not", "and", "or"):
        found = (_comparison_of(arg, one, other) for arg in cond.args)
        return next((test for test in found if test is not None), None)
    return None


def _outside(known: Mapping[Node, bool], loop: Node) -> dict[Node, bool]:
    """Return the known conditions that do not depend on a loop's row."""
    return {node: holds for node, holds in known.items() if loop not in node.free}
