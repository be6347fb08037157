"""The terms of Prolog as Python values.

A term is an `Atom`, a `Var`, a `Struct`, an `int`, a `float` or, for Prolog's string type, a `str`.
Lists are ``Struct(".", (head, tail))`` cells that end in the atom ``[]``; the curly term ``{t}`` is
``Struct("{}", (t,))``.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final, TypeAlias


class Atom:
    """An interned symbol: two atoms of one name are the same object.

    Atoms are immutable, so engines share them without sharing any state.
    """

    __slots__ = ("name",)

    name: str
    _table: dict[str, Atom] = {}  # noqa: RUF012  (the intern table: grows only, never changes an entry)

    def __new__(cls, name: str) -> Atom:
        known = cls._table.get(name)
        if known is not None:
            return known
        atom = super().__new__(cls)
        atom.name = name
        return cls._table.setdefault(name, atom)

    def __repr__(self) -> str:
        return f"Atom({self.name!r})"

    def __reduce__(self) -> tuple[type[Atom], tuple[str]]:
        return Atom, (self.name,)


class Var:
    """A logic variable; `ref` is None while unbound, else the term it is bound to."""

    __slots__ = ("name", "ref")

    def __init__(self, name: str = "_") -> None:
        self.name = name
        self.ref: Term | None = None

    def __repr__(self) -> str:
        return f"Var({self.name!r})" if self.ref is None else f"Var({self.name!r}={self.ref!r})"


class Struct:
    """A compound term: a functor name and at least one argument."""

    __slots__ = ("args", "name")

    def __init__(self, name: str, args: tuple[Term, ...]) -> None:
        self.name = name
        self.args = args

    def __repr__(self) -> str:
        return f"Struct({self.name!r}, {self.args!r})"


Term: TypeAlias = Atom | Var | Struct | int | float | str

NIL: Final = Atom("[]")
TRUE: Final = Atom("true")
CURLY: Final = Atom("{}")


def deref(term: Term) -> Term:
    """The term a chain of bound variables leads to."""
    while type(term) is Var:
        ref = term.ref
        if ref is None:
            return term
        term = ref
    return term


def make_list(items: Iterable[Term], tail: Term = NIL) -> Term:
    """The Prolog list of `items`, ending in `tail`."""
    result = tail
    for item in reversed(list(items)):
        result = Struct(".", (item, result))
    return result


# A walk of fewer compound terms may do without remembering where it was.
_FEW: Final = 500


class CyclicTerm(ValueError):
    """A term that contains itself has no end, so nothing finite can be made of it."""


def is_acyclic(root: Term) -> bool:
    """Whether a term is finite: no part of it contains itself."""
    left = _FEW
    around = [root]
    while around and left:
        term = deref(around.pop())
        if type(term) is Struct:
            left -= 1
            around += term.args
    if not around:
        return True
    done: set[int] = set()
    open_terms: set[int] = set()
    todo: list[tuple[Term, bool]] = [(root, False)]
    while todo:
        term, is_left = todo.pop()
        term = deref(term)
        if type(term) is not Struct or id(term) in done:
            continue
        if is_left:
            open_terms.discard(id(term))
            done.add(id(term))
        elif id(term) in open_terms:
            return False
        else:
            open_terms.add(id(term))
            todo.append((term, True))
            todo.extend((arg, False) for arg in term.args)
    return True
