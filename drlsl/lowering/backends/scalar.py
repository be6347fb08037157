"""The back end for one scene: one Python function whose rows are tuples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final, TypeAlias

from drlsl.lowering.backends.answer_lists import AnswerLists, ListWords, results_of
from drlsl.lowering.backends.expressions import ATOMIC, CHOICE, COMPARISON, is_lookup, lookup_value
from drlsl.lowering.backends.python_text import PythonLoops
from drlsl.lowering.backends.scalar_support import SUPPORT, Facts, blank_row, row_reader
from drlsl.lowering.frontend import Lowered
from drlsl.lowering.ir import (
    Names,
    Node,
    Relation,
    relation_of,
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


class _Printer(PythonLoops, AnswerLists):
    """Writes the function for one lowered program."""

    none = "None"
    lists = ListWords(
        start="{name} = {items}",
        append="{name}.append({item})",
        distinct="[item for n, item in enumerate({name}) if item not in {name}[:n]]",
        first="{name}[0] if {name} else None",
    )

    def __init__(self, lowered: Lowered) -> None:
        super().__init__(lowered, Names(_RESERVED), results_of(lowered.pool, lowered.answers))
        self.constants: dict[str, Any] = {}
        self._tables: dict[Relation, str] = {}  # the dictionary of rows by key
        self._blanks: dict[Relation, str] = {}

    def module(self) -> str:
        """Return the text of the function."""
        self._facts()
        self.sweep()
        if self.undecided is not self.pool.false:
            with self.block(self.test(self.text(self.undecided, CHOICE))):
                self.write("raise Undecided('an arithmetic error on the way')")
        self.share(self.roots)
        results = [self.answer(answer) for answer in self.lowered.answers]
        self.write(f"return ({', '.join(results)}{',' if len(results) == 1 else ''})")
        return "\n".join(["def answer(facts):", *self.lines, ""])

    def _facts(self) -> None:
        columns = self.columns()
        for relation in self.lowered.schema.relations.values():
            if relation in columns:
                self._relation(relation, columns[relation])

    def _relation(self, relation: Relation, used: list[int]) -> None:
        read = self.names.new(f"read_{relation.name}")
        self.constants[read] = row_reader(relation, used)
        rows = self.names.new(f"{relation.name}_rows")
        self.write(f"{rows} = {read}(facts)")
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

    def head(self, rows: Node, row: str) -> Sequence[str]:
        return (f"for {row} in {self.known[rows]}",)

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

    def several(self, items: Sequence[str]) -> str:
        return f"({', '.join(items)})"

    def compound(self, name: str, args: Sequence[str]) -> str:
        return f"Compound({name!r}, ({''.join(f'{arg}, ' for arg in args)}))"

    def string(self, text: str) -> str:
        return f"String({text!r})"

    def nothing(self) -> None:
        self.write("pass")
