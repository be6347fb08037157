"""Type tests, and predicates that take terms apart and put them together."""

from __future__ import annotations

from collections.abc import Iterator

from drlsl.logic.builtins.arguments import attempt, check_partial_list, integer, items, not_negative, prefix
from drlsl.logic.core import Caller, copy_term, det, is_ground, nondet, quick, subsumes, term_variables
from drlsl.logic.errors import domain_error, instantiation_error, representation_error, type_error
from drlsl.logic.terms import NIL, Atom, Struct, Term, Var, deref, is_acyclic, make_list

# The most arguments that functor/3 gives a term, to protect the memory.
_MOST_ARGUMENTS = 1 << 24


def _declare_test(name: str, *kinds: type) -> None:
    accepted = frozenset(kinds)

    @det(name, 1)
    def test(_machine: Caller, term: Term) -> bool:
        return type(deref(term)) in accepted


_declare_test("var", Var)
_declare_test("nonvar", Atom, Struct, int, float, str)
_declare_test("atom", Atom)
_declare_test("number", int, float)
_declare_test("integer", int)
_declare_test("float", float)
_declare_test("rational", int)
_declare_test("atomic", Atom, int, float, str)
_declare_test("compound", Struct)
_declare_test("callable", Atom, Struct)
_declare_test("string", str)


@det("is_list", 1)
def is_list(machine: Caller, term: Term) -> bool:
    return prefix(term, machine)[1] is NIL


@det("acyclic_term", 1)
def acyclic_term(_machine: Caller, term: Term) -> bool:
    """Source: ISO 13211-1 Cor.2, 8.3.11."""
    return is_acyclic(term)


@det("cyclic_term", 1)
def cyclic_term(_machine: Caller, term: Term) -> bool:
    return not is_acyclic(term)


@det("ground", 1)
def ground(machine: Caller, term: Term) -> bool:
    return is_ground(term, machine.meter)


@det("functor", 3)
def functor(machine: Caller, term: Term, name: Term, arity: Term) -> bool:
    """Source: ISO 13211-1, 8.5.1."""
    term = deref(term)
    if type(term) is Struct:
        return machine.unify(name, Atom(term.name)) and machine.unify(arity, len(term.args))
    if type(term) is not Var:
        return machine.unify(name, term) and machine.unify(arity, 0)
    name, arity = deref(name), deref(arity)
    if type(name) is Var or type(arity) is Var:
        raise instantiation_error()
    if type(arity) is not int:
        raise type_error("integer", arity)
    if arity < 0:
        raise domain_error("not_less_than_zero", arity)
    if arity > _MOST_ARGUMENTS:
        raise representation_error("max_arity")
    if arity == 0:
        if type(name) is Struct:
            raise type_error("atomic", name)
        return machine.unify(term, name)
    if type(name) is Struct:
        raise type_error("atomic", name)
    if type(name) is not Atom:
        raise type_error("atom" if machine.flags.iso else "callable", name)
    machine.meter.make(arity)
    return machine.unify(term, Struct(name.name, tuple([Var() for _ in range(arity)])))


@nondet("arg", 3)
def arg(machine: Caller, position: Term, term: Term, value: Term) -> Iterator[bool | None]:
    """Source: ISO 13211-1, 8.5.2; with the flag `iso` off, a variable enumerates the positions."""
    position, term = deref(position), deref(term)
    if type(position) is Var and machine.flags.iso:
        raise instantiation_error()
    if type(term) is not Struct:
        raise instantiation_error() if type(term) is Var else type_error("compound", term)
    args = term.args
    if type(position) is Var:
        for index, found in enumerate(args, 1):
            machine.meter.spend(1)
            if attempt(machine, found, value):
                machine.unify(position, index)
                yield index == len(args)
        return
    if 1 <= not_negative(position) <= len(args) and machine.unify(args[integer(position) - 1], value):
        yield True


@quick(arg)
def _arg_at(machine: Caller, position: Term, term: Term, value: Term) -> bool | None:
    """Unify with the argument at a known position."""
    position, term = deref(position), deref(term)
    if type(position) is not int or type(term) is not Struct or position < 0:
        return None
    if not 0 < position <= len(term.args):
        return False
    found = term.args[position - 1]
    if type(value) is Var and value.ref is None and type(found) is not Var:
        value.ref = found
        machine.trail.append(value)
        return True
    return machine.unify(found, value)


@det("=..", 2)
def univ(machine: Caller, term: Term, parts: Term) -> bool:
    """Source: ISO 13211-1, 8.5.3."""
    term = deref(term)
    if type(term) is Struct:
        machine.meter.make(len(term.args))
        return machine.unify(parts, make_list((Atom(term.name), *term.args)))
    if type(term) is not Var:
        check_partial_list(parts)
        return machine.unify(parts, make_list([term]))
    elements = items(parts, machine)
    if not elements:
        raise domain_error("non_empty_list", NIL)
    name = deref(elements[0])
    if type(name) is Var:
        raise instantiation_error()
    if len(elements) == 1:
        if type(name) is Struct:
            raise type_error("atomic", name)
        return machine.unify(term, name)
    if type(name) is not Atom:
        raise type_error("atom" if machine.flags.iso else "callable", name)
    return machine.unify(term, Struct(name.name, tuple(elements[1:])))


@det("copy_term", 2)
def copy(machine: Caller, term: Term, twin: Term) -> bool:
    """Source: ISO 13211-1, 8.5.4."""
    return machine.unify(twin, copy_term(term, meter=machine.meter))


@det("term_variables", 2)
def variables(machine: Caller, term: Term, found: Term) -> bool:
    """Source: ISO 13211-1, 8.5.5."""
    if machine.flags.iso:
        check_partial_list(found)
    return machine.unify(found, make_list(term_variables(term, machine.meter)))


@det("term_variables", 3)
def variables_with_tail(machine: Caller, term: Term, found: Term, tail: Term) -> bool:
    return machine.unify(found, make_list(term_variables(term, machine.meter), tail))


@det("subsumes_term", 2)
def subsumes_term(machine: Caller, general: Term, specific: Term) -> bool:
    """Source: ISO 13211-1, 8.2.4."""
    return subsumes(general, specific, machine.meter)
