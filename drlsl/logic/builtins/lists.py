"""Predicates of the list library that are faster in Python than in Prolog."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby, pairwise
from operator import itemgetter

from drlsl.logic.builtins.arguments import attempt, check_partial_list, integer, items, prefix
from drlsl.logic.builtins.compare import sorted_terms, without_repeats
from drlsl.logic.core import Caller, compare, copy_term, det, nondet, sort_key, term_variables
from drlsl.logic.errors import domain_error, instantiation_error, type_error
from drlsl.logic.terms import NIL, TRUE, Struct, Term, Var, deref, make_list


@nondet("length", 2)
def length(machine: Caller, term: Term, size: Term) -> Iterator[bool | None]:
    """Relate a list and its length; enumerate lists if both are unknown."""
    found, tail = prefix(term, machine)
    size = deref(size)
    if type(size) is not int and type(size) is not Var:
        raise type_error("integer", size)
    if tail is NIL:
        if machine.unify(size, len(found)):
            yield True
        return
    if type(tail) is not Var:
        raise type_error("list", deref(term))
    if type(size) is int:
        if size < 0:
            raise domain_error("not_less_than_zero", size)
        if size >= len(found):
            machine.meter.make(size - len(found))
            machine.unify(tail, make_list([Var() for _ in range(size - len(found))]))
            yield True
        return
    if size is tail:
        return  # no list is its own length
    total = len(found)
    while True:
        machine.meter.make(total - len(found))
        machine.unify(tail, make_list([Var() for _ in range(total - len(found))]))
        machine.unify(size, total)
        yield None
        total += 1


@det("numlist", 3)
def numlist(machine: Caller, low: Term, high: Term, result: Term) -> bool:
    first, last = integer(low), integer(high)
    if first > last:
        return False
    machine.meter.make(last - first + 1)
    return machine.unify(result, make_list(range(first, last + 1)))


@det("list_to_set", 2)
def list_to_set(machine: Caller, terms: Term, result: Term) -> bool:
    """Unify with the elements without later ones that are identical to an earlier one."""
    elements = [deref(term) for term in items(terms, machine)]
    key = sort_key(meter=machine.meter)
    order = sorted(range(len(elements)), key=lambda place: key(elements[place]))
    repeated = {
        later
        for earlier, later in pairwise(order)
        if compare(elements[earlier], elements[later], meter=machine.meter) == 0
    }
    kept = [term for place, term in enumerate(elements) if place not in repeated]
    return machine.unify(result, make_list(kept))


@det("$free_variables", 3)
def free_variables(machine: Caller, scoped: Term, witness: Term, goal: Term) -> bool:
    """Unify with the free variables of ``Template^Goal`` as a term, and the goal without ``^``.

    Source: ISO 13211-1, 7.1.1.4 (free variables set) and 7.1.6.3 (iterated goal).
    """
    scope = deref(scoped)
    bound: list[Term] = []
    while type(scope) is Struct and scope.name == "^" and len(scope.args) == 2:
        bound.append(scope.args[0])
        scope = deref(scope.args[1])
    if type(scope) is Var:
        raise instantiation_error()
    meter = machine.meter
    hidden = set(term_variables(make_list(bound), meter))
    free: list[Term] = [variable for variable in term_variables(scope, meter) if variable not in hidden]
    return machine.unify(witness, Struct("v", tuple(free)) if free else NIL) and machine.unify(goal, scope)


# The time of two small copies.
_STEPS_OF_PAIR = 16


def _in_order(count: int) -> list[Var]:
    """Return fresh variables, each of which precedes the next in the standard order."""
    return sorted((Var() for _ in range(count)), key=id)


def _counted(machine: Caller, pairs: list[Struct]) -> Iterator[Struct]:
    """Yield pairs, mostly with small witness and template: copying these counts no steps of its own."""
    for pair in pairs:
        machine.meter.spend(_STEPS_OF_PAIR)
        yield pair


def _groups_by_witness(machine: Caller, pairs: list[Struct]) -> list[list[Struct]]:
    """Return the groups of pairs with variant witnesses, in the order of the witnesses."""
    variables = [term_variables(pair.args[0], machine.meter) for pair in _counted(machine, pairs)]
    stand_ins = _in_order(max(map(len, variables), default=0))
    key_of = sort_key(iso=machine.flags.iso, meter=machine.meter)
    keyed = [
        (key_of(copy_term(pair.args[0], dict(zip(own, stand_ins, strict=False)), machine.meter)), pair)
        for pair, own in zip(_counted(machine, pairs), variables, strict=True)
    ]
    keyed.sort(key=itemgetter(0))
    return [[pair for _, pair in group] for _, group in groupby(keyed, key=itemgetter(0))]


@nondet("$solution_groups", 4)
def solution_groups(
    machine: Caller, answers: Term, witness: Term, as_set: Term, found: Term
) -> Iterator[bool | None]:
    """Yield the templates of each group of ``Witness-Template`` pairs with variant witnesses.

    Source: ISO 13211-1, 8.10.2 and 8.10.3.
    """
    pairs = [pair for pair in map(deref, items(answers, machine)) if type(pair) is Struct]
    groups = _groups_by_witness(machine, pairs)
    for number, group in enumerate(groups, 1):
        # Members of a group share their witness, so that its variables are the same in each template.
        own = term_variables(group[0].args[0])
        variables = _in_order(len(own))
        shared = copy_term(group[0].args[0], dict(zip(own, variables, strict=True)), machine.meter)
        templates = [
            copy_term(
                pair.args[1],
                dict(zip(term_variables(pair.args[0]), variables, strict=True)),
                machine.meter,
            )
            for pair in _counted(machine, group)
        ]
        if deref(as_set) is TRUE:
            templates = without_repeats(machine, sorted_terms(machine, templates))
        if attempt(machine, Struct("-", (witness, found)), Struct("-", (shared, make_list(templates)))):
            yield number == len(groups)


@det("$check_partial_list", 1)
def check_result(machine: Caller, term: Term) -> bool:
    """Refuse a term that no list unifies with; SWI-Prolog only fails."""
    if machine.flags.iso:
        check_partial_list(term)
    return True


@det("$check_list", 1)
def check_list(_machine: Caller, term: Term) -> bool:
    items(term)
    return True
