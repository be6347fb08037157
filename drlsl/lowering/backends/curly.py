"""Loops in the words that C and JavaScript share.

Every number is a double, for JavaScript has no other; integers are less than 2^53, where doubles hold
each. An integer that is not becomes NaN, which no test of a bound lets pass. A row is its place in an
array of rows; one past the last is a blank row, which stands for none.
"""

from __future__ import annotations

import math
import re
from abc import abstractmethod
from collections.abc import Callable, Iterable, Sequence
from importlib.resources import files
from typing import Final

from drlsl.logic.core import Operation
from drlsl.lowering.backends.answer_lists import SolutionLoops
from drlsl.lowering.backends.expressions import (
    AND,
    ATOMIC,
    CHOICE,
    COMPARISON,
    NOT,
    OR,
    SUM,
    UNARY,
    is_defined,
)
from drlsl.lowering.backends.place_loops import PlaceLoops
from drlsl.lowering.frontend import Lowered
from drlsl.lowering.ir import INT_BOUND, Names, Node, NotLowerable, Relation, relation_of

MOST: Final = INT_BOUND - 1
"""The largest integer."""

_WORDS: Final = """
    abstract arguments auto await bool boolean break byte case catch char class complex const
    continue debugger default delete do double else enum eval export extends false final finally
    float for function goto if implements import in inline instanceof int interface let linux long
    native new null package private protected public register restrict return short signed sizeof
    static struct super switch synchronized this throw throws transient true try typedef typeof
    undefined union unix unsigned var void volatile while with yield answer facts find op
"""
"""Names that C or JavaScript have a use for."""
_CALLED: Final = re.compile(r"\bop_(\w+)\(")


class CurlyLoops(PlaceLoops, SolutionLoops):
    """Writes loops in C or JavaScript."""

    true, false = "true", "false"
    connectives = {"and": (" && ", AND, NOT), "or": (" || ", OR, NOT)}  # noqa: RUF012  (never changed)
    negation = ("!", UNARY)
    counter: str
    """The word that declares the variable of a loop."""
    fixed: str
    """The words that declare a place that stays."""

    def __init__(self, lowered: Lowered, results: Iterable[tuple[Node, Node]]) -> None:
        super().__init__(lowered, Names(_WORDS.split(), ascii_only=True), results)
        # the arrays of rows; with _count, the numbers of rows
        self.rows = {relation: self.names.new(relation.name) for relation in self.columns()}

    @abstractmethod
    def declare_places(self, name: str, relation: Relation) -> None:
        """Write the variable for places of rows."""

    def block_head(self, head: str) -> str:
        return f"{head} {{"

    def block_end(self) -> None:
        self.write("}")

    def test(self, cond: str, *, instead: bool = False) -> str:
        return f"{'else ' if instead else ''}if ({cond})"

    def put(self, name: str, text: str) -> None:
        self.write(f"{name} = {text};")

    def end_loop(self) -> None:
        self.write("break;")

    def nothing(self) -> None:
        """Do nothing: a block may be empty."""

    def head(self, rows: Node, row: str) -> Sequence[str]:
        if rows.op == "where":
            place, chosen = self.names.new("place"), self.known[rows]
            return (
                f"for ({self.counter} {place} = 0; {place} < {chosen}_count; {place} += 1)",
                f"{self.fixed} {row} = {chosen}[{place}];",
            )
        count = f"{self.rows[relation_of(rows)]}_count"
        start = 1 if rows.op == "others" else 0
        return (f"for ({self.counter} {row} = {start}; {row} < {count}; {row} += 1)",)

    def unpack(self, index: Node) -> None:
        """Do nothing: columns are read where they are needed."""

    def choose_rows(self, name: str, node: Node) -> Callable[[str], None]:
        self.declare_places(name, relation_of(node))
        self.declare(f"{name}_count", "0", "index")

        def add(row: str) -> None:
            self.put(f"{name}[{name}_count]", row)
            self.put(f"{name}_count", f"{name}_count + 1")

        return add

    def no_row(self, relation: Relation) -> str:
        return f"{self.rows[relation]}_count"

    def is_none(self, name: str, relation: Relation) -> str:
        return f"{name} {self.equal} {self.no_row(relation)}"

    def is_some(self, place: str, relation: Relation) -> str:
        return f"{place} < {self.no_row(relation)}"

    def number(self, value: float) -> str:
        if isinstance(value, bool):
            return self.true if value else self.false
        if isinstance(value, int) and abs(value) > MOST:
            raise NotLowerable(
                "the program", None, f"{value} has more than the 53 bits of integers in doubles"
            )
        return self.double(float(value))

    @abstractmethod
    def double(self, value: float) -> str:
        """Return a double as a constant."""

    def column(self, index: str, relation: Relation, column: int) -> str:
        return f"{self.rows[relation]}[{index}].{field_name(relation, column)}"

    def conditional(self, cond: str, then: str, els: str) -> str:
        return f"{cond} ? {then} : {els}"

    def within(self, node: Node) -> tuple[str, int]:
        value = self.text(node.args[0], CHOICE)
        # an integer that was rounded to 2^53 may be a larger one
        strict = node.args[0].kind == "int" and node.data >= INT_BOUND
        return f"op_abs({value}) {'<' if strict else '<='} {self.double(float(node.data))}", COMPARISON

    def repeats(self, node: Node) -> bool:
        return False

    def operation(self, row: Operation, node: Node) -> tuple[str, int]:
        if row.node == "tofloat":
            return self.text(node.args[0], ATOMIC), ATOMIC
        if row.node == "neg":
            return f"-{self.text(node.args[0], UNARY + 1)}", UNARY
        if row.node in ("add", "sub", "mul"):
            text, own = self.infix(row, node)
            return self._whole(text, own, node)
        if row.node == "div" and is_defined(row, node):
            return self.infix(row, node)
        text, own = self.call(row, node)
        return self._whole(text, own, node) if row.kind == "whole" else (text, own)

    def call(self, row: Operation, node: Node) -> tuple[str, int]:
        return f"op_{row.node}({', '.join(self.text(arg, CHOICE) for arg in node.args)})", ATOMIC

    def added(self, name: str, node: Node) -> str:
        text, _ = self._whole(f"{name} + {self.text(node.args[2], SUM + 1)}", SUM, node)
        return text

    def _whole(self, text: str, own: int, node: Node) -> tuple[str, int]:
        """Return the text of an integer, checked if doubles might not hold it."""
        if node.kind != "int" or (node.low >= -MOST and node.high <= MOST and node.op != "mul"):
            return text, own
        return f"op_whole({text})", ATOMIC


def field_name(relation: Relation, column: int) -> str:
    """Return the name of a column in a row."""
    return relation.fields[column] if relation.fields else f"column_{column + 1}"


def support(language: str, texts: Iterable[str]) -> str:
    """Return the functions that some text calls, and those that these call: `language` is c or mjs."""
    known = _functions(language)
    needed: set[str] = set()
    waiting = {name for text in texts for name in _CALLED.findall(text)}
    while waiting:
        name = waiting.pop()
        if name not in known:
            raise NotLowerable("the program", None, f"{_LANGUAGES[language]} has no {name}")
        needed.add(name)
        waiting |= set(_CALLED.findall(known[name])) - needed
    return "\n".join(text for name, text in known.items() if name in needed)


def offered(language: str) -> frozenset[str]:
    """Return the names of the operations that a language has: `language` is c or mjs."""
    return frozenset(_functions(language))


_LANGUAGES: Final = {"c": "C", "mjs": "JavaScript"}


def _functions(language: str) -> dict[str, str]:
    text = (files(__package__) / f"operations.{language}").read_text(encoding="utf-8")
    _, *blocks = text.split("\n\n")
    found = {}
    for block in blocks:
        name = _CALLED.search(block)
        if name is not None:
            found[name[1]] = block.rstrip() + "\n"
    return found


def constant(value: float, nan: str, infinity: str) -> str:
    """Return a double as C and JavaScript write it."""
    if math.isfinite(value):
        return repr(value)
    return nan if math.isnan(value) else infinity if value > 0 else f"-{infinity}"
