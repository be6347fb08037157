"""Terms and clauses as flat data, for engines that are copied or pickled.

Pickle and deepcopy follow a term from argument to argument and give up at a list of a few hundred elements.
A `TermTable` holds terms side by side instead, each once, however deep, shared or cyclic they are.
"""

from __future__ import annotations

from typing import Any, Final, TypeAlias

from drlsl.logic.core import Clause
from drlsl.logic.syntax import ReadTerm
from drlsl.logic.terms import Struct, Term, Var

Place: TypeAlias = int
"""The index of a term in a table."""

_VAR: Final = 0
_STRUCT: Final = 1
_SIMPLE: Final = 2


class TermTable:
    """Terms side by side; `items` is plain data, from which the terms can be rebuilt."""

    def __init__(self, items: list[tuple[Any, ...]] | None = None) -> None:
        """Make an empty table, or one of another table's `items`, with new terms."""
        self.items: list[tuple[Any, ...]] = [] if items is None else items
        self._terms = _made(self.items)
        self._places: dict[int, Place] = {}  # by identity
        self._unfilled: list[tuple[Place, Var | Struct]] = []

    def put(self, term: Term) -> Place:
        """Return the place of a term, adding it if necessary."""
        place = self._place(term)
        while self._unfilled:
            at, found = self._unfilled.pop()
            if type(found) is Var:
                self.items[at] = (_VAR, found.name, None if found.ref is None else self._place(found.ref))
            else:
                args = tuple([self._place(arg) for arg in found.args])  # type: ignore[union-attr]
                self.items[at] = (_STRUCT, found.name, args)
        return place

    def get(self, place: Place) -> Any:
        """Return the term at a place."""
        return self._terms[place]

    def place_of(self, identity: int) -> Place | None:
        """Return the place of the term with that `id`, if it was put here."""
        return self._places.get(identity)

    def _place(self, term: Term) -> Place:
        """Return the place of a term; its parts are added later."""
        place = self._places.get(id(term))
        if place is None:
            place = self._places[id(term)] = len(self.items)
            self.items.append((_SIMPLE, term))
            self._terms.append(term)  # which keeps its identity from being reused
            if type(term) is Var or type(term) is Struct:
                self._unfilled.append((place, term))
        return place


def _made(items: list[tuple[Any, ...]]) -> list[Term]:
    """Return new terms: first create all, then fill in their parts."""
    terms: list[Term] = [
        Var(item[1]) if item[0] == _VAR else Struct(item[1], ()) if item[0] == _STRUCT else item[1]
        for item in items
    ]
    for term, item in zip(terms, items, strict=True):
        if type(term) is Var:
            term.ref = None if item[2] is None else terms[item[2]]
        elif type(term) is Struct:
            term.args = tuple([terms[place] for place in item[2]])
    return terms


def put_clause(clause: Clause, table: TermTable) -> tuple[Any, ...]:
    """Return a clause as plain data, its terms in a table."""
    names = {name: table.put(variable) for name, variable in clause.names.items()}
    origin = _put_read(clause.origin, table) if isinstance(clause.origin, ReadTerm) else None
    return table.put(clause.head), table.put(clause.body), clause.span, names, clause.source, origin


def get_clause(data: tuple[Any, ...], table: TermTable) -> Clause:
    """Return the clause that was given to `put_clause`, rebuilt."""
    head, body, span, names, source, origin = data
    variables = {name: table.get(place) for name, place in names.items()}
    read = None if origin is None else _get_read(origin, table)
    return Clause(table.get(head), table.get(body), span, variables, source, read)


def _put_read(read: ReadTerm, table: TermTable) -> tuple[Any, ...]:
    term = table.put(read.term)
    variables = {name: table.put(variable) for name, variable in read.variables.items()}
    places = ((table.place_of(identity), offsets) for identity, offsets in read.positions.items())
    positions = {place: offsets for place, offsets in places if place is not None}
    return term, variables, read.singletons, read.span, read.source, positions


def _get_read(data: tuple[Any, ...], table: TermTable) -> ReadTerm:
    term, variables, singletons, span, source, positions = data
    return ReadTerm(
        table.get(term),
        {name: table.get(place) for name, place in variables.items()},
        singletons,
        span,
        source,
        {id(table.get(place)): offsets for place, offsets in positions.items()},
    )
