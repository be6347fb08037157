"""The clause database, global variables and the flags.

Source: ISO 13211-1, 8.8 and 8.9.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Final

from drlsl.logic.builtins.arguments import atom, attempt, indicator, indicators, unqualified
from drlsl.logic.core import (
    CONNECTIVES,
    Caller,
    Clause,
    Deep,
    Indicator,
    Predicate,
    Trail,
    callable_parts,
    check_body,
    copy_term,
    det,
    is_builtin,
    joined,
    nondet,
    run_deep,
    undo,
    unify,
)
from drlsl.logic.errors import existence_error, permission_error, representation_error, type_error
from drlsl.logic.limits import Meter
from drlsl.logic.terms import TRUE, Atom, Struct, Term, Var, deref, is_acyclic

# Trying a clause takes as long as this many steps of a walk.
_STEPS_OF_CLAUSE: Final = 10


def name_term(name: str, arity: int) -> Struct:
    """Return the predicate indicator ``name/arity``."""
    return Struct("/", (Atom(name), arity))


def split_clause(term: Term, meter: Meter | None = None) -> tuple[Term, Term]:
    """Return the head and the body of a clause; a variable as a goal becomes ``call(Variable)``.

    Raises:
        InstantiationError, PrologTypeError: As assertz/1 does. Source: ISO 13211-1, 8.9.2.3.
    """
    head, body = _parts(term)
    callable_parts(head)
    goals = joined(body, meter)
    check_body(goals, body)
    has_variable = any(type(goal) is Var for goal in goals)
    return head, run_deep(_with_calls(body)) if has_variable else body


def _parts(term: Term) -> tuple[Term, Term]:
    """Return the terms on either side of the neck; a fact has the body true."""
    term = unqualified(term)
    if type(term) is Struct and term.name == ":-" and len(term.args) == 2:
        return unqualified(term.args[0]), deref(term.args[1])
    return term, TRUE


def _with_calls(body: Term) -> Deep[Term]:
    """Yield the body with its variables as goals wrapped in call/1."""
    goals: list[Term] = []
    rest = deref(body)
    while type(rest) is Struct and rest.name == "," and len(rest.args) == 2:
        goals.append((yield _with_calls_inside(rest.args[0])))
        rest = deref(rest.args[1])
    result: Term = yield _with_calls_inside(rest)
    for goal in reversed(goals):
        result = Struct(",", (goal, result))
    return result


def _with_calls_inside(goal: Term) -> Deep[Term]:
    goal = deref(goal)
    if type(goal) is Var:
        return Struct("call", (goal,))
    if type(goal) is Struct and len(goal.args) == 2 and goal.name in CONNECTIVES:
        left = yield _with_calls(goal.args[0])
        right = yield _with_calls(goal.args[1])
        return Struct(goal.name, (left, right))
    return goal


def _to_add(machine: Caller, term: Term) -> tuple[Clause, Predicate]:
    """Return a new clause, and its predicate."""
    copied = copy_term(term, meter=machine.meter)
    if not is_acyclic(copied):
        raise representation_error("acyclic_term")
    head, body = split_clause(copied, machine.meter)
    name, args = callable_parts(head)
    return Clause(head, body), _to_modify(machine, name, len(args))


def _to_modify(machine: Caller, name: str, arity: int) -> Predicate:
    """Return the dynamic predicate of that name and arity, created if necessary."""
    predicate = machine.program.get(name, arity)
    if not predicate.dynamic:
        if predicate.defined or is_builtin(name, arity):
            raise permission_error("modify", "static_procedure", name_term(name, arity))
        predicate.dynamic = predicate.defined = True
    return predicate


@det("assertz", 1)
@det("assert", 1)
def assertz(machine: Caller, term: Term) -> bool:
    """Source: ISO 13211-1, 8.9.2."""
    clause, predicate = _to_add(machine, term)
    predicate.append(clause)
    return True


@det("asserta", 1)
def asserta(machine: Caller, term: Term) -> bool:
    """Source: ISO 13211-1, 8.9.1."""
    clause, predicate = _to_add(machine, term)
    predicate.prepend(clause)
    return True


def _matching(machine: Caller, predicate: Predicate, head: Term, body: Term) -> Iterator[tuple[Clause, bool]]:
    """Unify with each clause that existed at first; yield for each match whether it is the last."""
    args = callable_parts(head)[1]
    stored = predicate.stored_clauses()
    candidates = predicate.candidates(deref(args[0])) if args else stored
    end = len(candidates)
    generation = machine.program.generation
    pattern = Struct(":-", (head, body))
    for index in range(predicate.start if candidates is stored else 0, end):
        clause = candidates[index]
        if clause.erased and clause.erased <= generation:
            continue
        machine.meter.spend(_STEPS_OF_CLAUSE)
        fresh = copy_term(Struct(":-", (clause.head, clause.body)), meter=machine.meter)
        if attempt(machine, pattern, fresh):
            yield clause, index == end - 1


@nondet("clause", 2)
def clause(machine: Caller, head: Term, body: Term) -> Iterator[bool | None]:
    """Source: ISO 13211-1, 8.8.1."""
    name, args = callable_parts(head)
    body = deref(body)
    if type(body) is not Var and type(body) is not Atom and type(body) is not Struct:
        raise type_error("callable", body)
    predicate = machine.program.find(name, len(args))
    if predicate is None:
        if is_builtin(name, len(args)):
            raise permission_error("access", "private_procedure", name_term(name, len(args)))
        return
    if machine.flags.iso and not predicate.dynamic:
        raise permission_error("access", "private_procedure", name_term(name, len(args)))
    for _, is_last in _matching(machine, predicate, deref(head), body):
        yield is_last


@nondet("retract", 1)
def retract(machine: Caller, term: Term) -> Iterator[bool | None]:
    """Source: ISO 13211-1, 8.9.3."""
    head, body = _parts(term)
    name, args = callable_parts(head)
    predicate = machine.program.find(name, len(args))
    if predicate is None:
        if is_builtin(name, len(args)):
            raise permission_error("modify", "static_procedure", name_term(name, len(args)))
        return
    if not predicate.dynamic:
        raise permission_error("modify", "static_procedure", name_term(name, len(args)))
    for found, is_last in _matching(machine, predicate, head, body):
        if predicate.erase(found):
            yield is_last


@det("retractall", 1)
def retractall(machine: Caller, head: Term) -> bool:
    """Source: ISO 13211-1 Cor.2, 8.9.5."""
    head = unqualified(head)
    name, args = callable_parts(head)
    predicate = _to_modify(machine, name, len(args))
    free = {id(arg) for arg in map(deref, args) if type(arg) is Var}
    if len(free) == len(args):
        if predicate.rows is not None:
            predicate.replace_rows([])
        else:
            for found in predicate.clauses:
                predicate.erase(found)
        return True
    first = deref(args[0])
    predicate.stored_clauses()
    for found in list(predicate.candidates(first)):
        machine.meter.spend(_STEPS_OF_CLAUSE)
        trail: Trail = [machine.meter]
        if not found.erased and unify(head, copy_term(found.head, meter=machine.meter), trail):
            predicate.erase(found)
        undo(trail, 1)
    return True


@det("abolish", 1)
def abolish(machine: Caller, term: Term) -> bool:
    """Source: ISO 13211-1, 8.9.4."""
    name, arity = indicator(term)
    predicate = machine.program.find(name, arity)
    if is_builtin(name, arity) or (predicate is not None and not predicate.dynamic):
        raise permission_error("modify", "static_procedure", name_term(name, arity))
    if predicate is not None:
        predicate.replace([])
        predicate.defined = predicate.dynamic = False
    return True


def to_declare(machine: Caller, named: Sequence[Indicator]) -> list[Predicate]:
    """Return the predicates of these names and arities, to be given a property.

    Raises:
        PrologPermissionError: One of them is a builtin.
    """
    for name, arity in named:
        if is_builtin(name, arity):
            raise permission_error("modify", "static_procedure", name_term(name, arity))
    return [machine.program.get(name, arity) for name, arity in named]


def declare(machine: Caller, specification: Term, *, what: str) -> bool:
    """Give predicates a property; all of them, or none when one of them is a builtin."""
    for predicate in to_declare(machine, indicators(specification)):
        name, arity = predicate.indicator
        if what == "dynamic" and predicate.defined and not predicate.dynamic and predicate.clauses:
            raise permission_error("modify", "static_procedure", name_term(name, arity))
        if what == "dynamic":
            predicate.dynamic = predicate.defined = True
        elif what == "discontiguous":
            predicate.discontiguous = True
        else:
            predicate.multifile = predicate.defined = True
    return True


det("dynamic", 1)(partial(declare, what="dynamic"))
det("discontiguous", 1)(partial(declare, what="discontiguous"))
det("multifile", 1)(partial(declare, what="multifile"))


@nondet("current_predicate", 1)
def current_predicate(machine: Caller, term: Term) -> Iterator[bool | None]:
    """Source: ISO 13211-1, 8.8.2."""
    term = deref(term)
    name: Term = Var()
    arity: Term = Var()
    if type(term) is Struct and term.name == "/" and len(term.args) == 2:
        name, arity = deref(term.args[0]), deref(term.args[1])
    elif type(term) is not Var:
        raise type_error("predicate_indicator", term)
    if not (type(name) in (Var, Atom) and type(arity) in (Var, int)):
        raise type_error("predicate_indicator", term)
    if type(name) is Atom and type(arity) is int:
        predicate = machine.program.find(name.name, arity)
        if predicate is not None and (predicate.dynamic or len(predicate)):
            yield True
        return
    for key, predicate in list(machine.program.predicates.items()):
        if not predicate.defined or not (predicate.dynamic or len(predicate)):
            continue
        if (type(name) is Atom and name.name != key[0]) or (type(arity) is int and arity != key[1]):
            continue
        if attempt(machine, term, name_term(*key)):
            yield None


@nondet("predicate_property", 2)
def predicate_property(machine: Caller, head: Term, wanted: Term) -> Iterator[bool | None]:
    """Enumerate properties of a head's predicate: dynamic, defined, built_in, number_of_clauses(N)."""
    head = deref(head)
    if type(head) is Var:
        for key, predicate in list(machine.program.predicates.items()):
            if predicate.defined:
                machine.unify(
                    head, Struct(key[0], tuple([Var() for _ in range(key[1])])) if key[1] else Atom(key[0])
                )
                for found in _properties(predicate):
                    if attempt(machine, wanted, found):
                        yield None
        return
    name, args = callable_parts(head)
    known = machine.program.find(name, len(args))
    properties: list[Term] = []
    if known is not None:
        properties = _properties(known)
    elif is_builtin(name, len(args)):
        properties = [Atom("defined"), Atom("built_in"), Atom("static"), Atom("visible")]
    for found in properties:
        if attempt(machine, wanted, found):
            yield None


def _properties(predicate: Predicate) -> list[Term]:
    found: list[Term] = [Atom("defined"), Atom("visible"), Atom("dynamic" if predicate.dynamic else "static")]
    if predicate.discontiguous:
        found.append(Atom("discontiguous"))
    if predicate.multifile:
        found.append(Atom("multifile"))
    if predicate.tabled is not None:
        found.append(Atom("tabled"))
    found.append(Struct("number_of_clauses", (len(predicate),)))
    return found


@det("nb_setval", 2)
def nb_setval(machine: Caller, key: Term, value: Term) -> bool:
    machine.globals[atom(key).name] = copy_term(value, meter=machine.meter)
    return True


@det("b_setval", 2)
def b_setval(machine: Caller, key: Term, value: Term) -> bool:
    name = atom(key).name
    known = machine.globals
    before = known.get(name)

    def take_back() -> None:
        if before is None:
            known.pop(name, None)
        else:
            known[name] = before

    machine.trail_call(take_back)
    known[name] = deref(value)
    return True


@det("nb_getval", 2)
@det("b_getval", 2)
def getval(machine: Caller, key: Term, value: Term) -> bool:
    name = atom(key)
    found = machine.globals.get(name.name)
    if found is None:
        raise existence_error("variable", name)
    return machine.unify(value, found)


@nondet("nb_current", 2)
def nb_current(machine: Caller, key: Term, value: Term) -> Iterator[bool | None]:
    """Enumerate the global variables and their values."""
    for name, known in list(machine.globals.items()):
        if attempt(machine, Struct("-", (key, value)), Struct("-", (Atom(name), known))):
            yield None
