"""Expressions and statements in Python's words."""

from __future__ import annotations

from drlsl.logic.core import NODES, Operation
from drlsl.lowering.backends.expressions import (
    AND,
    ATOMIC,
    CHOICE,
    COMPARISON,
    NOT,
    OR,
    ExpressionText,
    is_defined,
)
from drlsl.lowering.backends.loops import LoopPrinter
from drlsl.lowering.ir import Node


class PythonText(ExpressionText):
    """Writes expressions in Python."""

    true, false, infinity = "True", "False", "inf"
    equal, unequal = "==", "!="
    connectives = {"and": (" and ", AND, AND + 1), "or": (" or ", OR, OR + 1)}  # noqa: RUF012  (never changed)
    negation = ("not ", NOT)

    def number(self, value: float) -> str:
        return repr(value)

    def conditional(self, cond: str, then: str, els: str) -> str:
        return f"{then} if {cond} else {els}"

    def within(self, node: Node) -> tuple[str, int]:
        return f"{-node.data!r} <= {self.text(node.args[0], COMPARISON + 1)} <= {node.data!r}", COMPARISON

    def repeats(self, node: Node) -> bool:
        row = NODES.get(node.op)
        return row is not None and bool(row.guard or row.text.count("{0}") > 1)

    def operation(self, row: Operation, node: Node) -> tuple[str, int]:
        args = [self.text(arg, COMPARISON + 1) for arg in node.args]
        if row.infix:
            text, own = self.infix(row, node)
        elif row.text:
            text, own = row.text.format(*args), ATOMIC if row.guard else CHOICE
        else:
            return self.call(row, node)
        if row.guard and not is_defined(row, node):
            otherwise = "nan" if node.kind == "float" else "0"
            return f"{text} if {row.guard.format(*args)} else {otherwise}", CHOICE
        return text, own

    def call(self, row: Operation, node: Node) -> tuple[str, int]:
        return f"{row.compute.__name__}({', '.join(self.text(arg, CHOICE) for arg in node.args)})", ATOMIC


class PythonLoops(PythonText, LoopPrinter):
    """Writes loops in Python."""

    def block_head(self, head: str) -> str:
        return f"{head}:"

    def block_end(self) -> None:
        """Do nothing: the indentation says it."""

    def test(self, cond: str, *, instead: bool = False) -> str:
        return f"{'elif' if instead else 'if'} {cond}"

    def declare(self, name: str, text: str, kind: str) -> None:
        self.put(name, text)

    def put(self, name: str, text: str) -> None:
        self.write(f"{name} = {text}")

    def end_loop(self) -> None:
        self.write("break")
