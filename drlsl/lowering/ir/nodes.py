"""The intermediate form: typed expressions over the rows of fact relations, each built only once.

A `Node` is an operation on other nodes. A `Pool` makes them: equal nodes are the same object, so a common
subexpression costs nothing, and every constructor simplifies if that does not change the value. An index
node stands for a row of a relation: a loop that a quantifier binds, the first row that meets a condition, or
a fixed row. Loops are numbered by the number of enclosing loops, so that two equal quantifiers are the same
node.

Operations, by kind of result:

==========  ==========================================================================================
index       loop, row, first, argmin, argmax, select
rows        facts, others, where
bool        const, lt, eq, not, and, or, any
number      const, col, select, count, sum, min_of, max_of, and those of `drlsl.logic.core.NODES`
atom        const, col, select
==========  ==========================================================================================
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from heapq import heappop, heappush
from typing import Any, Final, Literal, TypeAlias

from drlsl.logic.terms import Atom
from drlsl.lowering.ir.schema import FLOAT_BOUND, INT_BOUND, Relation

Kind: TypeAlias = Literal["bool", "int", "float", "number", "atom", "index", "rows"]
"""`number` is an integer or a float depending on the scene: always a select between the two."""

Interval: TypeAlias = tuple[float, float]
ANY_FLOAT: Final[Interval] = (-FLOAT_BOUND, FLOAT_BOUND)
ANY_INT: Final[Interval] = (-INT_BOUND, INT_BOUND)
UNKNOWN: Final[Interval] = (-math.inf, math.inf)

SMALL: Final = 16
"""Largest relation whose rows that meet a condition are picked out before a nested loop."""

QUANTIFIERS: Final = frozenset({"any", "count", "sum", "first", "min_of", "max_of", "argmin", "argmax"})


class Node:
    """One operation. `free` holds the loops it depends on, `low` and `high` bound a number's value."""

    __slots__ = ("_loops", "args", "data", "free", "high", "kind", "low", "op", "order")

    def __init__(
        self,
        op: str,
        kind: Kind,
        args: tuple[Node, ...],
        data: Any,
        free: frozenset[Node],
        bounds: Interval,
        order: int,
    ) -> None:
        self.op = op
        self.kind = kind
        self.args = args
        self.data = data
        self.free = frozenset({self}) if op == "loop" else free
        self.low, self.high = bounds
        self.order = order  # of creation: arguments come before the nodes that use them
        self._loops: tuple[Node, ...] | None = None

    def __repr__(self) -> str:
        inside = [repr(self.data)] if self.data is not None else []
        return f"{self.op}({', '.join(inside + [repr(arg) for arg in self.args])})"

    @property
    def is_const(self) -> bool:
        return self.op == "const"

    @property
    def loops(self) -> tuple[Node, ...]:
        """The loops it depends on, in the order of their creation."""
        if self._loops is None:
            self._loops = tuple(sorted(self.free, key=lambda loop: loop.order))
        return self._loops

    @property
    def loop(self) -> Node:
        """The loop that a quantifier or a where node binds."""
        return self.args[1] if self.op == "where" else self.args[0]


def relation_of(rows: Node) -> Relation:
    """Return the relation that an index or rows node ranges over."""
    while rows.op not in ("facts", "others", "row"):
        rows = rows.args[1] if rows.op == "select" else rows.args[0]
    relation: Relation = rows.data
    return relation


class Pool:
    """Makes nodes, and keeps the names of values in the rules, and the sources of comparisons."""

    def __init__(self) -> None:
        self._made: dict[Any, Node] = {}
        self._levels = 1000  # loops under construction; `quantify` numbers them anew
        self.names: Final[dict[Node, str]] = {}
        self.sources: Final[dict[Node, Any]] = {}
        self.true = self.const(True)
        self.false = self.const(False)

    def make(
        self, op: str, kind: Kind, args: tuple[Node, ...] = (), data: Any = None, bounds: Interval = UNKNOWN
    ) -> Node:
        """Return the node of this operation, unsimplified."""
        key = (op, kind, args, data if type(data) is not float else (data, math.copysign(1.0, data)))
        known = self._made.get(key)
        if known is not None:
            return known
        free: frozenset[Node] = frozenset().union(*(arg.free for arg in args))
        if op in QUANTIFIERS:
            free -= args[0].free
            free |= args[0].args[0].free
        elif op == "where":
            free -= {args[1]}
        node = Node(op, kind, args, data, free, bounds, len(self._made))
        self._made[key] = node
        return node

    def name(self, node: Node, name: str) -> Node:
        """Remember a value's name in the rules; the first name is kept."""
        if not node.is_const and node.op != "loop" and not name.startswith("_"):
            self.names.setdefault(node, name)
        return node

    def come_from(self, node: Node, source: Any) -> None:
        """Remember the source of a condition's comparisons; the first source is kept."""
        if node.op in ("not", "and", "or"):
            for arg in node.args:
                self.come_from(arg, source)
        elif not node.is_const:
            self.sources.setdefault(node, source)

    def keep_source(self, node: Node, made: Node) -> None:
        """Give a comparison made from another the same source."""
        if node in self.sources:
            self.come_from(made, self.sources[node])

    def const(self, value: Atom | bool | int | float) -> Node:
        """Return a constant."""
        if isinstance(value, bool):
            return self.make("const", "bool", (), value)
        if isinstance(value, Atom):
            return self.make("const", "atom", (), value)
        if isinstance(value, int):
            # an integer too large for a float has bounds that no operation accepts
            bound = float(value) if abs(value) <= INT_BOUND else math.inf
            return self.make("const", "int", (), value, (bound, bound) if bound < math.inf else UNKNOWN)
        return self.make("const", "float", (), value, (value, value) if math.isfinite(value) else UNKNOWN)

    def column(self, index: Node, relation: Relation, column: int) -> Node:
        """Return the value in one column of a row."""
        if column == relation.key and index.op == "row" and relation.first is not None:
            return self.const(Atom(relation.first))
        kind = relation.columns[column]
        bounds = UNKNOWN if kind == "atom" else ANY_INT if kind == "int" else ANY_FLOAT
        return self.make("col", kind, (index,), (relation, column), bounds)

    def rows(self, relation: Relation) -> Node:
        """Return the rows that a loop visits: all, or all after the one that `first` names."""
        return self.make("facts" if relation.first is None else "others", "rows", (), relation)

    def row(self, relation: Relation) -> Node:
        """Return the first row of a relation that always has one."""
        return self.make("row", "index", (), relation)

    def fresh_loop(self, rows: Node) -> Node:
        """Return a loop that no quantifier binds yet."""
        self._levels += 1
        return self.make("loop", "index", (rows,), self._levels)

    def not_(self, node: Node) -> Node:
        """Return the negation."""
        if node.is_const:
            return self.const(not node.data)
        if node.op == "not":
            return node.args[0]
        if node.op == "or":
            return self.and_(self.not_(arg) for arg in node.args)
        if node.op == "and" and all(arg.op == "not" for arg in node.args):
            return self.or_(arg.args[0] for arg in node.args)
        return self.make("not", "bool", (node,))

    def and_(self, nodes: Iterable[Node]) -> Node:
        """Return the conjunction, in order."""
        parts: dict[Node, Any] = {}
        for node in nodes:
            parts.update(dict.fromkeys(conjuncts(node)))
        parts.pop(self.true, None)
        together = _Conjunction(self, parts)
        together.simplify()
        if together.is_false():
            return self.false
        parts = together.parts
        if len(parts) < 2:
            return next(iter(parts), self.true)
        return self.make("and", "bool", tuple(parts))

    def or_(self, nodes: Iterable[Node]) -> Node:
        """Return the disjunction, in order."""
        parts: dict[Node, None] = {}
        for node in nodes:
            parts.update(dict.fromkeys(node.args if node.op == "or" else (node,)))
        parts.pop(self.false, None)
        if self.true in parts or any(self.not_(part) in parts for part in parts):
            return self.true
        if len(parts) < 2:
            return next(iter(parts), self.false)
        conjunctions = [conjuncts(part) for part in parts]
        common = [node for node in conjunctions[0] if all(node in other for other in conjunctions[1:])]
        if common:
            rests = [self.and_(node for node in other if node not in common) for other in conjunctions]
            return self.and_([*common, self.or_(rests)])
        for part in parts:
            left = self._beside(part, parts)
            if left is not part:
                return self.or_(left if other is part else other for other in parts)
        return self.make("or", "bool", tuple(parts))

    def _beside(self, part: Node, known: Mapping[Node, None]) -> Node:
        """Return a disjunct simplified by the others not holding."""
        if part.op != "and":
            return part
        if any(arg in known for arg in part.args):
            return self.false
        kept = [arg for arg in part.args if self.not_(arg) not in known]
        return part if len(kept) == len(part.args) else self.and_(kept)

    def less(self, left: Node, right: Node) -> Node:
        """Return left < right, both of one kind of number; never given a NaN."""
        if left is right or left.low >= right.high:
            return self.false
        if left.high < right.low:
            return self.true
        return self.make("lt", "bool", (left, right))

    def equal(self, left: Node, right: Node) -> Node:
        """Return left = right, both of one kind. As in the engine, 0.0 and -0.0 are equal."""
        if left is right:
            return self.true
        if left.is_const and right.is_const:
            return self.const(bool(left.data == right.data))
        if left.high < right.low or right.high < left.low:
            return self.false
        for chosen, other in ((left, right), (right, left)):
            if chosen.op == "select" and other.is_const:
                cond, then, els = chosen.args
                return self.choose(cond, self.equal(then, other), self.equal(els, other))
        if left.is_const:
            left, right = right, left
        for key, value in ((left, right), (right, left)):
            if _is_first_key(value) and key.op == "col" and _ranges_over_others(key.args[0]):
                relation, column = key.data
                if column == relation.key and value.data.name == relation.first:
                    return self.false
        if not right.is_const and left.order > right.order:
            left, right = right, left
        return self.make("eq", "bool", (left, right))

    def choose(self, cond: Node, then: Node, els: Node) -> Node:
        """Return `then` if `cond` holds, else `els`."""
        if cond.is_const:
            return then if cond.data else els
        if then is els:
            return then
        if cond.op == "not":
            return self.choose(cond.args[0], els, then)
        if then.kind == "bool":
            return self.or_([self.and_([cond, then]), self.and_([self.not_(cond), els])])
        if then.op == "select" and then.args[0] is cond:
            then = then.args[1]
        if els.op == "select" and els.args[0] is cond:
            els = els.args[2]
        if els.op == "select" and els.args[1] is then:
            return self.choose(self.or_([cond, els.args[0]]), then, els.args[2])
        kind: Kind = then.kind if then.kind == els.kind else "number"
        if kind == "number" and {then.kind, els.kind} - {"int", "float", "number"}:
            raise ValueError(f"no value is of kind {then.kind} or {els.kind}")
        bounds = (min(then.low, els.low), max(then.high, els.high))
        return self.make("select", kind, (cond, then, els), None, bounds)

    def exists(self, loop: Node, cond: Node) -> Node:
        """Return the condition that some row meets `cond`."""
        fixed, inner = _split(loop, cond)
        return self.and_([*fixed, self._quantify("any", "bool", loop, self.and_(inner))])

    def first(self, loop: Node, cond: Node) -> Node:
        """Return the first row that meets the condition; any row if none does."""
        _, inner = _split(loop, cond)
        return self._quantify("first", "index", loop, self.and_(inner))

    def count(self, loop: Node, cond: Node) -> Node:
        """Return the number of rows that meet the condition."""
        fixed, inner = _split(loop, cond)
        counted = self._quantify("count", "int", loop, self.and_(inner), bounds=(0.0, 1e6))
        return self.choose(self.and_(fixed), counted, self.const(0))

    def extreme(self, op: str, loop: Node, cond: Node, value: Node) -> Node:
        """Return the extreme value over the rows that meet the condition, or the first row that has it.

        `op` is min_of, max_of, argmin or argmax. It is undefined if no row meets the condition.
        """
        _, inner = _split(loop, cond)
        if loop not in value.free:
            return value if op in ("min_of", "max_of") else self.first(loop, cond)
        if op in ("min_of", "max_of"):
            return self._quantify(op, value.kind, loop, self.and_(inner), (value,), (value.low, value.high))
        return self._quantify(op, "index", loop, self.and_(inner), (value,))

    def total(self, loop: Node, cond: Node, value: Node, start: Node, bounds: Interval) -> Node:
        """Return `start` plus the values of the rows that meet the condition, added in order."""
        fixed, inner = _split(loop, cond)
        added = self._quantify("sum", value.kind, loop, self.and_(inner), (value, start), bounds)
        return self.choose(self.and_(fixed), added, start)

    def _quantify(
        self,
        op: str,
        kind: Kind,
        loop: Node,
        cond: Node,
        values: tuple[Node, ...] = (),
        bounds: Interval = UNKNOWN,
    ) -> Node:
        if op == "any" and cond is self.false:
            return self.false
        if op == "count" and cond is self.false:
            return self.const(0)
        outer = (cond.free.union(*(v.free for v in values)) | loop.args[0].free) - {loop}
        own: list[Node] = []
        rest: list[Node] = []
        for part in conjuncts(cond):
            (own if part.free <= {loop} and not _holds_loop_inside(part, loop) else rest).append(part)
        rows = loop.args[0]
        small = relation_of(loop).capacity <= SMALL
        select = outer or (small and any(_holds_loop_inside(node, loop) for node in (*rest, *values)))
        if own and select and own != [self.true]:
            rows = self._where(rows, loop, self.and_(own))
            cond = self.and_(rest)
        used = {node.data for node in outer}
        level = next(n for n in range(len(used) + 1) if n not in used)
        bound = self.make("loop", "index", (rows,), level)
        if bound is not loop:
            renaming = {loop: bound}
            cond = self.substitute(cond, renaming)
            values = tuple(self.substitute(v, renaming) for v in values)
        return self.make(op, kind, (bound, cond, *values), None, bounds)

    def _where(self, rows: Node, loop: Node, cond: Node) -> Node:
        """Return the rows that meet a condition of their own."""
        bound = self.make("loop", "index", (rows,), 0)
        return self.make("where", "rows", (rows, bound, self.substitute(cond, {loop: bound})))

    def substitute(self, node: Node, mapping: Mapping[Node, Node]) -> Node:
        """Return `node` with other nodes in place of loops."""
        return self._substitute(node, mapping, {})

    def _substitute(self, node: Node, mapping: Mapping[Node, Node], done: dict[Node, Node]) -> Node:
        if node in mapping:
            return mapping[node]
        if node.op == "loop" or not node.free & mapping.keys():
            return node
        known = done.get(node)
        if known is None:
            if node.op in QUANTIFIERS:
                # a fresh bound loop, so that substituted nodes are not captured
                fresh = self.fresh_loop(node.args[0].args[0])
                inner = {**mapping, node.args[0]: fresh}
                known = self._requantify(node, fresh, [self.substitute(arg, inner) for arg in node.args[1:]])
            else:
                known = self.rebuild(node, tuple(self._substitute(arg, mapping, done) for arg in node.args))
            done[node] = known
            self.keep_source(node, known)
            if node in self.names:
                self.name(known, self.names[node])
        return known

    def _requantify(self, node: Node, loop: Node, parts: list[Node]) -> Node:
        if node.op == "any":
            return self.exists(loop, parts[0])
        if node.op == "first":
            return self.first(loop, parts[0])
        if node.op == "count":
            return self.count(loop, parts[0])
        if node.op == "sum":
            return self.total(loop, parts[0], parts[1], parts[2], (node.low, node.high))
        return self.extreme(node.op, loop, parts[0], parts[1])

    def rebuild(self, node: Node, args: tuple[Node, ...]) -> Node:
        """Return the operation of `node` on other arguments."""
        simple: dict[str, Callable[..., Node]] = {
            "not": self.not_,
            "lt": self.less,
            "eq": self.equal,
            "select": self.choose,
        }
        if node.op in simple:
            return simple[node.op](*args)
        if node.op == "and":
            return self.and_(args)
        if node.op == "or":
            return self.or_(args)
        if node.op == "col":
            return self.column(args[0], *node.data)
        return self.make(node.op, node.kind, args, node.data, (node.low, node.high))


_Place: TypeAlias = tuple[int, ...]
"""The place of a part: what replaces it has the same, and its number among several in addition."""


class _Conjunction:
    """The different parts of a conjunction in order, each to be simplified by the others."""

    def __init__(self, pool: Pool, parts: dict[Node, Any]) -> None:
        self._pool = pool
        self.parts = parts
        self._fixed: Counter[Node] | None = None
        self._todo: list[tuple[_Place, int, Node]] = []
        self._done: set[Node] = set()
        self._dependent: dict[Node, list[Node]] = {}

    def simplify(self) -> None:
        """Simplify the first part that can be simplified, then again the first, until none can be."""
        if all(self._simple(part) is part for part in self.parts):
            return
        self.parts = {part: (number,) for number, part in enumerate(self.parts)}
        self._todo = [(place, part.order, part) for part, place in self.parts.items()]
        while self._todo:
            place, _, part = heappop(self._todo)
            if self.parts.get(part) != place or part in self._done:
                continue
            simple = self._simple(part)
            if simple is part:
                self._leave(part)
            else:
                self._replace(part, simple)
        self.parts = dict.fromkeys(sorted(self.parts, key=self.parts.__getitem__))

    def is_false(self) -> bool:
        """Return whether a part is false, or contradicts another."""
        return self._pool.false in self.parts or any(map(self._is_excluded, self.parts))

    def _leave(self, part: Node) -> None:
        """Look at a part that is simple only once one is added that may change this; none that goes does."""
        self._done.add(part)
        for node in self._decisive(part):
            self._dependent.setdefault(node, []).append(part)

    def _decisive(self, part: Node) -> Iterator[Node]:
        """Yield the nodes that simplify a part if they, or their equality with a constant, are parts, too."""
        if part.op == "or":
            for arg in part.args:
                yield from (arg, self._pool.not_(arg), *conjuncts(arg))
        elif part.op == "not" and part.args[0].op == "and":
            yield from part.args[0].args
        elif part.op == "not" and part.args[0].op == "eq":
            yield part.args[0].args[0]

    def _replace(self, part: Node, simple: Node) -> None:
        """Put the parts of a simplified part in its place; one with two places keeps the first."""
        place = self.parts.pop(part)
        for number, node in enumerate(conjuncts(simple)):
            here, known = (*place, number), self.parts.get(node)
            if node is self._pool.true or (known is not None and known < here):
                continue
            self.parts[node] = here
            heappush(self._todo, (here, node.order, node))
            if known is None:
                self._look_again(node)

    def _look_again(self, added: Node) -> None:
        """Have parts looked at again that an added one may simplify."""
        self._done.discard(added)
        causes = [added]
        if _is_fixing(added):
            causes.append(added.args[0])
            if self._fixed is not None:
                self._fixed[added.args[0]] += 1
        for part in (one for cause in causes for one in self._dependent.get(cause, ())):
            if part in self.parts and part in self._done:
                self._done.remove(part)
                heappush(self._todo, (self.parts[part], part.order, part))

    def _simple(self, part: Node) -> Node:
        """Return a part simplified by the others."""
        pool, known = self._pool, self.parts
        if part.op == "or":
            if any(
                arg in known or (arg.op == "and" and all(a in known for a in arg.args)) for arg in part.args
            ):
                return pool.true
            kept = [arg for arg in part.args if pool.not_(arg) not in known]
            return part if len(kept) == len(part.args) else pool.or_(kept)
        if part.op == "not" and part.args[0].op == "and":
            kept = [arg for arg in part.args[0].args if arg not in known]
            return part if len(kept) == len(part.args[0].args) else pool.not_(pool.and_(kept))
        if part.op == "not" and part.args[0].op == "eq":
            left, right = part.args[0].args
            if right.is_const and self._fixes(left) and part.args[0] not in known:
                return pool.true
        return part

    def _is_excluded(self, part: Node) -> bool:
        """Return whether a part contradicts another."""
        pool, known = self._pool, self.parts
        if pool.not_(part) in known:
            return True
        if part.op == "lt":
            return pool.make("lt", "bool", (part.args[1], part.args[0])) in known
        return _is_fixing(part) and self._fixes(part.args[0]) > 1

    def _fixes(self, value: Node) -> int:
        """Return how many parts say that a value equals a constant."""
        if self._fixed is None:
            self._fixed = Counter(part.args[0] for part in self.parts if _is_fixing(part))
        return self._fixed[value]


def _is_fixing(node: Node) -> bool:
    """Return whether a condition says that a value equals a constant."""
    return node.op == "eq" and node.args[1].is_const


def conjuncts(node: Node) -> tuple[Node, ...]:
    """Return the parts of a conjunction."""
    return node.args if node.op == "and" else (node,)


def reach(roots: Iterable[Node], known: Container[Node] = ()) -> dict[Node, None]:
    """Return all nodes below the roots, arguments first; known nodes and their parts are left out."""
    found: dict[Node, None] = {}

    def visit(node: Node) -> None:
        if node not in found and node not in known:
            for arg in node.args:
                visit(arg)
            found[node] = None

    for root in roots:
        visit(root)
    return found


def _split(loop: Node, cond: Node) -> tuple[list[Node], list[Node]]:
    """Return the conjuncts that do not depend on the loop, and those that do."""
    fixed = [part for part in conjuncts(cond) if loop not in part.free]
    return fixed, [part for part in conjuncts(cond) if loop in part.free]


def _holds_loop_inside(node: Node, loop: Node) -> bool:
    """Return whether a quantifier inside `node` depends on `loop`."""
    if loop not in node.free:
        return False
    return node.op in QUANTIFIERS or any(_holds_loop_inside(arg, loop) for arg in node.args)


def _ranges_over_others(index: Node) -> bool:
    """Return whether an index is surely not the first row of its relation."""
    if index.op in ("loop", "first", "argmin", "argmax"):
        return _base(index).op == "others"
    return index.op == "select" and all(_ranges_over_others(arg) for arg in index.args[1:])


def _base(node: Node) -> Node:
    while node.op not in ("facts", "others", "row"):
        node = node.args[0]
    return node


def _is_first_key(node: Node) -> bool:
    return node.is_const and isinstance(node.data, Atom)
