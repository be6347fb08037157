"""Conjunctions are simplified as by trying every part again after each change, in less time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from drlsl.lowering.ir import Node, Pool, Relation


class PatientPool(Pool):
    """Begins again with the first part of a conjunction whenever a part was simplified."""

    def and_(self, nodes: Iterable[Node]) -> Node:
        parts: dict[Node, None] = {}
        for node in nodes:
            parts.update(dict.fromkeys(_parts(node)))
        parts.pop(self.true, None)
        while True:
            for part in parts:
                left = self._under(part, parts)
                if left is not part:
                    break
            else:
                break
            parts = dict.fromkeys(
                other for old in parts for other in (_parts(left) if old is part else (old,))
            )
            parts.pop(self.true, None)
        if self.false in parts or any(self._excluded(part, parts) for part in parts):
            return self.false
        if len(parts) < 2:
            return next(iter(parts), self.true)
        return self.make("and", "bool", tuple(parts))

    def _under(self, part: Node, known: Mapping[Node, None]) -> Node:
        if part.op == "or":
            if any(all(one in known for one in _parts(arg)) for arg in part.args):
                return self.true
            kept = [arg for arg in part.args if self.not_(arg) not in known]
            return part if len(kept) == len(part.args) else self.or_(kept)
        if part.op == "not" and part.args[0].op == "and":
            kept = [arg for arg in part.args[0].args if arg not in known]
            return part if len(kept) == len(part.args[0].args) else self.not_(self.and_(kept))
        if part.op == "not" and part.args[0].op == "eq" and part.args[0].args[1].is_const:
            value = part.args[0].args[0]
            if any(_fixes(one, value) for one in known) and part.args[0] not in known:
                return self.true
        return part

    def _excluded(self, part: Node, known: Mapping[Node, None]) -> bool:
        if self.not_(part) in known:
            return True
        if part.op == "lt":
            return self.make("lt", "bool", (part.args[1], part.args[0])) in known
        if part.op == "eq" and part.args[1].is_const:
            return any(_fixes(other, part.args[0]) and other is not part for other in known)
        return False


def _parts(node: Node) -> tuple[Node, ...]:
    return node.args if node.op == "and" else (node,)


def _fixes(node: Node, value: Node) -> bool:
    return node.op == "eq" and node.args[0] is value and node.args[1].is_const


ROAD = Relation("road", ("float", "float", "int"), single=True)


def _atoms(pool: Pool) -> list[Node]:
    """Conditions about three values, of which some exclude each other."""
    row = pool.row(ROAD)
    x, y, lane = (pool.column(row, ROAD, number) for number in range(3))
    lanes = [pool.equal(lane, pool.const(number)) for number in range(3)]
    return [pool.less(x, y), pool.less(y, x), pool.less(x, pool.const(1.0)), pool.equal(x, y), *lanes]


STEPS = st.lists(
    st.tuples(st.sampled_from(["and", "or", "not"]), st.lists(st.integers(0, 60), min_size=1, max_size=5)),
    max_size=30,
)


def _built(pool: Pool, steps: list[tuple[str, list[int]]]) -> list[Any]:
    """Build conditions of those before, and return them with the order in which all nodes were made."""
    found = _atoms(pool)
    for word, places in steps:
        chosen = [found[-1 - place % len(found)] for place in places]
        if word == "not":
            found.append(pool.not_(chosen[0]))
        else:
            found.append(pool.and_(chosen) if word == "and" else pool.or_(chosen))
    return [*((repr(node), node.order) for node in found), pool.const(0.125).order]


@given(STEPS)
@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_the_same_nodes_are_made_in_the_same_order(steps: list[tuple[str, list[int]]]) -> None:
    assert _built(Pool(), steps) == _built(PatientPool(), steps)
