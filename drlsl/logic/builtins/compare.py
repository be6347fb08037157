"""Unification, the standard order of terms, and sorting by it."""

from __future__ import annotations

from typing import Any

from drlsl.logic.builtins.arguments import check_partial_list, items, not_negative, prefix
from drlsl.logic.core import Caller, compare, det, sort_key, undo, unify, unify_occurs, variant
from drlsl.logic.errors import domain_error, instantiation_error, type_error
from drlsl.logic.terms import Atom, Struct, Term, Var, deref, make_list


@det("=", 2)
def equal(machine: Caller, left: Term, right: Term) -> bool:
    """Source: ISO 13211-1, 8.2.1; the flag `occurs_check` asks for the occurs check."""
    mode = machine.flags.occurs_check
    if mode == "false":
        return machine.unify(left, right)
    trail: list[Any] = [machine.meter]
    sound = unify_occurs(left, right, trail)
    if not sound and mode == "error":
        undo(trail, 1)
        if unify(left, right, trail):
            undo(trail, 1)
            raise type_error("acyclic_term", Struct("=", (left, right)))
    undo(trail, 1)
    return sound and machine.unify(left, right)


@det("\\=", 2)
def not_unifiable(machine: Caller, left: Term, right: Term) -> bool:
    trail: list[Any] = [machine.meter]
    unifiable = unify(left, right, trail)
    undo(trail, 1)
    return not unifiable


@det("unify_with_occurs_check", 2)
def unify_with_occurs_check(machine: Caller, left: Term, right: Term) -> bool:
    """Source: ISO 13211-1, 8.2.2."""
    trail: list[Any] = [machine.meter]
    sound = unify_occurs(left, right, trail)
    undo(trail, 1)
    return sound and machine.unify(left, right)


@det("==", 2)
def identical(machine: Caller, left: Term, right: Term) -> bool:
    return compare(left, right, meter=machine.meter) == 0


@det("\\==", 2)
def not_identical(machine: Caller, left: Term, right: Term) -> bool:
    return compare(left, right, meter=machine.meter) != 0


@det("=@=", 2)
def is_variant(machine: Caller, left: Term, right: Term) -> bool:
    return variant(left, right, machine.meter)


@det("\\=@=", 2)
def is_no_variant(machine: Caller, left: Term, right: Term) -> bool:
    return not variant(left, right, machine.meter)


@det("?=", 2)
def decided(machine: Caller, left: Term, right: Term) -> bool:
    """Decide the usual cases of \\=: terms that are identical or cannot be unified."""
    return compare(left, right, meter=machine.meter) == 0 or not_unifiable(machine, left, right)


@det("@<", 2)
def before(machine: Caller, left: Term, right: Term) -> bool:
    return compare(left, right, iso=machine.flags.iso, meter=machine.meter) < 0


@det("@>", 2)
def after(machine: Caller, left: Term, right: Term) -> bool:
    return compare(left, right, iso=machine.flags.iso, meter=machine.meter) > 0


@det("@=<", 2)
def not_after(machine: Caller, left: Term, right: Term) -> bool:
    return compare(left, right, iso=machine.flags.iso, meter=machine.meter) <= 0


@det("@>=", 2)
def not_before(machine: Caller, left: Term, right: Term) -> bool:
    return compare(left, right, iso=machine.flags.iso, meter=machine.meter) >= 0


_ORDERS = {-1: Atom("<"), 0: Atom("="), 1: Atom(">")}


@det("compare", 3)
def compare_terms(machine: Caller, order: Term, left: Term, right: Term) -> bool:
    """Source: ISO 13211-1, 8.4.2."""
    order = deref(order)
    if type(order) is not Var:
        if type(order) is not Atom:
            raise type_error("atom", order)
        if order.name not in ("<", "=", ">"):
            raise domain_error("order", order)
    return machine.unify(order, _ORDERS[compare(left, right, iso=machine.flags.iso, meter=machine.meter)])


def sorted_terms(machine: Caller, terms: list[Term]) -> list[Term]:
    """Return the terms in the standard order, duplicates kept."""
    machine.meter.make(2 * len(terms))
    terms = [deref(term) for term in terms]
    kinds = set(map(type, terms))
    if kinds == {int} or kinds == {str}:
        return sorted(terms)  # type: ignore[type-var]  # all of one ordered type
    if kinds == {Atom}:
        return sorted(terms, key=lambda term: term.name)  # type: ignore[union-attr]  # atoms, all of them
    return sorted(terms, key=sort_key(iso=machine.flags.iso, meter=machine.meter))


def without_repeats(machine: Caller, terms: list[Term]) -> list[Term]:
    """Return a sorted list without the repetitions of identical terms."""
    machine.meter.spend(len(terms))
    kept: list[Term] = []
    for term in terms:
        if not kept or compare(kept[-1], term, meter=machine.meter) != 0:
            kept.append(term)
    return kept


@det("msort", 2)
def msort(machine: Caller, terms: Term, result: Term) -> bool:
    return machine.unify(result, make_list(sorted_terms(machine, items(terms, machine))))


@det("sort", 2)
def sort(machine: Caller, terms: Term, result: Term) -> bool:
    """Source: ISO 13211-1 Cor.2, 8.4.3."""
    elements = items(terms, machine)
    if machine.flags.iso:
        check_partial_list(result)
    return machine.unify(result, make_list(without_repeats(machine, sorted_terms(machine, elements))))


@det("keysort", 2)
def keysort(machine: Caller, pairs: Term, result: Term) -> bool:
    """Source: ISO 13211-1 Cor.2, 8.4.4."""
    elements = [_pair(term) for term in items(pairs, machine)]
    if machine.flags.iso:
        check_partial_list(result)
        for term in prefix(result, machine)[0]:
            if type(deref(term)) is not Var:
                _pair(term)
    key = sort_key(iso=machine.flags.iso, meter=machine.meter)
    elements.sort(key=lambda pair: key(pair.args[0]))
    return machine.unify(result, make_list(elements))


def _pair(term: Term) -> Struct:
    term = deref(term)
    if type(term) is Struct and term.name == "-" and len(term.args) == 2:
        return term
    raise instantiation_error() if type(term) is Var else type_error("pair", term)


@det("sort", 4)
def sort_by(machine: Caller, key: Term, order: Term, terms: Term, result: Term) -> bool:
    """Sort by an argument (0: the whole term), ``@<`` and ``@>`` dropping terms of equal keys."""
    position = not_negative(key)
    order = deref(order)
    if type(order) is Var:
        raise instantiation_error()
    if type(order) is not Atom:
        raise type_error("atom", order)
    if order.name not in ("@<", "@=<", "@>", "@>="):
        raise domain_error("order", order)
    keyed = [(_sort_argument(term, position), term) for term in items(terms, machine)]
    by = sort_key(iso=machine.flags.iso, meter=machine.meter)
    keyed.sort(key=lambda item: by(item[0]), reverse=order.name in ("@>", "@>="))
    keeps = order.name in ("@=<", "@>=")
    kept: list[tuple[Term, Term]] = []
    for item in keyed:
        if keeps or not kept or compare(kept[-1][0], item[0], meter=machine.meter) != 0:
            kept.append(item)
    return machine.unify(result, make_list([term for _, term in kept]))


def _sort_argument(term: Term, position: int) -> Term:
    term = deref(term)
    if position == 0:
        return term
    if type(term) is Var:
        raise instantiation_error()
    if type(term) is not Struct:
        raise type_error("compound", term)
    if position > len(term.args):
        raise type_error("compound", term)
    return term.args[position - 1]
