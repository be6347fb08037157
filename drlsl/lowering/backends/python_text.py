"""Values as Python expressions."""

from __future__ import annotations

from abc import ABC, abstractmethod

from drlsl.logic.core import NODES, Operation
from drlsl.logic.terms import Atom
from drlsl.lowering.ir import Names, Node, Relation, relation_of

ATOMIC, UNARY, COMPARISON, NOT, AND, OR, CHOICE = 20, 13, 6, 5, 4, 3, 1


def is_lookup(node: Node) -> bool:
    """Return whether a quantifier searches the row with a given key."""
    if node.op not in ("any", "first") or node.args[1].op != "eq" or node.args[0].args[0].op != "facts":
        return False
    loop, relation = node.args[0], relation_of(node.args[0])
    return any(
        side.op == "col" and side.args[0] is loop and side.data[1] == relation.key and loop not in other.free
        for side, other in (node.args[1].args, node.args[1].args[::-1])
    )


def lookup_value(node: Node) -> Node:
    """Return the key of a lookup."""
    left, right = node.args[1].args
    return right if node.args[0] in left.free else left


def is_defined(row: Operation, node: Node) -> bool:
    """Return whether an operation is defined by the bounds of its arguments."""
    last = node.args[-1]
    return last.low > 0 or last.high < 0 if row.divides else last.low >= 0


class PythonText(ABC):
    """Writes expressions, given the variables that hold some values."""

    def __init__(self, names: Names) -> None:
        self.names = names
        self.known: dict[Node, str] = {}  # the variables of values, rows and indices in scope

    @abstractmethod
    def atom(self, name: str) -> str:
        """Return an atom."""

    @abstractmethod
    def column(self, index: str, relation: Relation, column: int) -> str:
        """Return the value in one column of a row."""

    @abstractmethod
    def lookup(self, node: Node) -> tuple[str, int]:
        """Return the text of the row with a given key, or of whether there is one; and its precedence."""

    @abstractmethod
    def no_row(self, relation: Relation) -> str:
        """Return the text that stands for no row."""

    def text(self, node: Node, strength: int) -> str:
        """Return an expression, in brackets if its context binds more strongly."""
        name = self.known.get(node)
        if name is not None:
            return name
        text, own = self._text(node)
        return text if own >= strength else f"({text})"

    def _text(self, node: Node) -> tuple[str, int]:
        args = node.args
        if node.op == "const":
            if isinstance(node.data, Atom):
                return self.atom(node.data.name), ATOMIC
            return repr(node.data), ATOMIC if node.data >= 0 else UNARY
        if node.op == "col":
            return self.column(self.text(args[0], ATOMIC), *node.data), ATOMIC
        if is_lookup(node):
            return self.lookup(node)
        if node.op in NODES:
            return self.operation(NODES[node.op], node)
        if node.kind == "bool":
            return self.truth(node)
        return self.choice(*args)

    def choice(self, cond: Node, then: Node, els: Node) -> tuple[str, int]:
        """Return a choice between two values, and its precedence."""
        return f"{self.text(then, OR)} if {self.text(cond, OR)} else {self.text(els, CHOICE)}", CHOICE

    def repeats(self, node: Node) -> bool:
        """Return whether the text of a node names an argument twice."""
        row = NODES.get(node.op)
        return row is not None and bool(row.guard or row.text.count("{0}") > 1)

    def operation(self, row: Operation, node: Node) -> tuple[str, int]:
        """Return an arithmetic operation, and its precedence."""
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

    def infix(self, row: Operation, node: Node) -> tuple[str, int]:
        """Return an operation written between its arguments, or before the only one, and its precedence."""
        assert row.infix is not None
        sign, own = row.infix
        if row.arity == 1:
            return f"{sign}{self.text(node.args[0], own)}", own
        left, right = node.args
        return f"{self.text(left, own)} {sign} {self.text(right, own + 1)}", own

    def call(self, row: Operation, node: Node) -> tuple[str, int]:
        """Return a call of the function that computes an operation, and its precedence."""
        return f"{row.compute.__name__}({', '.join(self.text(arg, CHOICE) for arg in node.args)})", ATOMIC

    def truth(self, node: Node) -> tuple[str, int]:
        """Return the text of a truth value, and its precedence."""
        args = node.args
        if node.op in ("and", "or"):
            own = AND if node.op == "and" else OR
            return f" {node.op} ".join(self.text(arg, own + 1) for arg in args), own
        if node.op == "within":
            return f"{-node.data!r} <= {self.text(args[0], COMPARISON + 1)} <= {node.data!r}", COMPARISON
        if node.op == "not" and args[0].op in ("lt", "eq") and args[0] not in self.known:
            left, right = (self.text(arg, COMPARISON + 1) for arg in args[0].args)
            return f"{left} {'>=' if args[0].op == 'lt' else '!='} {right}", COMPARISON
        if node.op == "not":
            return f"not {self.text(args[0], NOT)}", NOT
        left, right = (self.text(arg, COMPARISON + 1) for arg in args)
        return f"{left} {'<' if node.op == 'lt' else '=='} {right}", COMPARISON
