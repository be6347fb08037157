"""Values as expressions of a programming language, which a subclass names."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from drlsl.logic.core import NODES, Operation
from drlsl.logic.terms import Atom
from drlsl.lowering.ir import QUANTIFIERS, Names, Node, Relation, relation_of

ATOMIC, UNARY, SUM, COMPARISON, NOT, AND, OR, CHOICE = 20, 13, 11, 6, 5, 4, 3, 1
"""How strongly a language binds, from values and calls to a choice."""


def bracketed(text: str, own: int, strength: int) -> str:
    """Return an expression that binds as strongly as `own`, in brackets if its context binds stronger."""
    return text if own >= strength else f"({text})"


def is_lookup(node: Node) -> bool:
    """Return whether a quantifier searches the row with a given key."""
    if node.op not in ("any", "first") or node.args[1].op != "eq" or node.args[0].args[0].op != "facts":
        return False
    loop, relation = node.args[0], relation_of(node.args[0])
    return any(
        side.op == "col" and side.args[0] is loop and side.data[1] == relation.key and loop not in other.free
        for side, other in (node.args[1].args, node.args[1].args[::-1])
    )


def is_loop(node: Node) -> bool:
    """Return whether a value takes a loop over rows."""
    return node.op == "where" or (node.op in QUANTIFIERS and not is_lookup(node))


def lookup_value(node: Node) -> Node:
    """Return the key of a lookup."""
    left, right = node.args[1].args
    return right if node.args[0] in left.free else left


def is_defined(row: Operation, node: Node) -> bool:
    """Return whether an operation is defined by the bounds of its arguments."""
    last = node.args[-1]
    return last.low > 0 or last.high < 0 if row.divides else last.low >= 0


class ExpressionText(ABC):
    """Writes expressions, given the variables that hold some values."""

    true: ClassVar[str]
    false: ClassVar[str]
    infinity: ClassVar[str]
    equal: ClassVar[str]
    unequal: ClassVar[str]
    connectives: ClassVar[dict[str, tuple[str, int, int]]]
    """The words for `and` and `or`, how strongly they bind, and how strongly their parts must."""
    negation: ClassVar[tuple[str, int]]
    """The word for `not`, and how strongly it binds."""

    def __init__(self, names: Names) -> None:
        self.names = names
        self.known: dict[Node, str] = {}  # the variables of values, rows and indices in scope

    @abstractmethod
    def number(self, value: float) -> str:
        """Return a number or a truth value, as a constant."""

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

    @abstractmethod
    def conditional(self, cond: str, then: str, els: str) -> str:
        """Return a choice between two texts."""

    @abstractmethod
    def within(self, node: Node) -> tuple[str, int]:
        """Return the test whether a number is no larger than a bound, and its precedence."""

    @abstractmethod
    def operation(self, row: Operation, node: Node) -> tuple[str, int]:
        """Return an arithmetic operation, and its precedence."""

    @abstractmethod
    def call(self, row: Operation, node: Node) -> tuple[str, int]:
        """Return a call of the function that computes an operation, and its precedence."""

    @abstractmethod
    def repeats(self, node: Node) -> bool:
        """Return whether the text of a node names an argument twice."""

    def text(self, node: Node, strength: int) -> str:
        """Return an expression, in brackets if its context binds more strongly."""
        name = self.known.get(node)
        return bracketed(*self._text(node), strength) if name is None else name

    def _text(self, node: Node) -> tuple[str, int]:
        args = node.args
        if node.op == "const":
            if isinstance(node.data, Atom):
                return self.atom(node.data.name), ATOMIC
            return self.number(node.data), ATOMIC if node.data >= 0 else UNARY
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
        parts = self.text(cond, OR), self.text(then, OR), self.text(els, CHOICE)
        return self.conditional(*parts), CHOICE

    def infix(self, row: Operation, node: Node) -> tuple[str, int]:
        """Return an operation written between its arguments, or before the only one, and its precedence."""
        assert row.infix is not None
        sign, own = row.infix
        if row.arity == 1:
            return f"{sign}{self.text(node.args[0], own)}", own
        left, right = node.args
        return f"{self.text(left, own)} {sign} {self.text(right, own + 1)}", own

    def truth(self, node: Node) -> tuple[str, int]:
        """Return the text of a truth value, and its precedence."""
        args = node.args
        if node.op in ("and", "or"):
            sign, own, inner = self.connectives[node.op]
            return sign.join(self.text(arg, inner) for arg in args), own
        if node.op == "within":
            return self.within(node)
        if node.op == "not" and args[0].op in ("lt", "eq") and args[0] not in self.known:
            left, right = (self.text(arg, COMPARISON + 1) for arg in args[0].args)
            return f"{left} {'>=' if args[0].op == 'lt' else self.unequal} {right}", COMPARISON
        if node.op == "not":
            word, own = self.negation
            return f"{word}{self.text(args[0], own)}", own
        left, right = (self.text(arg, COMPARISON + 1) for arg in args)
        return f"{left} {'<' if node.op == 'lt' else self.equal} {right}", COMPARISON
