"""The operator table of an engine, changed by op/3 and used by reader and writer."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

SPECIFIERS: Final = frozenset({"xfx", "xfy", "yfx", "fy", "fx", "xf", "yf"})

# Source: ISO 13211-1 table 7 with Cor.2 (prefix +, div, bar), then further operators of SWI-Prolog.
_DEFAULT: Final = (
    (1200, "xfx", (":-", "-->")),
    (1200, "fx", (":-", "?-")),
    (1105, "xfy", ("|",)),
    (1100, "xfy", (";",)),
    (1050, "xfy", ("->",)),
    (1000, "xfy", (",",)),
    (900, "fy", ("\\+",)),
    (700, "xfx", ("=", "\\=", "==", "\\==", "@<", "@=<", "@>", "@>=", "=..")),
    (700, "xfx", ("is", "=:=", "=\\=", "<", "=<", ">", ">=")),
    (600, "xfy", (":",)),
    (500, "yfx", ("+", "-", "/\\", "\\/")),
    (400, "yfx", ("*", "/", "//", "rem", "mod", "div", "<<", ">>")),
    (200, "xfx", ("**",)),
    (200, "xfy", ("^",)),
    (200, "fy", ("-", "+", "\\")),
    (1150, "fx", ("dynamic", "discontiguous", "initialization", "multifile", "table")),
    (1150, "fx", ("mode", "meta_predicate", "module_transparent", "public", "thread_local", "volatile")),
    (1050, "xfy", ("*->",)),
    (700, "xfx", ("=@=", "\\=@=")),
    (400, "yfx", ("xor",)),
)


class Operators:
    """The prefix, infix and postfix operators of one engine.

    `prefix` maps a name to (priority, argument's maximum), `infix` to (priority, left maximum, right maximum)
    and `postfix` to (priority, argument's maximum). Reader and writer look names up in these dicts directly.
    """

    __slots__ = ("infix", "postfix", "prefix")

    def __init__(self) -> None:
        self.prefix: dict[str, tuple[int, int]] = {}
        self.infix: dict[str, tuple[int, int, int]] = {}
        self.postfix: dict[str, tuple[int, int]] = {}
        for priority, specifier, names in _DEFAULT:
            for name in names:
                self.add(priority, specifier, name)

    def copy(self) -> Operators:
        """Return an independent table with the same operators."""
        twin = Operators.__new__(Operators)
        twin.prefix, twin.infix, twin.postfix = self.prefix.copy(), self.infix.copy(), self.postfix.copy()
        return twin

    def add(self, priority: int, specifier: str, name: str) -> None:
        """Define `name` as an operator; priority 0 removes the definition. Checks nothing: op/3 does."""
        if priority == 0:
            table = (
                self.infix if len(specifier) == 3 else self.prefix if specifier[0] == "f" else self.postfix
            )
            table.pop(name, None)
        elif len(specifier) == 3:
            left, right = (priority - (side == "x") for side in (specifier[0], specifier[2]))
            self.infix[name] = (priority, left, right)
        elif specifier[0] == "f":
            self.prefix[name] = (priority, priority - (specifier[1] == "x"))
        else:
            self.postfix[name] = (priority, priority - (specifier[0] == "x"))

    def is_operator(self, name: str) -> bool:
        """Return whether `name` is an operator of any class."""
        return name in self.infix or name in self.prefix or name in self.postfix

    def entries(self) -> Iterator[tuple[int, str, str]]:
        """Yield each definition as (priority, specifier, name)."""
        for name, (priority, argument) in list(self.prefix.items()):
            yield priority, "fy" if argument == priority else "fx", name
        for name, (priority, left, right) in list(self.infix.items()):
            yield (
                priority,
                ("y" if left == priority else "x") + "f" + ("y" if right == priority else "x"),
                name,
            )
        for name, (priority, argument) in list(self.postfix.items()):
            yield priority, "yf" if argument == priority else "xf", name
