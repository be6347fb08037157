"""The back end for one scene: one Python function whose rows are tuples."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final, TypeAlias

from drlsl.logic.terms import NIL, Atom, Struct
from drlsl.lowering.backends.loops import LoopPrinter
from drlsl.lowering.backends.python_text import ATOMIC, CHOICE, COMPARISON, OR, is_lookup, lookup_value
from drlsl.lowering.backends.scalar_support import SUPPORT, Facts, blank_row
from drlsl.lowering.frontend import Answer, Lowered
from drlsl.lowering.ir import (
    Bag,
    Branch,
    Each,
    Emit,
    Guard,
    Names,
    Node,
    Relation,
    Sym,
    Tree,
    children,
    relation_of,
    resolve,
)

Scalar: TypeAlias = Callable[[Facts], tuple[Any, ...]]

_RESERVED: Final = (*SUPPORT, "answer", "facts")


def compile_scalar(lowered: Lowered) -> Scalar:
    """Return the function that answers all queries for the facts of one scene.

    It takes the rows of every relation by name and arity, as given to `Engine.replace_facts`, and returns one
    answer per query: for `holds` a bool; for `first` the argument, or a tuple of them, None without a
    solution; for `all` a list of such. It raises `Undecided` if only the interpreter can answer.
    """
    printer = _Printer(lowered)
    namespace = {**SUPPORT, **printer.constants}
    exec(compile(printer.module(), "<lowered rules>", "exec"), namespace)  # noqa: S102  (the text is made here)
    namespace.update(printer.constants)
    function: Scalar = namespace["answer"]
    return function


def scalar_source(lowered: Lowered) -> str:
    """Return the text of that function."""
    return _Printer(lowered).module()


class _Printer(LoopPrinter):
    """Writes the function for one lowered program."""

    def __init__(self, lowered: Lowered) -> None:
        self.lowered = lowered
        self.undecided = lowered.pool.or_(answer.undecided for answer in lowered.answers)
        roots = [self.undecided, *(root for answer in lowered.answers for root in _roots(answer))]
        super().__init__(lowered.pool, Names(_RESERVED), roots)
        self.constants: dict[str, Any] = {}
        self._tables: dict[Relation, str] = {}  # the dictionary of rows by key
        self._blanks: dict[Relation, str] = {}

    def module(self) -> str:
        """Return the text of the function."""
        self._facts()
        self.sweep()
        if self.undecided is not self.pool.false:
            with self.block(f"if {self.text(self.undecided, CHOICE)}:"):
                self.write("raise Undecided('an arithmetic error on the way')")
        self.share(self.roots[1:])
        results = [self._answer(answer) for answer in self.lowered.answers]
        self.write(f"return ({', '.join(results)}{',' if len(results) == 1 else ''})")
        return "\n".join(["def answer(facts):", *self.lines, ""])

    # ---------------------------------------------------------------- facts

    def _facts(self) -> None:
        columns = self.columns()
        for relation in self.lowered.schema.relations.values():
            if relation in columns:
                self._relation(relation, columns[relation])

    def _relation(self, relation: Relation, used: list[int]) -> None:
        constant = self.names.new(relation.name).upper()
        self.constants[constant] = relation
        rows = self.names.new(f"{relation.name}_rows")
        self.write(f"{rows} = checked_rows(facts, {constant}, {tuple(used)})")
        self.known[self.pool.make("facts", "rows", (), relation)] = rows
        if self.pool.make("row", "index", (), relation) in self.reached:
            row = self.pool.make("row", "index", (), relation)
            self.known[row] = self.names.new(relation.first or relation.name)
            self.write(f"{self.known[row]} = {rows}[0]")
            self.unpack(row)
        if self.pool.make("others", "rows", (), relation) in self.reached:
            others = self.pool.make("others", "rows", (), relation)
            self.known[others] = self.names.new(f"other_{relation.name}_rows")
            self.write(f"{self.known[others]} = {rows}[1:]")
        if any(is_lookup(node) and relation_of(node.args[0]) is relation for node in self.reached):
            table = self._tables[relation] = self.names.new(f"{relation.name}_by_key")
            self.write(f"{table} = {{row[{relation.key}]: row for row in {rows}}}")

    # ---------------------------------------------------------------- rows

    def head(self, rows: Node, row: str) -> Sequence[str]:
        return (f"for {row} in {self.known[rows]}:",)

    def unpack(self, index: Node) -> None:
        relation = relation_of(index)
        targets = []
        for column in range(relation.arity):
            node = self.pool.make("col", relation.columns[column], (index,), (relation, column))
            if node in self.reached and not node.is_const:
                self.known[node] = self.column_name(node)
                targets.append(self.known[node])
            else:
                targets.append("_")
        if any(target != "_" for target in targets):
            self.write(f"{', '.join(targets)}{',' if len(targets) == 1 else ''} = {self.known[index]}")

    def choose_rows(self, name: str, node: Node) -> Callable[[str], None]:
        self.write(f"{name} = []")
        return lambda row: self.write(f"{name}.append({row})")

    def no_row(self, relation: Relation) -> str:
        if relation not in self._blanks:
            self._blanks[relation] = self.names.new(f"no_{relation.name}").upper()
            self.constants[self._blanks[relation]] = blank_row(relation)
        return self._blanks[relation]

    def is_none(self, name: str, relation: Relation) -> str:
        return f"{name} is {self.no_row(relation)}"

    # ---------------------------------------------------------------- values

    def atom(self, name: str) -> str:
        return repr(name)

    def column(self, index: str, relation: Relation, column: int) -> str:
        return f"{index}[{column}]"

    def lookup(self, node: Node) -> tuple[str, int]:
        relation = relation_of(node.args[0])
        table, key = self._tables[relation], self.text(lookup_value(node), COMPARISON + 1)
        if node.op == "any":
            return f"{key} in {table}", COMPARISON
        return f"{table}.get({key}, {self.no_row(relation)})", ATOMIC

    # ---------------------------------------------------------------- answers

    def _answer(self, answer: Answer) -> str:
        if answer.query.mode == "holds":
            return self.text(answer.found, OR)
        if answer.query.mode == "first" and answer.terms is not None:
            value = self._terms(answer.terms)
            return (
                value
                if answer.found is self.pool.true
                else f"{value} if {self.text(answer.found, OR)} else None"
            )
        if answer.query.mode == "set" and answer.choices is not None and answer.in_order:
            return self._chosen(answer)
        name = self._solutions(answer.tree, answer.query.name)
        if answer.query.mode == "set":
            return f"[item for n, item in enumerate({name}) if item not in {name}[:n]]"
        return name if answer.query.mode == "all" else f"{name}[0] if {name} else None"

    def _chosen(self, answer: Answer) -> str:
        """Return the list of the values that are solutions."""
        name = self.names.new(answer.query.name)
        sure = [value for value, cond in answer.choices or () if cond is self.pool.true]
        assert answer.choices is not None
        start = sure[:1] if answer.choices[:1] == tuple((value, self.pool.true) for value in sure[:1]) else []
        self.write(f"{name} = [{', '.join(map(self._term, start))}]")
        for value, cond in answer.choices[len(start) :]:
            if cond is self.pool.true:
                self.write(f"{name}.append({self._term(value)})")
                continue
            with self.block(f"if {self.text(cond, CHOICE)}:"):
                self.write(f"{name}.append({self._term(value)})")
        return name

    def _solutions(self, tree: Tree, hint: str) -> str:
        """Return the list of all solutions of a tree."""
        name = self.names.new(hint)
        self.write(f"{name} = []")
        self._collect(tree, name)
        return name

    def _collect(self, tree: Tree, name: str) -> None:
        if isinstance(tree, Emit):
            self.write(f"{name}.append({self._terms(tree.terms)})")
        elif isinstance(tree, Guard):
            self.nested_quantifiers(tree.cond)
            with self.block(f"if {self.text(tree.cond, CHOICE)}:"):
                self._collect(tree.body, name)
        elif isinstance(tree, Branch):
            self.nested_quantifiers(tree.cond)
            with self.block(f"if {self.text(tree.cond, CHOICE)}:"):
                self._collect(tree.then, name)
            with self.block("else:"):
                self._collect(tree.els, name)
        elif isinstance(tree, Each):
            row = self.names.new(relation_of(tree.loop).name)
            with self.each(tree.loop, row):
                self._collect(tree.body, name)
        else:
            for child in children(tree):
                self._collect(child, name)
            if not children(tree):
                self.write("pass")

    def _terms(self, terms: Sequence[Sym]) -> str:
        """Return the arguments of a solution."""
        if len(terms) == 1:
            return self._term(terms[0])
        return f"({', '.join(map(self._term, terms))})"

    def _term(self, term: Sym) -> str:
        """Return a term in the form of the engine's solutions."""
        term = resolve(term)
        if isinstance(term, Node):
            self.nested_quantifiers(term)
            return self.text(term, OR)
        if isinstance(term, Bag):
            return self._solutions(term.tree, "items")
        if isinstance(term, Atom):
            return "[]" if term is NIL else repr(term.name)
        if isinstance(term, str):
            return f"String({term!r})"
        if isinstance(term, Struct):
            return self._compound(term)
        return repr(term)

    def _compound(self, term: Struct) -> str:
        items: list[Sym] = []
        rest: Sym = term
        while isinstance(rest, Struct) and rest.name == "." and len(rest.args) == 2:
            items.append(rest.args[0])
            rest = resolve(rest.args[1])
        if rest is NIL:
            return f"[{', '.join(map(self._term, items))}]"
        args = "".join(f"{self._term(arg)}, " for arg in term.args)
        return f"Compound({term.name!r}, ({args}))"


def _roots(answer: Answer) -> list[Node]:
    """Return the nodes of an answer."""
    if answer.query.mode == "holds":
        return [answer.found]
    if answer.query.mode == "first" and answer.terms is not None:
        return [answer.found, *(node for term in answer.terms for node in _nodes(term))]
    if answer.query.mode == "set" and answer.choices is not None and answer.in_order:
        return [cond for _, cond in answer.choices]
    return list(_tree_nodes(answer.tree))


def _nodes(term: Sym) -> Iterator[Node]:
    term = resolve(term)
    if isinstance(term, Node):
        yield term
    elif isinstance(term, Struct):
        for arg in term.args:
            yield from _nodes(arg)
    elif isinstance(term, Bag):
        yield from _tree_nodes(term.tree)


def _tree_nodes(tree: Tree) -> Iterator[Node]:
    if isinstance(tree, Guard | Branch):
        yield tree.cond
    if isinstance(tree, Each):
        yield tree.loop
    if isinstance(tree, Emit):
        for term in tree.terms:
            yield from _nodes(term)
    for child in children(tree):
        yield from _tree_nodes(child)
