"""Answers as lists of solutions, in the order of Prolog."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from typing import ClassVar, NamedTuple

from drlsl.logic.terms import NIL, Atom, Struct
from drlsl.lowering.backends.expressions import CHOICE, OR
from drlsl.lowering.backends.loops import LoopPrinter
from drlsl.lowering.frontend import Answer
from drlsl.lowering.ir import (
    Bag,
    Branch,
    Each,
    Emit,
    Guard,
    Node,
    Pool,
    Sym,
    Tree,
    children,
    relation_of,
    resolve,
)


class SolutionLoops(LoopPrinter):
    """Writes the loops that go through the solutions of a tree."""

    @abstractmethod
    def emit(self, terms: Sequence[Sym], name: str) -> None:
        """Write what adds a solution to those called `name`."""

    @abstractmethod
    def nothing(self) -> None:
        """Write an empty block."""

    def collect(self, tree: Tree, name: str) -> None:
        """Write what adds each solution of a tree to those called `name`."""
        if isinstance(tree, Emit):
            self.emit(tree.terms, name)
        elif isinstance(tree, Guard):
            self._collect_if(tree.cond, tree.body, name)
        elif isinstance(tree, Branch):
            self._collect_if(tree.cond, tree.then, name)
            with self.block("else"):
                self.collect(tree.els, name)
        elif isinstance(tree, Each):
            row = self.names.new(relation_of(tree.loop).name)
            with self.each(tree.loop, row):
                self.collect(tree.body, name)
        else:
            for child in children(tree):
                self.collect(child, name)
            if not children(tree):
                self.nothing()

    def _collect_if(self, cond: Node, tree: Tree, name: str) -> None:
        self.nested_quantifiers(cond)
        with self.block(self.test(self.text(cond, CHOICE))):
            self.collect(tree, name)


class ListWords(NamedTuple):
    """A language's words about a list, each with `{name}` for its name.

    `start`: the statement that makes it, of `{items}`; `append`: the one that adds an `{item}`; `distinct`:
    its items without those that came before; `first`: its first item, nothing if it is empty.
    """

    start: str
    append: str
    distinct: str
    first: str


class AnswerLists(SolutionLoops):
    """Writes answers in a language that has lists: a solution is a value, or a tuple of several."""

    lists: ClassVar[ListWords]
    none: ClassVar[str]

    def sequence(self, items: Sequence[str]) -> str:
        """Return a list."""
        return f"[{', '.join(items)}]"

    @abstractmethod
    def several(self, items: Sequence[str]) -> str:
        """Return the arguments of a solution, none or more than one."""

    @abstractmethod
    def compound(self, name: str, args: Sequence[str]) -> str:
        """Return a compound term."""

    @abstractmethod
    def string(self, text: str) -> str:
        """Return a string of Prolog."""

    def answer(self, answer: Answer) -> str:
        """Write what computes an answer; return its text."""
        mode = answer.query.mode
        if mode == "holds":
            return self.text(answer.found, OR)
        if mode == "first" and answer.terms is not None:
            value = self._terms(answer.terms)
            if answer.found is self.pool.true:
                return value
            return self.conditional(self.text(answer.found, OR), value, self.none)
        if mode == "set" and answer.choices is not None and answer.in_order:
            return self._chosen(answer)
        name = self._solutions(answer.tree, answer.query.name)
        if mode == "set":
            return self.lists.distinct.format(name=name)
        return name if mode == "all" else self.lists.first.format(name=name)

    def emit(self, terms: Sequence[Sym], name: str) -> None:
        self._append(name, self._terms(terms))

    def _append(self, name: str, item: str) -> None:
        self.write(self.lists.append.format(name=name, item=item))

    def _start(self, name: str, items: Sequence[str]) -> None:
        self.write(self.lists.start.format(name=name, items=self.sequence(items)))

    def _chosen(self, answer: Answer) -> str:
        """Return the list of the values that are solutions."""
        name = self.names.new(answer.query.name)
        sure = [value for value, cond in answer.choices or () if cond is self.pool.true]
        assert answer.choices is not None
        start = sure[:1] if answer.choices[:1] == tuple((value, self.pool.true) for value in sure[:1]) else []
        self._start(name, list(map(self._term, start)))
        for value, cond in answer.choices[len(start) :]:
            if cond is self.pool.true:
                self._append(name, self._term(value))
                continue
            with self.block(self.test(self.text(cond, CHOICE))):
                self._append(name, self._term(value))
        return name

    def _solutions(self, tree: Tree, hint: str) -> str:
        """Return the list of all solutions of a tree."""
        name = self.names.new(hint)
        self._start(name, [])
        self.collect(tree, name)
        return name

    def _terms(self, terms: Sequence[Sym]) -> str:
        """Return the arguments of a solution."""
        if len(terms) == 1:
            return self._term(terms[0])
        return self.several(list(map(self._term, terms)))

    def _term(self, term: Sym) -> str:
        """Return a term in the form of the engine's solutions."""
        term = resolve(term)
        if isinstance(term, Node):
            self.nested_quantifiers(term)
            return self.text(term, OR)
        if isinstance(term, Bag):
            return self._solutions(term.tree, "items")
        if isinstance(term, Atom):
            return self.sequence([]) if term is NIL else self.atom(term.name)
        if isinstance(term, str):
            return self.string(term)
        if isinstance(term, Struct):
            return self._compound(term)
        return self.number(term)

    def _compound(self, term: Struct) -> str:
        items: list[Sym] = []
        rest: Sym = term
        while isinstance(rest, Struct) and rest.name == "." and len(rest.args) == 2:
            items.append(rest.args[0])
            rest = resolve(rest.args[1])
        if rest is NIL:
            return self.sequence(list(map(self._term, items)))
        return self.compound(term.name, list(map(self._term, term.args)))


def results_of(pool: Pool, answers: Iterable[Answer]) -> Iterator[tuple[Node, Node]]:
    """Yield the nodes of answers that are lists of solutions or one of them.

    Each comes with the condition under which it is used.
    """
    for answer in answers:
        mode = answer.query.mode
        if mode == "holds":
            yield answer.found, pool.true
        elif mode == "first" and answer.terms is not None:
            yield answer.found, pool.true
            for term in answer.terms:
                yield from _nodes_of(pool, term, pool.true)
        elif mode == "set" and answer.choices is not None and answer.in_order:
            for _, cond in answer.choices:
                yield cond, pool.true
        else:
            yield from tree_nodes(pool, answer.tree, pool.true)


def tree_nodes(pool: Pool, tree: Tree, when: Node) -> Iterator[tuple[Node, Node]]:
    """Yield the nodes in a tree of solutions that is used under a condition, each with its own."""

    def inside(cond: Node) -> Node:
        return when if cond.free else pool.and_([when, cond])

    if isinstance(tree, Branch):
        yield tree.cond, when
        yield from tree_nodes(pool, tree.then, inside(tree.cond))
        yield from tree_nodes(pool, tree.els, inside(pool.not_(tree.cond)))
        return
    if isinstance(tree, Emit):
        for term in tree.terms:
            yield from _nodes_of(pool, term, when)
    if isinstance(tree, Each):
        yield tree.loop, when
    if isinstance(tree, Guard):
        yield tree.cond, when
        when = inside(tree.cond)
    for child in children(tree):
        yield from tree_nodes(pool, child, when)


def _nodes_of(pool: Pool, term: Sym, when: Node) -> Iterator[tuple[Node, Node]]:
    """Yield the nodes in a term."""
    term = resolve(term)
    if isinstance(term, Node):
        yield term, when
    elif isinstance(term, Struct):
        for arg in term.args:
            yield from _nodes_of(pool, arg, when)
    elif isinstance(term, Bag):
        yield from tree_nodes(pool, term.tree, when)
