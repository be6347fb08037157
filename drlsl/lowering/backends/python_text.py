"""Values as Python expressions."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from typing import ClassVar, Final

from drlsl.logic.terms import Atom
from drlsl.lowering.ir import Names, Node, Relation, relation_of

# text of an operation, and how strongly it binds
_INFIX: Final = {
    "add": ("+", 11),
    "sub": ("-", 11),
    "mul": ("*", 12),
    "bitand": ("&", 9),
    "bitxor": ("^", 8),
    "bitor": ("|", 7),
}
_DIVISIONS: Final = {"div": ("/", "nan"), "floordiv": ("//", "0"), "mod": ("%", "0")}
CALLS: Final = {
    "abs": "abs",
    "tofloat": "float",
    "sign": "sign",
    "floor": "floor",
    "ceiling": "ceil",
    "truncate": "trunc",
    "round": "rounded",
    "truncdiv": "truncated",
}
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


class PythonText(ABC):
    """Writes expressions, given the variables that hold some values."""

    calls: ClassVar[Mapping[str, str]] = CALLS
    """The functions of some operations."""

    twice: ClassVar[Collection[str]] = ("min", "max", "div", "floordiv", "mod", "sqrt", "isign")
    """The operations whose text names an argument twice."""

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
        if node.op in _INFIX:
            sign, own = _INFIX[node.op]
            return f"{self.text(args[0], own)} {sign} {self.text(args[1], own + 1)}", own
        if node.op in self.calls or node.op == "function":
            called = self.calls.get(node.op) or f"math_{node.data}"
            return f"{called}({', '.join(self.text(arg, CHOICE) for arg in args)})", ATOMIC
        if node.op in _DIVISIONS:
            return self.division(node)
        if node.kind == "bool":
            return self.truth(node)
        return self._choice(node)

    def division(self, node: Node) -> tuple[str, int]:
        """Return the text of a division, and its precedence."""
        sign, otherwise = _DIVISIONS[node.op]
        left, right = node.args
        text = f"{self.text(left, 12)} {sign} {self.text(right, 13)}"
        if right.low > 0 or right.high < 0:
            return text, 12
        return f"{text} if {self.text(right, OR)} else {otherwise}", CHOICE

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

    def _choice(self, node: Node) -> tuple[str, int]:
        args = node.args
        if node.op == "neg":
            return f"-{self.text(args[0], UNARY)}", UNARY
        if node.op == "select":
            cond, then, els = args
            return f"{self.text(then, OR)} if {self.text(cond, OR)} else {self.text(els, CHOICE)}", CHOICE
        first = self.text(args[0], COMPARISON + 1)
        if node.op == "sqrt":
            return (
                (f"sqrt({first})", ATOMIC)
                if args[0].low >= 0
                else (f"sqrt({first}) if {first} >= 0.0 else nan", CHOICE)
            )
        if node.op == "isign":
            return f"({first} > 0) - ({first} < 0)", 11
        second = self.text(args[1], COMPARISON + 1)
        # of equal numbers max takes the left and min the right, as in Prolog: it shows in the sign of a zero
        sign = ">=" if node.op == "max" else "<"
        return f"{first} if {first} {sign} {second} else {second}", CHOICE
