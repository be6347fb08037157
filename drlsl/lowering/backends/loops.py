"""The common part of back ends that write loops over rows, with each value computed once.

Quantifiers over the same rows that do not depend on each other share one loop; within it their conditions
share their tests. All values are total (see `numbers.py`), so a value used in several places may be computed
before any of them.
"""

from __future__ import annotations

from abc import abstractmethod
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Final

from drlsl.lowering.backends.expressions import CHOICE, SUM, ExpressionText, is_lookup, is_loop
from drlsl.lowering.backends.needs import Needs
from drlsl.lowering.frontend import Lowered
from drlsl.lowering.ir import QUANTIFIERS, Names, Node, Relation, conjuncts, reach, relation_of

_TRIVIAL: Final = frozenset({"const", "col", "loop", "row", "facts", "others", "where"})


@dataclass(slots=True)
class _Loop:
    """The nodes that one loop over `rows` computes."""

    rows: Node
    members: list[Node] = field(default_factory=list)


@dataclass(slots=True)
class Item:
    """The action of a loop on a row that meets conditions, tested in order.

    It computes `node`; `best` is the variable of the least or greatest value so far.
    """

    node: Node
    conds: tuple[Node, ...]
    values: tuple[Node, ...]
    act: Callable[[], None]
    best: str = ""

    def without(self, conds: Sequence[Node]) -> Item:
        """Return the same item, given that these conditions hold."""
        return replace(self, conds=tuple(cond for cond in self.conds if cond not in conds))


class LoopPrinter(ExpressionText):
    """Writes a function that computes some nodes, row by row.

    Subclasses define how rows are stored, and the words of the language.
    """

    def __init__(self, lowered: Lowered, names: Names, results: Iterable[tuple[Node, Node]]) -> None:
        """Take over the values of the answers, each with the condition under which it is used."""
        super().__init__(names)
        results = list(results)
        self.lowered = lowered
        self.pool = lowered.pool
        self.undecided = self.pool.or_(answer.undecided for answer in lowered.answers)
        self.roots = [node for node, _ in results]
        self._results = [(self.undecided, self.pool.true), *results]
        self.lines: list[str] = []
        self.depth = 1
        self.reached = reach(node for node, _ in self._results)
        self.stages: dict[Node, int] = {}

    @abstractmethod
    def block_head(self, head: str) -> str:
        """Return the line that begins an indented block."""

    @abstractmethod
    def block_end(self) -> None:
        """Write what ends a block."""

    @abstractmethod
    def test(self, cond: str, *, instead: bool = False) -> str:
        """Return the head of a block for which a condition holds; `instead`: and those above it do not."""

    @abstractmethod
    def declare(self, name: str, text: str, kind: str) -> None:
        """Write the first value of a variable."""

    @abstractmethod
    def put(self, name: str, text: str) -> None:
        """Write another value of a variable."""

    @abstractmethod
    def end_loop(self) -> None:
        """Write what ends the innermost loop."""

    @abstractmethod
    def head(self, rows: Node, row: str) -> Sequence[str]:
        """Return the first lines of a loop in which `row` is each of the rows in turn."""

    @abstractmethod
    def unpack(self, index: Node) -> None:
        """Name the columns of a row that are used."""

    @abstractmethod
    def choose_rows(self, name: str, node: Node) -> Callable[[str], None]:
        """Begin a selection of rows; return the function that adds a row to it."""

    @abstractmethod
    def is_none(self, name: str, relation: Relation) -> str:
        """Return the test whether a variable stands for no row."""

    def is_expensive(self, node: Node) -> bool:
        """Return whether a value gets a variable even if it is used once."""
        return False

    def leaves(self, loop: Node) -> bool:
        """Return whether a loop that searches one row ends there."""
        return True

    def no_value(self, value: Node, *, greatest: bool) -> str:
        """Return a number that is beyond every value."""
        return self.infinity if greatest else f"-{self.infinity}"

    def column_name(self, node: Node) -> str:
        """Return a variable for a column of a row."""
        relation, column = node.data
        name = (
            relation.fields[column] if relation.fields else self.pool.names.get(node, f"column_{column + 1}")
        )
        return self.names.new(f"{relation.first or ''}_{name}" if node.args[0].op == "row" else name)

    def write(self, text: str) -> None:
        self.lines.append("    " * self.depth + text)

    @contextmanager
    def block(self, head: str) -> Iterator[None]:
        """Write an indented block; values named inside are forgotten after it."""
        self.write(self.block_head(head))
        outer = dict(self.known)
        self.depth += 1
        yield
        self.depth -= 1
        self.block_end()
        self.known = outer

    @contextmanager
    def each(self, bound: Node, row: str) -> Iterator[None]:
        """Write the block of a loop over rows."""
        head, *first = self.head(bound.args[0], row)
        with self.block(head):
            for line in first:
                self.write(line)
            self.known[bound] = row
            self.unpack(bound)
            yield

    def columns(self) -> dict[Relation, list[int]]:
        """Return the columns of each relation that are read."""
        found: dict[Relation, set[int]] = {}
        for node in self.reached:
            if node.op == "col":
                found.setdefault(node.data[0], set()).add(node.data[1])
            elif node.op in ("facts", "others", "row"):
                found.setdefault(node.data, set())
        return {relation: sorted(used) for relation, used in found.items()}

    def sweep(self) -> None:
        """Write every loop over rows, each where its values count."""
        for loop, when in self._guarded(self._loops()):
            self._sweep(loop, when)

    def _guarded(self, loops: Sequence[_Loop]) -> list[tuple[_Loop, Node]]:
        """Return loops with the conditions under which their values count.

        A loop comes after those that tell whether it need run at all.
        """
        needs = Needs(self.pool, self._results, self.reached)
        order: list[tuple[_Loop, Node]] = []
        before = set(_members(loops))
        for loop in reversed(loops):
            before.difference_update(loop.members)
            last = next(
                (place for place, (other, when) in enumerate(order) if _reads(other, when, loop)),
                len(order),
            )
            known = before.union(_members(other for other, _ in order[:last]))
            when = needs.of(loop.members, known)
            guarded = when is not self.pool.true and not relation_of(loop.rows).single
            order.insert(last if guarded else 0, (loop, when if guarded else self.pool.true))
        return order

    def _stage(self, node: Node) -> int:
        """Return the number of successive loops that a value depends on."""
        known = self.stages.get(node)
        if known is None:
            known = max((self._stage(arg) for arg in node.args), default=0)
            if not node.free and is_loop(node):
                known += 1
            self.stages[node] = known
        return known

    def _loops(self) -> list[_Loop]:
        """Return the loops over rows, as few as possible, in an order of their dependencies."""
        waiting: dict[Node, list[Node]] = {}  # by the rows that they loop over
        latest: dict[Node, int] = {}
        for node in self.reached:
            if is_loop(node):
                if node.free:
                    continue
                waiting.setdefault(node.args[0] if node.op == "where" else node.args[0].args[0], []).append(
                    node
                )
                for part in reach(node.args):
                    latest[part] = min(latest.get(part, self._stage(node)), self._stage(node) - 1)
        loops: dict[tuple[int, Node], _Loop] = {}
        for rows, members in waiting.items():
            last = max(map(self._stage, members))
            stage = -1
            for node in sorted(members, key=lambda node: latest.get(node, last)):
                if self._stage(node) > stage:
                    stage = latest.get(node, last)
                loops.setdefault((stage, rows), _Loop(rows)).members.append(node)
        for loop in loops.values():
            loop.members.sort(key=lambda node: node.order)
        return [loops[key] for key in sorted(loops, key=lambda key: (key[0], key[1].order))]

    def _sweep(self, loop: _Loop, when: Node) -> None:
        """Write one loop for all its members, run where a condition holds."""
        bound = self.pool.make("loop", "index", (loop.rows,), 0)
        if when is self.pool.true:
            self._name_outside(loop.members)
            self._loop(bound, self._items(loop))
            return
        if when not in self.known:
            self.share([when])
            self.assign(when)
        items = self._items(loop)
        with self.block(self.test(self.known[when])):
            self._name_outside(loop.members)
            self._loop(bound, items)

    def _items(self, loop: _Loop) -> list[Item]:
        return [self._item(member, alone=len(loop.members) == 1) for member in loop.members]

    def _loop(self, bound: Node, items: list[Item]) -> None:
        row = self.names.new(relation_of(bound).name)
        with self.each(bound, row):
            self.visit(items)

    def _name_outside(self, members: Sequence[Node]) -> None:
        """Compute values that the loop uses but does not change, before it."""
        fixed = [
            node
            for member in members
            for part in member.args
            if part is not member.loop
            for node in _fixed_parts(part)
            if node.op not in _TRIVIAL
        ]
        self.share(fixed)
        for node in fixed:
            if node not in self.known:
                self.assign(node)

    def _item(self, node: Node, *, alone: bool) -> Item:
        """Return the item that computes a quantifier or a selection of rows, row by row.

        One that is `alone` in its loop may end it.
        """
        name = self.known[node] = self.names.new(self.pool.names.get(node, _HINTS.get(node.op, node.op)))
        parts = conjuncts(node.args[-1] if node.op == "where" else node.args[1])
        conds = tuple(sorted((part for part in parts if not part.is_const), key=is_costly))
        loop = node.loop

        def row() -> str:
            return self.known[loop]

        if node.op == "where":
            add = self.choose_rows(name, node)
            return Item(node, conds, (), lambda: add(row()))
        if node.op in ("any", "first"):
            return self._found_item(node, name, conds, leave=alone and self.leaves(loop))
        if node.op == "count":
            self.declare(name, "0", "int")
            return Item(node, conds, (), lambda: self.put(name, f"{name} + 1"))
        value = node.args[2]
        if node.op == "sum":
            self.declare(name, self.text(node.args[3], CHOICE), node.kind)
            return Item(node, conds, (value,), lambda: self.put(name, self.added(name, node)))
        return self._extreme_item(node, name, conds, value)

    def added(self, name: str, node: Node) -> str:
        """Return the text of a sum so far, `name`, and the next value."""
        return f"{name} + {self.text(node.args[2], SUM + 1)}"

    def _found_item(self, node: Node, name: str, conds: tuple[Node, ...], *, leave: bool) -> Item:
        relation = relation_of(node)
        self.declare(name, self.false if node.op == "any" else self.no_row(relation), node.kind)

        def act() -> None:
            if node.op == "any":
                self.put(name, self.true)
            elif leave:
                self.put(name, self.known[node.loop])
            else:
                none = self.is_none(name, relation)
                self.put(name, self.conditional(none, self.known[node.loop], name))
            if leave:
                self.end_loop()

        return Item(node, conds, (), act)

    def _extreme_item(self, node: Node, name: str, conds: tuple[Node, ...], value: Node) -> Item:
        least = node.op in ("min_of", "argmin")
        best = name
        if node.op in ("argmin", "argmax"):
            best = self.names.new("least" if least else "greatest")
            self.declare(name, self.no_row(relation_of(node)), "index")
        self.declare(best, self.no_value(value, greatest=least), value.kind)

        def act() -> None:
            text = self.known.get(value) or self.assign(value)
            with self.block(self.test(f"{text} {'<' if least else '>'} {best}")):
                self.put(best, text)
                if best is not name:
                    self.put(name, self.known[node.loop])

        return Item(node, conds, (value,), act, best)

    def visit(self, items: Sequence[Item]) -> None:
        """Write the items, testing a common first condition only once."""
        groups: dict[Node, list[Item]] = {}
        for item in items:
            if item.conds:
                groups.setdefault(item.conds[0], []).append(item)
        ready = [item for item in items if not item.conds]
        self.share([*groups, *(value for item in ready for value in item.values)], items)
        for item in ready:
            item.act()
        chain: list[Node] = []  # the conditions of the ifs that this one may be an elif of
        tests: list[Node] = []
        for cond, members in groups.items():
            test = cond
            rest = [item.without(item.conds[:1]) for item in members]
            while (
                len({item.conds[:1] for item in rest}) == 1
                and rest[0].conds
                and not is_costly(rest[0].conds[0])
            ):
                test = self.pool.and_([test, rest[0].conds[0]])
                rest = [item.without(item.conds[:1]) for item in rest]
            self.nested_quantifiers(cond)
            exclusive = all(self.pool.and_([before, cond]) is self.pool.false for before in chain)
            if not exclusive:
                chain, tests = [], []
            if tests == [self.pool.not_(cond)] and test is cond:
                head = "else"
                chain, tests = [], []
            else:
                head = self.test(self.text(test, CHOICE), instead=bool(chain))
                chain, tests = [*chain, cond], [*tests, test]
            with self.block(head):
                self.visit(rest)

    def share(self, now: Iterable[Node], items: Sequence[Item] = ()) -> None:
        """Name the values that are needed now and used more than once from here on."""
        now = list(now)
        later = list(dict.fromkeys(node for item in items for node in (*item.conds, *item.values))) or now
        uses = Counter(later)
        for node in reach(later, self.known):
            for arg in node.args:
                uses[arg] += 2 if self.repeats(node) and not arg.is_const else 1
        for node in reach(now, self.known):
            if node in self.known or node.op in _TRIVIAL or not self._in_scope(node):
                continue
            if node.op in QUANTIFIERS and not is_lookup(node):
                self._nested(node)
            elif uses[node] > 1 or self.is_expensive(node):
                self.assign(node)

    def _in_scope(self, node: Node) -> bool:
        return all(loop in self.known for loop in node.free)

    def nested_quantifiers(self, node: Node) -> None:
        for part in reach([node], self.known):
            if part.op in QUANTIFIERS and not is_lookup(part) and self._in_scope(part):
                self._nested(part)

    def _nested(self, node: Node) -> None:
        """Write a loop inside a loop."""
        self._loop(node.args[0], [self._item(node, alone=True)])

    def assign(self, node: Node) -> str:
        """Assign a value to a variable; return its name."""
        self.nested_quantifiers(node)
        text = self.text(node, CHOICE)
        name = self.known[node] = self.names.new(self.pool.names.get(node, _HINTS.get(node.op, "value")))
        self.declare(name, text, node.kind)
        return name


_HINTS: Final = {
    "any": "found",
    "first": "chosen",
    "where": "chosen_rows",
    "min_of": "least",
    "max_of": "greatest",
}


def _members(loops: Iterable[_Loop]) -> list[Node]:
    return [member for loop in loops for member in loop.members]


def _reads(loop: _Loop, when: Node, other: _Loop) -> bool:
    """Return whether a loop, or the condition for it, depends on another loop."""
    parts = reach([when, *(arg for member in loop.members for arg in member.args)])
    return any(member in parts for member in other.members)


def _fixed_parts(node: Node) -> Iterator[Node]:
    """Yield the largest parts that depend on no loop."""
    if not node.free:
        yield node
    else:
        for arg in node.args:
            yield from _fixed_parts(arg)


def is_costly(node: Node) -> bool:
    """Return whether a condition needs a loop of its own."""
    return any(part.op in QUANTIFIERS and not is_lookup(part) for part in reach([node]))
