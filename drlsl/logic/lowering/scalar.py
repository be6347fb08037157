"""The back end for one scene: one Python function with loops over rows, its values computed once.

Quantifiers over the same rows that do not depend on each other share one loop; within it their conditions
share their tests. All values are total (see `numbers.py`), so a value that several places use may be computed
before any of them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Final, TypeAlias

from drlsl.logic.lowering.ir import QUANTIFIERS, Node, Pool, conjuncts, reach, relation_of
from drlsl.logic.lowering.lower import Answer, Lowered
from drlsl.logic.lowering.names import Names
from drlsl.logic.lowering.python_text import CHOICE, OR, PythonText, is_lookup
from drlsl.logic.lowering.schema import Relation
from drlsl.logic.lowering.support import SUPPORT, Facts
from drlsl.logic.lowering.trees import Bag, Branch, Each, Emit, Guard, Sym, Tree, children, resolve
from drlsl.logic.terms import NIL, Atom, Struct

Scalar: TypeAlias = Callable[[Facts], tuple[Any, ...]]

_RESERVED: Final = (*SUPPORT, "abs", "answer", "facts", "float", "max", "min")

_TWICE: Final = frozenset(
    {"min", "max", "div", "floordiv", "mod", "sqrt", "isign"}
)  # their text names an argument twice
_TRIVIAL: Final = frozenset({"const", "col", "loop", "row", "facts", "others", "where"})


def compile_scalar(lowered: Lowered) -> Scalar:
    """The function that answers all queries for the facts of one scene.

    It takes the rows of every relation by name and arity, as given to `Engine.replace_facts`, and returns one
    answer per query: for `holds` a bool; for `first` the argument, or a tuple of them, None without a
    solution; for `all` a list of such. It raises `Undecided` where the interpreter has to be asked.
    """
    printer = _Printer(lowered)
    namespace = {**SUPPORT, **printer.constants}
    exec(compile(printer.module(), "<lowered rules>", "exec"), namespace)  # noqa: S102  (the text is made here)
    namespace.update(printer.constants)
    function: Scalar = namespace["answer"]
    return function


def scalar_source(lowered: Lowered) -> str:
    """The text of that function."""
    return _Printer(lowered).module()


@dataclass(slots=True)
class _Loop:
    """What one loop over `rows` computes."""

    rows: Node
    members: list[Node] = field(default_factory=list)


@dataclass(slots=True)
class _Item:
    """What a loop does with a row that meets conditions, tested in order."""

    conds: tuple[Node, ...]
    values: tuple[Node, ...]
    act: Callable[[], None]


class _Printer(PythonText):
    """Writes the function for one lowered program."""

    def __init__(self, lowered: Lowered) -> None:
        super().__init__(Names(_RESERVED))
        self.lowered = lowered
        self.pool: Pool = lowered.pool
        self.lines: list[str] = []
        self.depth = 1
        self.undecided = self.pool.or_(answer.undecided for answer in lowered.answers)
        self.roots = [self.undecided, *(root for answer in lowered.answers for root in _roots(answer))]
        self.reached = reach(self.roots)
        self.stages: dict[Node, int] = {}

    # ---------------------------------------------------------------- writing

    def write(self, text: str) -> None:
        self.lines.append("    " * self.depth + text)

    @contextmanager
    def block(self, head: str) -> Iterator[None]:
        """An indented block; what it makes known is forgotten behind it."""
        self.write(head)
        outer = dict(self.known)
        self.depth += 1
        yield
        self.depth -= 1
        self.known = outer

    def module(self) -> str:
        """The text of the function."""
        self._facts()
        for loop in self._loops():
            self._sweep(loop)
        if self.undecided is not self.pool.false:
            with self.block(f"if {self.text(self.undecided, CHOICE)}:"):
                self.write("raise Undecided('an arithmetic error on the way')")
        self._share(self.roots[1:])
        results = [self._answer(answer) for answer in self.lowered.answers]
        self.write(f"return ({', '.join(results)}{',' if len(results) == 1 else ''})")
        return "\n".join(["def answer(facts):", *self.lines, ""])

    # ---------------------------------------------------------------- facts

    def _facts(self) -> None:
        columns: dict[Relation, set[int]] = {}
        for node in self.reached:
            if node.op == "col":
                columns.setdefault(node.data[0], set()).add(node.data[1])
            elif node.op in ("facts", "others", "row"):
                columns.setdefault(node.data, set())
        for relation in self.lowered.schema.relations.values():
            if relation in columns:
                self._relation(relation, sorted(columns[relation]))

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
            self._unpack(row)
        if self.pool.make("others", "rows", (), relation) in self.reached:
            others = self.pool.make("others", "rows", (), relation)
            self.known[others] = self.names.new(f"other_{relation.name}_rows")
            self.write(f"{self.known[others]} = {rows}[1:]")
        if any(is_lookup(node) and relation_of(node.args[0]) is relation for node in self.reached):
            table = self.tables[relation] = self.names.new(f"{relation.name}_by_key")
            self.write(f"{table} = {{row[{relation.key}]: row for row in {rows}}}")

    def _unpack(self, index: Node) -> None:
        """Give names to the columns of a row that are used."""
        relation = relation_of(index)
        targets = []
        for column in range(relation.arity):
            node = self.pool.make("col", relation.columns[column], (index,), (relation, column))
            if node in self.reached and not node.is_const:
                field = (
                    relation.fields[column]
                    if relation.fields
                    else self.pool.names.get(node, f"column_{column + 1}")
                )
                self.known[node] = self.names.new(
                    f"{relation.first or ''}_{field}" if index.op == "row" else field
                )
                targets.append(self.known[node])
            else:
                targets.append("_")
        if any(target != "_" for target in targets):
            self.write(f"{', '.join(targets)}{',' if len(targets) == 1 else ''} = {self.known[index]}")

    # ---------------------------------------------------------------- loops

    def _stage(self, node: Node) -> int:
        """How many loops, one after another, a value has to wait for."""
        known = self.stages.get(node)
        if known is None:
            known = max((self._stage(arg) for arg in node.args), default=0)
            if not node.free and (node.op == "where" or (node.op in QUANTIFIERS and not is_lookup(node))):
                known += 1
            self.stages[node] = known
        return known

    def _loops(self) -> list[_Loop]:
        """The loops over rows, in an order in which each finds what it needs."""
        loops: dict[tuple[int, Node], _Loop] = {}
        for node in self.reached:
            if node.free or is_lookup(node):
                continue
            if node.op == "where" or node.op in QUANTIFIERS:
                rows = node.args[0] if node.op == "where" else node.args[0].args[0]
                loops.setdefault((self._stage(node), rows), _Loop(rows)).members.append(node)
        return [loops[key] for key in sorted(loops, key=lambda key: (key[0], key[1].order))]

    def _sweep(self, loop: _Loop) -> None:
        """One loop for all its members."""
        self._name_outside(loop.members)
        bound = self.pool.make("loop", "index", (loop.rows,), 0)
        items = [self._item(member) for member in loop.members]
        self._loop(bound, items, leave=len(loop.members) == 1 and loop.members[0].op in ("any", "first"))

    def _loop(self, bound: Node, items: list[_Item], *, leave: bool) -> None:
        row = self.names.new(relation_of(bound).name)
        with self.block(f"for {row} in {self.known[bound.args[0]]}:"):
            self.known[bound] = row
            self._unpack(bound)
            self._items(items)
            if leave:
                # the last line is the action, at its own depth
                last = self.lines[-1]
                self.lines.append(last[: len(last) - len(last.lstrip())] + "break")

    def _name_outside(self, members: Sequence[Node]) -> None:
        """Compute what the loop uses but does not change, before it."""
        fixed = [
            node
            for member in members
            for part in member.args
            if part is not member.loop
            for node in _fixed_parts(part)
            if node.op not in _TRIVIAL
        ]
        self._share(fixed)
        for node in fixed:
            if node not in self.known:
                self.assign(node)

    def _item(self, node: Node) -> _Item:
        """What computes a quantifier or a selection of rows, row by row."""
        name = self.known[node] = self.names.new(self.pool.names.get(node, _HINTS.get(node.op, node.op)))
        parts = conjuncts(node.args[-1] if node.op == "where" else node.args[1])
        conds = tuple(sorted((part for part in parts if not part.is_const), key=_is_costly))
        loop = node.loop

        def row() -> str:
            return self.known[loop]

        if node.op == "where":
            self.write(f"{name} = []")
            return _Item(conds, (), lambda: self.write(f"{name}.append({row()})"))
        if node.op == "any":
            self.write(f"{name} = False")
            return _Item(conds, (), lambda: self.write(f"{name} = True"))
        if node.op == "count":
            self.write(f"{name} = 0")
            return _Item(conds, (), lambda: self.write(f"{name} += 1"))
        if node.op == "first":
            blank = self.blank(relation_of(node))
            self.write(f"{name} = {blank}")
            return _Item(conds, (), lambda: self.write(f"{name} = {row()} if {name} is {blank} else {name}"))
        value = node.args[2]
        if node.op == "sum":
            self.write(f"{name} = {self.text(node.args[3], CHOICE)}")
            return _Item(conds, (value,), lambda: self.write(f"{name} += {self.text(value, CHOICE)}"))
        return self._extreme_item(node, name, conds, value)

    def _extreme_item(self, node: Node, name: str, conds: tuple[Node, ...], value: Node) -> _Item:
        least = node.op in ("min_of", "argmin")
        best = name
        if node.op in ("argmin", "argmax"):
            best = self.names.new("least" if least else "greatest")
            self.write(f"{name} = {self.blank(relation_of(node))}")
        self.write(f"{best} = {'inf' if least else '-inf'}")

        def act() -> None:
            text = self.known.get(value) or self.assign(value)
            with self.block(f"if {text} {'<' if least else '>'} {best}:"):
                self.write(f"{best} = {text}")
                if best is not name:
                    self.write(f"{name} = {self.known[node.loop]}")

        return _Item(conds, (value,), act)

    def _items(self, items: Sequence[_Item]) -> None:
        """Do what the items say, testing a condition that several begin with only once."""
        groups: dict[Node, list[_Item]] = {}
        for item in items:
            if item.conds:
                groups.setdefault(item.conds[0], []).append(item)
        ready = [item for item in items if not item.conds]
        self._share([*groups, *(value for item in ready for value in item.values)], items)
        for item in ready:
            item.act()
        earlier: Node | None = None
        for cond, members in groups.items():
            test = cond
            rest = [_Item(item.conds[1:], item.values, item.act) for item in members]
            while (
                len({item.conds[:1] for item in rest}) == 1
                and rest[0].conds
                and not _is_costly(rest[0].conds[0])
            ):
                test = self.pool.and_([test, rest[0].conds[0]])
                rest = [_Item(item.conds[1:], item.values, item.act) for item in rest]
            self._nested_quantifiers(cond)
            exclusive = earlier is not None and self.pool.and_([earlier, cond]) is self.pool.false
            if exclusive and earlier is self.pool.not_(cond) and test is cond:
                head = "else:"
            else:
                head = f"{'elif' if exclusive else 'if'} {self.text(test, CHOICE)}:"
            with self.block(head):
                self._items(rest)
            earlier = cond

    # ---------------------------------------------------------------- sharing

    def _share(self, now: Iterable[Node], items: Sequence[_Item] = ()) -> None:
        """Name the values that are needed now and used more than once from here on."""
        now = list(now)
        later = list(dict.fromkeys(node for item in items for node in (*item.conds, *item.values))) or now
        uses = _count_uses(reach(later, self.known), later)
        for node in reach(now, self.known):
            if node in self.known or node.op in _TRIVIAL or not self._in_scope(node):
                continue
            if node.op in QUANTIFIERS and not is_lookup(node):
                self._nested(node)
            elif uses[node] > 1:
                self.assign(node)

    def _in_scope(self, node: Node) -> bool:
        return all(loop in self.known for loop in node.free)

    def _nested_quantifiers(self, node: Node) -> None:
        for part in reach([node], self.known):
            if part.op in QUANTIFIERS and not is_lookup(part) and self._in_scope(part):
                self._nested(part)

    def _nested(self, node: Node) -> None:
        """A loop inside a loop."""
        item = self._item(node)
        self._loop(node.args[0], [item], leave=node.op in ("any", "first"))

    def assign(self, node: Node) -> str:
        """Give a value a variable."""
        self._nested_quantifiers(node)
        text = self.text(node, CHOICE)
        name = self.known[node] = self.names.new(self.pool.names.get(node, _HINTS.get(node.op, "value")))
        self.write(f"{name} = {text}")
        return name

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
        """The list of the values that are solutions."""
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
        """The list of all solutions of a tree."""
        name = self.names.new(hint)
        self.write(f"{name} = []")
        self._collect(tree, name)
        return name

    def _collect(self, tree: Tree, name: str) -> None:
        if isinstance(tree, Emit):
            self.write(f"{name}.append({self._terms(tree.terms)})")
        elif isinstance(tree, Guard):
            self._nested_quantifiers(tree.cond)
            with self.block(f"if {self.text(tree.cond, CHOICE)}:"):
                self._collect(tree.body, name)
        elif isinstance(tree, Branch):
            self._nested_quantifiers(tree.cond)
            with self.block(f"if {self.text(tree.cond, CHOICE)}:"):
                self._collect(tree.then, name)
            with self.block("else:"):
                self._collect(tree.els, name)
        elif isinstance(tree, Each):
            row = self.names.new(relation_of(tree.loop).name)
            with self.block(f"for {row} in {self.known[tree.loop.args[0]]}:"):
                self.known[tree.loop] = row
                self._unpack(tree.loop)
                self._collect(tree.body, name)
        else:
            for child in children(tree):
                self._collect(child, name)
            if not children(tree):
                self.write("pass")

    def _terms(self, terms: Sequence[Sym]) -> str:
        """The arguments of a solution."""
        if len(terms) == 1:
            return self._term(terms[0])
        return f"({', '.join(map(self._term, terms))})"

    def _term(self, term: Sym) -> str:
        """A term as the engine would hand it out."""
        term = resolve(term)
        if isinstance(term, Node):
            self._nested_quantifiers(term)
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


_HINTS: Final = {
    "any": "found",
    "first": "chosen",
    "where": "chosen_rows",
    "min_of": "least",
    "max_of": "greatest",
}


def _roots(answer: Answer) -> list[Node]:
    """The nodes that an answer is made of."""
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


def _count_uses(nodes: Iterable[Node], roots: Iterable[Node]) -> Counter[Node]:
    uses: Counter[Node] = Counter(roots)
    for node in nodes:
        for arg in node.args:
            uses[arg] += 2 if node.op in _TWICE and not arg.is_const else 1
    return uses


def _fixed_parts(node: Node) -> Iterator[Node]:
    """The largest parts that depend on no loop."""
    if not node.free:
        yield node
    else:
        for arg in node.args:
            yield from _fixed_parts(arg)


def _is_costly(node: Node) -> bool:
    """Whether a condition needs a loop of its own."""
    return any(part.op in QUANTIFIERS and not is_lookup(part) for part in reach([node]))
