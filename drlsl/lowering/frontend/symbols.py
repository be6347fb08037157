"""Terms and goals of a program that is being unfolded."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from drlsl.logic.core import Clause, Goal, read_body
from drlsl.logic.terms import Atom, Struct, Var
from drlsl.lowering.ir import Bag, Node, Sym, map_terms


def variables_of(terms: Sequence[Sym]) -> list[Var]:
    """Return the unbound variables, in order of appearance."""
    found: dict[Var, None] = {}

    def visit(part: Sym) -> Sym:
        if isinstance(part, Var):
            found[part] = None
        return part

    for term in terms:
        map_terms(visit, term)
    return list(found)


def is_ground(term: Sym) -> bool:
    """Return whether a term holds no unbound variable."""
    return not variables_of([term])


def renamed(clause: Clause) -> tuple[tuple[Sym, ...], Goal]:
    """Return the head's arguments and the body with variables of their own."""
    fresh: dict[Sym, Sym] = {}

    def visit(part: Sym) -> Sym:
        return fresh.setdefault(part, Var(names.get(part, "_"))) if isinstance(part, Var) else part

    names = {variable: name for name, variable in clause.names.items()}
    return tuple(map_terms(visit, arg) for arg in clause.args), read_body(map_terms(visit, clause.body))


def call_key(term: Sym, numbers: dict[Sym, int]) -> Any:
    """Return a key that identifies a call by its arguments; variables count by `numbers`."""
    if isinstance(term, Var):
        return numbers[term]
    if isinstance(term, Struct):
        return (term.name, *(call_key(arg, numbers) for arg in term.args))
    if isinstance(term, Node | Bag | Atom):
        return term
    return type(term), repr(term)
