"""The back end for one scene in JavaScript: one function without dependencies."""

from __future__ import annotations

import json
from collections.abc import Sequence
from importlib.resources import files

from drlsl.lowering.backends.answer_lists import AnswerLists, ListWords, results_of
from drlsl.lowering.backends.curly import CurlyLoops, constant, field_name, support
from drlsl.lowering.backends.expressions import CHOICE, lookup_value
from drlsl.lowering.frontend import Lowered
from drlsl.lowering.ir import FLOAT_BOUND, Node, Relation, relation_of


def js_source(lowered: Lowered, name: str = "answer") -> str:
    """Return the text of the function `name` that answers all queries for the facts of one scene.

    It takes the rows of each relation, arrays of values, by its name and arity, such as "vehicle/8"; atoms
    are strings. It returns an array with an answer for each query, or null in a scene that only the
    interpreter can answer. An answer is what `compile_scalar` gives: tuples are arrays, compound terms
    {name, args}, and None is null. The text needs `js_support`.

    Raises:
        NotLowerable: the program calls a function that JavaScript does not have.
    """
    return _Printer(lowered).module(name)


def js_support(texts: Sequence[str]) -> str:
    """Return the functions that the texts of functions need.

    Raises:
        NotLowerable: JavaScript has none.
    """
    rows = (files(__package__) / "rows.mjs").read_text(encoding="utf-8")
    return f"const MOST = {FLOAT_BOUND!r};\n\n{rows}\n{support('mjs', texts)}"


class _Printer(CurlyLoops, AnswerLists):
    """Writes the function for one lowered program."""

    infinity, equal, unequal, none = "Infinity", "===", "!==", "null"
    counter, fixed = "let", "const"
    lists = ListWords(
        start="const {name} = {items};",
        append="{name}.push({item});",
        distinct="distinct({name})",
        first="{name}.length > 0 ? {name}[0] : null",
    )

    def __init__(self, lowered: Lowered) -> None:
        super().__init__(lowered, results_of(lowered.pool, lowered.answers))

    def module(self, name: str) -> str:
        """Return the text of the function."""
        columns = self.columns()
        for relation, rows in self.rows.items():
            self._facts(relation, rows, columns[relation])
        self.sweep()
        if self.undecided is not self.pool.false:
            self.share([self.undecided])
            self.write(f"if ({self.text(self.undecided, CHOICE)}) return null;")
        self.share(self.roots)
        results = [self.answer(answer) for answer in self.lowered.answers]
        self.write(f"return [{', '.join(results)}];")
        return "\n".join([f"function {name}(facts) {{", *self.lines, "}", ""])

    def write(self, text: str) -> None:
        self.lines.append("  " * self.depth + text)

    def _facts(self, relation: Relation, rows: str, used: list[int]) -> None:
        about = {
            "fields": [field_name(relation, place) for place in range(relation.arity)],
            "kinds": relation.columns,
            "used": used,
            "single": relation.single,
            "key": relation.key,
            "first": relation.first,
        }
        key = json.dumps(f"{relation.name}/{relation.arity}")
        self.write(f"const {rows} = rows_of(facts[{key}] ?? [], {json.dumps(about)});")
        self.write(f"if ({rows} === null) return null;")
        self.write(f"const {rows}_count = {rows}.length - 1;")
        row = self.pool.make("row", "index", (), relation)
        self.known[row] = "0"

    def declare(self, name: str, text: str, kind: str) -> None:
        self.write(f"let {name} = {text};")

    def declare_places(self, name: str, relation: Relation) -> None:
        self.write(f"const {name} = [];")

    def search(self, node: Node) -> str:
        relation = relation_of(node.args[0])
        rows, key = self.rows[relation], json.dumps(field_name(relation, relation.key or 0))
        return f"find_row({rows}, {rows}_count, {key}, {self.text(lookup_value(node), CHOICE)})"

    def atom(self, name: str) -> str:
        return json.dumps(name)

    def double(self, value: float) -> str:
        return (
            str(int(value))
            if value == int(value) and 0 < abs(value) < 1e15
            else constant(value, "NaN", "Infinity")
        )

    def several(self, items: Sequence[str]) -> str:
        return self.sequence(items)

    def compound(self, name: str, args: Sequence[str]) -> str:
        return f"{{ name: {json.dumps(name)}, args: {self.sequence(args)} }}"

    def string(self, text: str) -> str:
        return json.dumps(text)
