"""Solutions as trees: the solutions of a goal, in Prolog's order, before they become expressions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

from drlsl.logic.terms import Atom, Struct, Var, deref
from drlsl.lowering.ir.nodes import Node, Pool, conjuncts

Sym: TypeAlias = Any
"""A term in which a node stands for a constant that depends on the facts."""


def resolve(term: Sym) -> Sym:
    """Return the term that a chain of bound variables leads to."""
    return deref(term)


@dataclass(frozen=True, slots=True)
class Fail:
    """No solution."""


@dataclass(frozen=True, slots=True)
class Emit:
    """One solution."""

    terms: tuple[Sym, ...]


@dataclass(frozen=True, slots=True)
class Guard:
    """The solutions of `body` if `cond` holds."""

    cond: Node
    body: Tree


@dataclass(frozen=True, slots=True)
class Require:
    """The solutions of `body`; an error if `cond` does not hold."""

    cond: Node
    body: Tree


@dataclass(frozen=True, slots=True)
class Branch:
    """The solutions of one side."""

    cond: Node
    then: Tree
    els: Tree


@dataclass(frozen=True, slots=True)
class Seq:
    """The solutions of one after another."""

    parts: tuple[Tree, ...]


@dataclass(frozen=True, slots=True)
class Each:
    """The solutions of `body` for every row, in order."""

    loop: Node
    body: Tree


Tree: TypeAlias = Fail | Emit | Guard | Require | Branch | Seq | Each
FAIL: Final = Fail()


class CannotMerge(Exception):
    """Two solutions have values that no single expression can give."""


def guard(cond: Node, body: Tree) -> Tree:
    """Return `body` if `cond` holds."""
    if cond.is_const:
        return body if cond.data else FAIL
    return FAIL if isinstance(body, Fail) else Guard(cond, body)


def require(cond: Node, body: Tree) -> Tree:
    """Return `body`, or an error if `cond` does not hold."""
    if cond.is_const:
        return body if cond.data else Require(cond, FAIL)
    return Require(cond, body)


def branch(cond: Node, then: Tree, els: Tree) -> Tree:
    """Return `then` if `cond` holds, else `els`."""
    if cond.is_const:
        return then if cond.data else els
    if isinstance(els, Fail):
        return guard(cond, then)
    return Branch(cond, then, els)


def seq(parts: Iterable[Tree]) -> Tree:
    """Return the solutions of the parts, one after another."""
    flat: list[Tree] = []
    for part in parts:
        flat.extend(part.parts if isinstance(part, Seq) else () if isinstance(part, Fail) else (part,))
    if len(flat) < 2:
        return flat[0] if flat else FAIL
    return Seq(tuple(flat))


def each(loop: Node, body: Tree) -> Tree:
    """Return `body` for every row."""
    return FAIL if isinstance(body, Fail) else Each(loop, body)


def leaves(tree: Tree) -> int:
    """Return the number of solutions written in the tree."""
    if isinstance(tree, Emit):
        return 1
    return sum(leaves(child) for child in children(tree))


def emitted(tree: Tree) -> Iterator[Emit]:
    """Yield the solutions written in the tree, in order."""
    if isinstance(tree, Emit):
        yield tree
    for child in children(tree):
        yield from emitted(child)


def has_each(tree: Tree) -> bool:
    """Return whether the tree loops over rows."""
    return isinstance(tree, Each) or any(has_each(child) for child in children(tree))


def children(tree: Tree) -> tuple[Tree, ...]:
    """Return the trees just below."""
    if isinstance(tree, Guard | Require | Each):
        return (tree.body,)
    if isinstance(tree, Branch):
        return (tree.then, tree.els)
    return tree.parts if isinstance(tree, Seq) else ()


def map_terms(function: Callable[[Sym], Sym], term: Sym) -> Sym:
    """Return `term` with `function` applied to the nodes, variables and constants in it."""
    if isinstance(term, Var):
        term = resolve(term)
    if isinstance(term, Struct):
        return Struct(term.name, tuple(map_terms(function, arg) for arg in term.args))
    if isinstance(term, Bag):
        return Bag(substitute_tree(term.tree, function))
    return function(term)


@dataclass(frozen=True, slots=True)
class Bag:
    """The list of a findall/3: the only term of each solution, in order."""

    tree: Tree


def substitute_tree(tree: Tree, function: Callable[[Sym], Sym]) -> Tree:
    """Return the tree with `function` applied to every node and every emitted term's parts."""
    if isinstance(tree, Emit):
        return Emit(tuple(map_terms(function, term) for term in tree.terms))
    if isinstance(tree, Guard):
        return guard(function(tree.cond), substitute_tree(tree.body, function))
    if isinstance(tree, Require):
        return require(function(tree.cond), substitute_tree(tree.body, function))
    if isinstance(tree, Branch):
        then, els = (substitute_tree(child, function) for child in (tree.then, tree.els))
        return branch(function(tree.cond), then, els)
    if isinstance(tree, Seq):
        return seq(substitute_tree(part, function) for part in tree.parts)
    if isinstance(tree, Each):
        return each(tree.loop, substitute_tree(tree.body, function))
    return tree


def rename_loop(pool: Pool, tree: Each, index: Node) -> Tree:
    """Return the body of a loop with another index in place of its own."""
    mapping = {tree.loop: index}
    return substitute_tree(tree.body, substitution(pool, mapping))


def substitution(pool: Pool, mapping: Mapping[Node, Node]) -> Callable[[Sym], Sym]:
    """Return the function that replaces loops in a term's parts."""
    return lambda part: pool.substitute(part, mapping) if isinstance(part, Node) else part


class Folder:
    """Folds trees of solutions into expressions."""

    def __init__(self, pool: Pool) -> None:
        self.pool = pool

    def exists(self, tree: Tree) -> Node:
        """Return the condition that there is a solution."""
        pool = self.pool
        if isinstance(tree, Emit):
            return pool.true
        if isinstance(tree, Guard):
            return pool.and_([tree.cond, self.exists(tree.body)])
        if isinstance(tree, Require):
            return self.exists(tree.body)
        if isinstance(tree, Branch):
            return pool.choose(tree.cond, self.exists(tree.then), self.exists(tree.els))
        if isinstance(tree, Seq):
            return pool.or_(self.exists(part) for part in tree.parts)
        if isinstance(tree, Each):
            return pool.exists(tree.loop, self.exists(tree.body))
        return pool.false

    def undecided(self, tree: Tree, *, whole: bool) -> Node:
        """Return the condition for an error on the way to the first solution, or to the `whole` of them.

        Within a loop, rows behind the first solution count, too: the interpreter then decides.
        """
        pool = self.pool
        if isinstance(tree, Guard):
            return pool.and_([tree.cond, self.undecided(tree.body, whole=whole)])
        if isinstance(tree, Require):
            return pool.or_([pool.not_(tree.cond), self.undecided(tree.body, whole=whole)])
        if isinstance(tree, Branch):
            then, els = (self.undecided(child, whole=whole) for child in (tree.then, tree.els))
            return pool.choose(tree.cond, then, els)
        if isinstance(tree, Seq):
            result = pool.false
            for part in reversed(tree.parts):
                if result is not pool.false and not whole:
                    result = pool.and_([pool.not_(self.exists(part)), result])
                result = pool.or_([self.undecided(part, whole=whole), result])
            return result
        if isinstance(tree, Each):
            return pool.exists(tree.loop, self.undecided(tree.body, whole=whole))
        return pool.false

    def first(self, tree: Tree) -> tuple[Node, tuple[Sym, ...]]:
        """Return whether there is a solution, and the terms of the first.

        Raises:
            CannotMerge: no expressions give the terms.
        """
        pool = self.pool
        if isinstance(tree, Emit):
            return pool.true, tree.terms
        if isinstance(tree, Guard):
            found, terms = self.first(tree.body)
            return pool.and_([tree.cond, found]), terms
        if isinstance(tree, Require):
            return self.first(tree.body)
        if isinstance(tree, Branch):
            then, els = self.first(tree.then), self.first(tree.els)
            return pool.choose(tree.cond, then[0], els[0]), self._either(tree.cond, then, els)
        if isinstance(tree, Seq):
            result = self.first(tree.parts[-1])
            for part in reversed(tree.parts[:-1]):
                one = self.first(part)
                result = pool.or_([one[0], result[0]]), self._either(one[0], one, result)
            return result
        if isinstance(tree, Each):
            found, terms = self.first(tree.body)
            index = pool.first(tree.loop, found)
            replace = substitution(pool, {tree.loop: index})
            return pool.exists(tree.loop, found), tuple(map_terms(replace, term) for term in terms)
        return pool.false, ()

    def _either(
        self, cond: Node, then: tuple[Node, tuple[Sym, ...]], els: tuple[Node, tuple[Sym, ...]]
    ) -> tuple[Sym, ...]:
        if then[0] is self.pool.false or els[0] is self.pool.false:
            return els[1] if then[0] is self.pool.false else then[1]
        return tuple(self.merge(cond, one, other) for one, other in zip(then[1], els[1], strict=True))

    def merge(self, cond: Node, then: Sym, els: Sym) -> Sym:
        """Return the term that is `then` if `cond` holds, else `els`."""
        then, els = resolve(then), resolve(els)
        if then is els:
            return then
        if isinstance(then, Struct) and isinstance(els, Struct):
            if then.name != els.name or len(then.args) != len(els.args):
                raise CannotMerge
            args = zip(then.args, els.args, strict=True)
            return Struct(then.name, tuple(self.merge(cond, one, other) for one, other in args))
        one, other = self.as_node(then), self.as_node(els)
        if one is None or other is None:
            raise CannotMerge
        if one.kind != other.kind and {one.kind, other.kind} & {"atom", "bool"}:
            raise CannotMerge
        return self.choose_column(cond, one, other)

    def choose_column(self, cond: Node, then: Node, els: Node) -> Node:
        """Return `Pool.choose`; for two keys of one relation, the key of the chosen row."""
        if then is not els and not cond.is_const:
            one, other = self.key_index(then, els), self.key_index(els, then)
            if one is not None and other is not None:
                relation, column = (then if then.op == "col" else els).data
                return self.pool.column(self.pool.choose(cond, one, other), relation, column)
        return self.pool.choose(cond, then, els)

    def key_index(self, node: Node, other: Node) -> Node | None:
        """Return the row whose key `node` is, if `other` is a key of the same relation."""
        if node.op == "col":
            relation, column = node.data
            return node.args[0] if column == relation.key else None
        if other.op != "col" or not isinstance(node.data, Atom):
            return None
        relation, column = other.data
        if column == relation.key and relation.first == node.data.name:
            return self.pool.row(relation)
        return None

    def as_node(self, term: Sym) -> Node | None:
        """Return a constant or node as a node."""
        if isinstance(term, Node):
            return term
        return self.pool.const(term) if isinstance(term, Atom | int | float) else None

    def count(self, tree: Tree) -> Node:
        """Return the number of solutions."""
        cond, number = self._count(tree)
        return self.pool.choose(cond, number, self.pool.const(0))

    def _count(self, tree: Tree) -> tuple[Node, Node]:
        pool = self.pool
        one = pool.const(1)
        if isinstance(tree, Emit):
            return pool.true, one
        if isinstance(tree, Guard):
            cond, number = self._count(tree.body)
            return pool.and_([tree.cond, cond]), number
        if isinstance(tree, Require):
            return self._count(tree.body)
        if isinstance(tree, Branch):
            return pool.true, pool.choose(tree.cond, self.count(tree.then), self.count(tree.els))
        if isinstance(tree, Seq):
            number = pool.const(0)
            for part in tree.parts:
                number = self._add(number, self.count(part))
            return pool.true, number
        if isinstance(tree, Each):
            cond, number = self._count(tree.body)
            if number is one:
                return pool.true, pool.count(tree.loop, cond)
            return pool.true, pool.total(tree.loop, cond, number, pool.const(0), (0.0, 1e12))
        return pool.false, one

    def _add(self, left: Node, right: Node) -> Node:
        if left.is_const and right.is_const:
            return self.pool.const(left.data + right.data)
        if left.is_const and left.data == 0 and left.kind == "int":
            return right
        return self.pool.make(
            "add", left.kind, (left, right), None, (left.low + right.low, left.high + right.high)
        )

    def extreme(self, tree: Tree, least: bool) -> tuple[Node, Node, tuple[Sym, ...]]:
        """Return whether there is a solution, the least or greatest first term, and its other terms."""
        pool = self.pool
        if isinstance(tree, Emit):
            return pool.true, tree.terms[0], tree.terms[1:]
        if isinstance(tree, Guard):
            found, value, terms = self.extreme(tree.body, least)
            return pool.and_([tree.cond, found]), value, terms
        if isinstance(tree, Require):
            return self.extreme(tree.body, least)
        if isinstance(tree, Branch):
            one, other = self.extreme(tree.then, least), self.extreme(tree.els, least)
            return self._better(tree.cond, pool.choose(tree.cond, one[0], other[0]), one, other)
        if isinstance(tree, Seq):
            result = self.extreme(tree.parts[0], least)
            for part in tree.parts[1:]:
                other = self.extreme(part, least)
                if result[0] is pool.false or other[0] is pool.false:
                    result = other if result[0] is pool.false else result
                    continue
                worse = pool.less(other[1], result[1]) if least else pool.less(result[1], other[1])
                keep = pool.and_([result[0], pool.not_(pool.and_([other[0], worse]))])
                result = self._better(keep, pool.or_([result[0], other[0]]), result, other)
            return result
        if isinstance(tree, Each):
            return self._extreme_row(tree, least)
        return pool.false, pool.const(0), ()

    def _extreme_row(self, tree: Each, least: bool) -> tuple[Node, Node, tuple[Sym, ...]]:
        pool = self.pool
        found, value, terms = self.extreme(tree.body, least)
        if value.kind not in ("int", "float"):
            raise CannotMerge
        best = pool.extreme("min_of" if least else "max_of", tree.loop, found, value)
        index = pool.extreme("argmin" if least else "argmax", tree.loop, found, value)
        replace = substitution(pool, {tree.loop: index})
        return pool.exists(tree.loop, found), best, tuple(map_terms(replace, term) for term in terms)

    def _better(
        self,
        cond: Node,
        found: Node,
        one: tuple[Node, Node, tuple[Sym, ...]],
        other: tuple[Node, Node, tuple[Sym, ...]],
    ) -> tuple[Node, Node, tuple[Sym, ...]]:
        if one[0] is self.pool.false or other[0] is self.pool.false:
            return (found, *(other if one[0] is self.pool.false else one)[1:])
        if one[1].kind != other[1].kind:
            raise CannotMerge
        terms = tuple(self.merge(cond, a, b) for a, b in zip(one[2], other[2], strict=True))
        return found, self.pool.choose(cond, one[1], other[1]), terms

    def total(self, tree: Tree) -> Node:
        """Return the sum of the first terms, added in order to 0.

        Raises:
            CannotMerge: no expression adds these numbers in that order.
        """
        kinds = {leaf.terms[0].kind for leaf in emitted(tree)}
        if kinds - {"int", "float"} or len(kinds) > 1:
            raise CannotMerge
        if kinds == {"float"}:
            # without a solution the sum is the integer
            return self.pool.choose(
                self.exists(tree), self._total(tree, self.pool.const(0.0)), self.pool.const(0)
            )
        return self._total(tree, self.pool.const(0))

    def _total(self, tree: Tree, start: Node) -> Node:
        """Return the sum added to `start`."""
        pool = self.pool
        if isinstance(tree, Emit):
            return self._add(start, tree.terms[0])
        if isinstance(tree, Guard):
            return pool.choose(tree.cond, self._total(tree.body, start), start)
        if isinstance(tree, Require):
            return self._total(tree.body, start)
        if isinstance(tree, Branch):
            return pool.choose(tree.cond, self._total(tree.then, start), self._total(tree.els, start))
        if isinstance(tree, Seq):
            for part in tree.parts:
                start = self._total(part, start)
            return start
        if isinstance(tree, Each):
            return self._total_of_rows(tree, start)
        return start

    def _total_of_rows(self, tree: Each, start: Node) -> Node:
        pool = self.pool
        if leaves(tree.body) == 0:
            return start
        if start.kind == "int":
            cond, value = self.exists(tree.body), self._total(tree.body, pool.const(0))
        else:
            leaf = next(emitted(tree.body))
            if leaves(tree.body) > 1 or has_each(tree.body):
                raise CannotMerge
            cond, value = self.exists(tree.body), leaf.terms[0]
        bound = 1e6 * max(abs(value.low), abs(value.high))
        return pool.total(tree.loop, cond, value, start, (start.low - bound, start.high + bound))

    def single(self, tree: Tree) -> bool:
        """Return whether there is at most one solution."""
        if isinstance(tree, Each):
            return False
        if isinstance(tree, Seq):
            needs = [self.necessary(part) for part in tree.parts]
            exclusive = all(self._exclude(a, b) for n, a in enumerate(needs) for b in needs[n + 1 :])
            return exclusive and all(map(self.single, tree.parts))
        return all(map(self.single, children(tree)))

    def necessary(self, tree: Tree) -> frozenset[Node]:
        """Return conditions without which there is no solution."""
        if isinstance(tree, Guard):
            return frozenset(conjuncts(tree.cond)) | self.necessary(tree.body)
        if isinstance(tree, Require):
            return self.necessary(tree.body)
        if isinstance(tree, Branch):
            then = self.necessary(tree.then) | {tree.cond}
            return then & (self.necessary(tree.els) | {self.pool.not_(tree.cond)})
        if isinstance(tree, Seq):
            return frozenset.intersection(*(self.necessary(part) for part in tree.parts))
        return frozenset()

    def _exclude(self, one: frozenset[Node], other: frozenset[Node]) -> bool:
        return self.pool.and_([*one, *other]) is self.pool.false


def alternatives(pool: Pool, tree: Tree, path: Node | None = None) -> Iterator[tuple[Node, tuple[Sym, ...]]]:
    """Yield every solution of a tree without loops, in order, with its condition."""
    path = pool.true if path is None else path
    if isinstance(tree, Emit):
        yield path, tree.terms
    elif isinstance(tree, Guard):
        yield from alternatives(pool, tree.body, pool.and_([path, tree.cond]))
    elif isinstance(tree, Branch):
        yield from alternatives(pool, tree.then, pool.and_([path, tree.cond]))
        yield from alternatives(pool, tree.els, pool.and_([path, pool.not_(tree.cond)]))
    else:
        for child in children(tree):
            yield from alternatives(pool, child, path)
