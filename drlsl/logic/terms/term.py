"""The terms of Prolog as Python values.

A term is an `Atom`, a `Var`, a `Struct`, an `int`, a `float` or, for Prolog's string type, a `str`.
Lists are ``Struct(".", (head, tail))`` cells that end in the atom ``[]``; the curly term ``{t}`` is
``Struct("{}", (t,))``.
"""

from __future__ import annotations

import threading
import weakref
from collections.abc import Iterable, Iterator
from typing import Final, TypeAlias


class Atom:
    """An interned symbol: while an atom is in use, every atom of its name is the same object.

    Atoms are immutable, so engines share them without sharing any state. Those without references are freed
    some time later; code that stores the `id` of an atom must keep the atom, too.
    """

    __slots__ = ("__weakref__", "name")

    name: str

    def __new__(cls, name: str) -> Atom:
        known = _KNOWN.get(name)
        return known if known is not None else _TABLE.intern(name)

    def __repr__(self) -> str:
        return f"Atom({self.name!r})"

    def __reduce__(self) -> tuple[type[Atom], tuple[str]]:
        return Atom, (self.name,)


# Atoms with more characters are freed at once, which takes more time for each of them.
_LONG: Final = 4096
# An atom and its place in the table [bytes], without the characters of its name.
_ATOM_BYTES: Final = 150
# This many bytes of new atoms are not worth a sweep.
_FEW_BYTES: Final = 1 << 20
# This many more for each atom that a sweep keeps, whose work does not depend on its name's length.
_NEW_BYTES_OF_ATOM: Final = 3 * _ATOM_BYTES


class _AtomTable:
    """The atoms by their names: all that are in use, and a limited number that are not.

    `known` holds ordinary references, so that looking up an atom is fast. When the atoms that are new since
    the last sweep take much memory compared with the number that were in use then, the next sweep drops all
    references and restores those of atoms that still exist.
    """

    def __init__(self) -> None:
        self.known: dict[str, Atom] = {}
        self._passing: dict[str, weakref.ref[Atom]] = {}
        self._long: weakref.WeakValueDictionary[str, Atom] = weakref.WeakValueDictionary()
        # Reentrant, since a finaliser may intern an atom during a sweep.
        self._lock = threading.RLock()
        self._is_sweeping = False
        self._new_bytes = 0
        self._most_bytes = _FEW_BYTES

    def intern(self, name: str) -> Atom:
        """Return the atom of a name that is not among the known ones, or was not a moment ago."""
        with self._lock:
            if len(name) > _LONG:
                return self._long.setdefault(name, _new_atom(name))
            passing = self._passing.get(name)
            atom = None if passing is None else passing()
            if atom is None:
                atom = _new_atom(name)
            atom = self.known.setdefault(name, atom)
            self._new_bytes += _ATOM_BYTES + len(name)
            if self._new_bytes > self._most_bytes and not self._is_sweeping:
                self._sweep()
            return atom

    def _sweep(self) -> None:
        """Forget the atoms without other references; at every moment all other ones can be found."""
        self._is_sweeping = True
        try:
            self._passing.update((name, weakref.ref(atom)) for name, atom in self.known.copy().items())
            for name in self._passing:
                self.known.pop(name, None)
            for name, passing in self._passing.items():
                atom = passing()
                if atom is not None:
                    self.known.setdefault(name, atom)
            self._passing.clear()
            self._new_bytes = 0
            self._most_bytes = max(_FEW_BYTES, _NEW_BYTES_OF_ATOM * len(self.known))
        finally:
            self._is_sweeping = False


def _new_atom(name: str) -> Atom:
    atom = object.__new__(Atom)
    atom.name = name
    return atom


_TABLE: Final = _AtomTable()
_KNOWN: Final = _TABLE.known


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
    """Return the term that a chain of bound variables leads to."""
    while type(term) is Var:
        ref = term.ref
        if ref is None:
            return term
        term = ref
    return term


def parts(term: Term) -> Iterator[Term]:
    """Yield a term and all that is inside it, dereferenced, from left to right; what is shared, each time."""
    todo = [term]
    while todo:
        part = deref(todo.pop())
        yield part
        if isinstance(part, Struct):
            todo.extend(reversed(part.args))


def names(term: Term) -> Iterator[str]:
    """Yield the names of the atoms and compound terms in a term."""
    return (part.name for part in parts(term) if isinstance(part, Atom | Struct))


def make_list(items: Iterable[Term], tail: Term = NIL) -> Term:
    """Return the Prolog list of `items`, ending in `tail`."""
    result = tail
    for item in reversed(list(items)):
        result = Struct(".", (item, result))
    return result


# A walk over fewer compound terms need not remember them.
_FEW: Final = 500


class CyclicTerm(ValueError):
    """A term that contains itself is infinite, so nothing finite can be made of it."""


def is_acyclic(root: Term) -> bool:
    """Return whether a term is finite: no part of it contains itself."""
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
