"""Checks of a builtin's arguments, with ISO's error for a wrong one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from drlsl.logic.core import Caller, Trail, undo, unify
from drlsl.logic.errors import domain_error, instantiation_error, type_error
from drlsl.logic.terms import NIL, Atom, Struct, Term, Var, deref

# After this many cells, a list is checked, to be sure that it is finite.
_LONG_LIST: Final = 50_000


def atom(term: Term) -> Atom:
    """Return the atom that an argument must be."""
    term = deref(term)
    if type(term) is Atom:
        return term
    raise instantiation_error() if type(term) is Var else type_error("atom", term)


def integer(term: Term) -> int:
    """Return the integer that an argument must be."""
    term = deref(term)
    if type(term) is int:
        return term
    raise instantiation_error() if type(term) is Var else type_error("integer", term)


def not_negative(term: Term) -> int:
    """Return the integer, zero or more, that an argument must be."""
    value = integer(term)
    if value < 0:
        raise domain_error("not_less_than_zero", value)
    return value


def items(term: Term, machine: Caller | None = None) -> list[Term]:
    """Return the elements of the proper list that an argument must be; see `prefix`."""
    found, tail = prefix(term, machine)
    if tail is NIL:
        return found
    raise instantiation_error() if type(tail) is Var else type_error("list", deref(term))


def prefix(term: Term, machine: Caller | None = None) -> tuple[list[Term], Term]:
    """Return the elements of a list as far as it goes, and its tail: ``[]`` for a proper list.

    The tail of an infinite list is the rest from some cell on. The length is reported to the meter of
    `machine`.
    """
    found: list[Term] = []
    term = deref(term)
    left = _LONG_LIST
    while type(term) is Struct and term.name == "." and len(term.args) == 2:
        found.append(term.args[0])
        left -= 1
        if not left:
            left = _LONG_LIST
            if _is_endless(term):
                return found, term
            if machine is not None:
                machine.meter.spend(_LONG_LIST)
        term = deref(term.args[1])
    if machine is not None:
        machine.meter.spend(_LONG_LIST - left)
    return found, term


def _is_endless(cell: Term) -> bool:
    """Return whether a list leads back to one of its cells. Source: R. P. Brent, BIT 20 (1980), section 3."""
    power = length = 1
    tortoise, hare = cell, cell
    while True:
        if type(hare) is not Struct or hare.name != "." or len(hare.args) != 2:
            return False
        hare = deref(hare.args[1])
        if hare is tortoise:
            return True
        if power == length:
            tortoise, power, length = hare, 2 * power, 0
        length += 1


def check_partial_list(term: Term) -> None:
    """Check that an argument to be unified with a list could be one."""
    tail = prefix(term)[1]
    if tail is not NIL and type(tail) is not Var:
        raise type_error("list", deref(term))


def unqualified(term: Term) -> Term:
    """Return a head, clause or indicator without module qualification: there is one name space."""
    term = deref(term)
    while type(term) is Struct and term.name == ":" and len(term.args) == 2:
        if type(deref(term.args[0])) is Var:
            raise instantiation_error()
        term = deref(term.args[1])
    return term


def indicator(term: Term) -> tuple[str, int]:
    """Return the name and arity of a predicate indicator."""
    term = unqualified(term)
    if type(term) is Var:
        raise instantiation_error()
    if type(term) is not Struct or term.name != "/" or len(term.args) != 2:
        raise type_error("predicate_indicator", term)
    name, arity = deref(term.args[0]), deref(term.args[1])
    if type(name) is Var or type(arity) is Var:
        raise instantiation_error()
    if type(name) is not Atom:
        raise type_error("atom", name)
    return name.name, not_negative(arity)


def members(term: Term) -> Iterator[Term]:
    """Yield the terms that a conjunction or a list is made of, from left to right."""
    todo = [term]
    while todo:
        term = deref(todo.pop())
        if type(term) is Struct and len(term.args) == 2 and term.name in (",", "."):
            todo.extend(reversed(term.args))
        elif term is not NIL:
            yield term


def indicators(term: Term) -> list[tuple[str, int]]:
    """Return the name and arity of each predicate indicator in a conjunction or list of them."""
    return [indicator(one) for one in members(term)]


def attempt(machine: Caller, left: Term, right: Term) -> bool:
    """Unify, or leave no bindings behind, for generators that continue after a mismatch."""
    trail: Trail = [machine.meter]
    matches = unify(left, right, trail)
    undo(trail, 1)
    return matches and machine.unify(left, right)
