"""Plan quantifiers that compute their costly parts only for the rows that pass the cheap ones.

A quantifier over a large relation is a mask and perhaps a value. Conditions that many quantifiers share are
computed for all rows anyway. Costly parts of few quantifiers are worth computing only for the rows where the
shared conditions hold.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import chain, combinations
from typing import Final

from drlsl.lowering.ir import QUANTIFIERS, SMALL, Node, Pool, conjuncts, reach, relation_of

_SHARED_BY: Final = 3
_COSTLY: Final = 3
_LEAVES: Final = frozenset({"col", "const", "loop", "valid"})


@dataclass(frozen=True, slots=True)
class Sparse:
    """The plan of one quantifier.

    `prefix`: the conditions for all rows. `heavy`: the costly conditions, then the value, for the rows that
    pass. `private`: the nodes in these, arguments first. `inputs`: the arguments of those nodes.
    """

    prefix: tuple[Node, ...]
    heavy: tuple[Node, ...]
    private: tuple[Node, ...]
    inputs: tuple[Node, ...]


def mask_parts(pool: Pool, node: Node) -> tuple[Node, ...]:
    """Return the conditions of a quantifier's rows, the first that there is such a row."""
    cond = node.args[2] if node.op == "where" else node.args[1]
    valid = pool.make("valid", "bool", (node.loop,))
    return (valid, *(part for part in conjuncts(cond) if not part.is_const))


def plan_sparse(pool: Pool, roots: Iterable[Node]) -> dict[Node, Sparse]:
    """Return the quantifiers that gain, each with its plan."""
    reached = reach(roots)
    quantifiers = [node for node in reached if node.op in QUANTIFIERS]
    shared = Counter(part for node in quantifiers for part in mask_parts(pool, node))
    candidates = [node for node in quantifiers if _may_gain(node)]
    dense: set[Node] = set()  # computed for all rows in any case
    for node in quantifiers:
        parts = mask_parts(pool, node)
        firm = [
            part
            for part in parts
            if node not in candidates or shared[part] >= _SHARED_BY or part.op == "valid"
        ]
        for part in [*firm, *(node.args[2:] if node not in candidates else ())]:
            _add(part, dense)
    while True:
        plans = {node: plan for node in candidates if (plan := _plan(pool, node, dense)) is not None}
        before = len(dense)
        for node in candidates:
            plan = plans.get(node)
            own = (*mask_parts(pool, node), *node.args[2:])
            for part in own if plan is None else plan.prefix:
                _add(part, dense)
        if len(dense) == before:
            return _together(pool, plans)


def _may_gain(node: Node) -> bool:
    rows = node.args[0].args[0]
    return (
        node.op in ("any", "min_of", "max_of")
        and not node.free
        and rows.op in ("facts", "others")
        and relation_of(rows).capacity > SMALL
    )


def _plan(pool: Pool, node: Node, dense: set[Node]) -> Sparse | None:
    loop = node.args[0]
    prefix: list[Node] = []
    heavy: list[Node] = []
    for part in mask_parts(pool, node):
        (heavy if part not in dense and _cost(part, loop, dense) >= _COSTLY else prefix).append(part)
    values = node.args[2:]
    if not heavy and not any(_cost(value, loop, dense) >= _COSTLY for value in values):
        return None
    heavy += values
    known = {part for part in reach(heavy) if part in dense or loop not in part.free}
    private = tuple(part for part in reach(heavy, known) if part.op not in _LEAVES)
    if any(part.free != {loop} or part.op in QUANTIFIERS for part in private):
        return None
    needed = dict.fromkeys(arg for part in (*private,) for arg in part.args if arg not in private)
    needed.update(dict.fromkeys(part for part in heavy if part not in private))
    return Sparse(tuple(prefix), tuple(heavy), private, tuple(needed))


def _together(pool: Pool, plans: dict[Node, Sparse]) -> dict[Node, Sparse]:
    """Merge plans with the same costly parts: they pick out the rows of any of them, once."""
    groups: dict[tuple[Node, ...], list[Node]] = {}
    for node, plan in plans.items():
        groups.setdefault(plan.heavy, []).append(node)
    result = dict(plans)
    for nodes in groups.values():
        prefixes = [plans[node].prefix for node in nodes]
        common = tuple(part for part in prefixes[0] if all(part in other for other in prefixes))
        own = [tuple(part for part in prefix if part not in common) for prefix in prefixes]
        if len(nodes) == 1 or not all(own):
            continue
        either = pool.or_(pool.and_(parts) for parts in own)
        for node, parts in zip(nodes, own, strict=True):
            plan = plans[node]
            inputs = tuple(dict.fromkeys((*plan.inputs, *parts)))
            result[node] = Sparse((*common, either), (*parts, *plan.heavy), plan.private, inputs)
    return result


def _cost(node: Node, loop: Node, dense: set[Node]) -> int:
    """Return the number of operations of a value for each row, apart from those computed anyway."""
    return sum(loop in part.free and part.op not in _LEAVES for part in reach([node], dense))


def _add(node: Node, dense: set[Node]) -> None:
    dense.update(part for part in reach([node]) if part.free)


class Conjunctions:
    """Masks as pairs of masks, so that those with common conditions share them."""

    def __init__(self, pool: Pool, roots: Iterable[Node], sparse: Mapping[Node, Sparse]) -> None:
        self._pool = pool
        wanted: dict[tuple[Node, ...], list[Node]] = {}
        seen: set[Node] = set()

        def visit(node: Node) -> None:
            if node in seen:
                return
            seen.add(node)
            for arg in (*sparse[node].prefix, *sparse[node].inputs) if node in sparse else node.args:
                visit(arg)
            parts: tuple[Node, ...] = ()
            if node.op == "and":
                parts = conjuncts(node)
            elif node in sparse:
                parts = sparse[node].prefix
            elif node.op in QUANTIFIERS or node.op == "where":
                parts = mask_parts(pool, node)
            if parts:
                wanted.setdefault(parts, sorted(parts, key=lambda part: len(part.free)))

        for root in roots:
            visit(root)
        # a condition of a quantifier is a part of its mask, not a mask of its own
        self._made = {parts: self._pair_up(left) for parts, left in self._share(wanted).items()}

    def of(self, parts: tuple[Node, ...]) -> Node:
        """Return the node of a conjunction."""
        return self._made[parts]

    def _share(self, wanted: dict[tuple[Node, ...], list[Node]]) -> dict[tuple[Node, ...], list[Node]]:
        wanted = self._join_companions(wanted)
        while True:
            homes = Counter(chain.from_iterable(wanted.values()))
            counts: Counter[tuple[Node, Node]] = Counter()
            for parts in wanted.values():
                # A pair that several masks share has two such parts; a mask may have thousands of its own.
                counts.update(combinations([part for part in parts if homes[part] > 1], 2))
            best = max(
                counts, key=lambda pair: (counts[pair], -len(pair[0].free | pair[1].free)), default=None
            )
            if best is None or counts[best] < 2:
                return wanted
            pair = self._both(*best)
            for parts in wanted.values():
                if best[0] in parts and best[1] in parts:
                    place = parts.index(best[0])
                    parts[place] = pair
                    parts.remove(best[1])

    def _join_companions(
        self, wanted: dict[tuple[Node, ...], list[Node]]
    ) -> dict[tuple[Node, ...], list[Node]]:
        """Join conditions that are always together, so that pairs need not be counted for each of them."""
        homes: dict[Node, list[int]] = {}
        for number, parts in enumerate(wanted.values()):
            for part in parts:
                homes.setdefault(part, []).append(number)
        groups: dict[tuple[tuple[int, ...], frozenset[Node]], list[Node]] = {}
        for part, numbers in homes.items():
            groups.setdefault((tuple(numbers), part.free), []).append(part)
        joined: dict[Node, Node] = {}
        for (places, _), group in groups.items():
            if len(places) > 1:
                joined.update(dict.fromkeys(group, self._tree(group)))
        return {
            key: list(dict.fromkeys(joined.get(part, part) for part in parts))
            for key, parts in wanted.items()
        }

    def _pair_up(self, parts: list[Node]) -> Node:
        """Return the node of a conjunction; conditions of the same loops are joined first."""
        groups: dict[frozenset[Node], list[Node]] = {}
        for part in sorted(parts, key=lambda part: len(part.free)):
            groups.setdefault(part.free, []).append(part)
        result, *others = (self._tree(group) for group in groups.values())
        for other in others:
            result = self._both(result, other)
        return result

    def _tree(self, parts: list[Node]) -> Node:
        """Return the node of a conjunction, as a tree whose depth grows with the logarithm of its size."""
        while len(parts) > 1:
            pairs = [parts[start : start + 2] for start in range(0, len(parts), 2)]
            parts = [self._both(*pair) if len(pair) == 2 else pair[0] for pair in pairs]
        return parts[0]

    def _both(self, left: Node, right: Node) -> Node:
        return self._pool.make("both", "bool", (left, right))
