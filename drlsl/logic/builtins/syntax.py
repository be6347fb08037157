"""Predicates that change how text is read: operators, flags and the conversion of characters.

Source: ISO 13211-1 8.14.3 to 8.14.6 and 8.17 with Cor.2.
"""

from __future__ import annotations

from collections.abc import Iterator

from drlsl.logic.builtins.arguments import attempt, prefix
from drlsl.logic.core import Caller, det, nondet
from drlsl.logic.errors import domain_error, instantiation_error, permission_error, type_error
from drlsl.logic.terms import NIL, SPECIFIERS, Atom, Operators, Struct, Term, Var, deref

_HIGHEST = 1200
_LOWEST_BAR = 1001


@det("op", 3)
def op(machine: Caller, priority: Term, specifier: Term, names: Term) -> bool:
    """Define operators, or with priority 0 remove them. Source: ISO 13211-1 8.14.3."""
    level, kind, atoms = _check_op(machine, deref(priority), deref(specifier), deref(names))
    for name in atoms:
        _check_operator(machine.operators, level, kind, name)
    for name in atoms:
        machine.operators.add(level, kind, name)
    return True


def _check_op(machine: Caller, priority: Term, specifier: Term, names: Term) -> tuple[int, str, list[str]]:
    """Return the arguments of op/3 after the standard's checks, in its order."""
    if isinstance(priority, Var) or isinstance(specifier, Var) or isinstance(names, Var):
        raise instantiation_error()
    elements, tail = (
        ([names], NIL) if isinstance(names, Atom) and names is not NIL else prefix(names, machine)
    )
    elements = [deref(element) for element in elements]
    if isinstance(tail, Var) or any(isinstance(element, Var) for element in elements):
        raise instantiation_error()
    if not isinstance(priority, int):
        raise type_error("integer", priority)
    if not isinstance(specifier, Atom):
        raise type_error("atom", specifier)
    if tail is not NIL:
        raise type_error("list", names)
    atoms: list[str] = []
    for element in elements:
        if not isinstance(element, Atom):
            raise type_error("atom", element)
        atoms.append(element.name)
    if not 0 <= priority <= _HIGHEST:
        raise domain_error("operator_priority", priority)
    if specifier.name not in SPECIFIERS:
        raise domain_error("operator_specifier", specifier)
    return priority, specifier.name, atoms


def _check_operator(operators: Operators, priority: int, specifier: str, name: str) -> None:
    """Refuse an operator that would make the syntax ambiguous. Source: 6.3.4.3, 8.14.3.3 with Cor.2."""
    infix = len(specifier) == 3
    if name == ",":
        raise permission_error("modify", "operator", Atom(name))
    if name in ("[]", "{}"):
        raise permission_error("create", "operator", Atom(name))
    if name == "|" and (not infix or 0 < priority < _LOWEST_BAR):
        raise permission_error("create", "operator", Atom(name))
    postfix = specifier in ("xf", "yf")
    if priority and ((infix and name in operators.postfix) or (postfix and name in operators.infix)):
        raise permission_error("create", "operator", Atom(name))


@nondet("current_op", 3)
def current_op(machine: Caller, priority: Term, specifier: Term, name: Term) -> Iterator[None]:
    """Source: ISO 13211-1 8.14.4."""
    level, kind, atom = deref(priority), deref(specifier), deref(name)
    if not isinstance(level, Var) and not (isinstance(level, int) and 0 <= level <= _HIGHEST):
        raise domain_error("operator_priority", level)
    if not isinstance(kind, Var) and not (isinstance(kind, Atom) and kind.name in SPECIFIERS):
        raise domain_error("operator_specifier", kind)
    if not isinstance(atom, (Var, Atom)):
        raise type_error("atom", atom)
    pattern = Struct("op", (level, kind, atom))
    for found_level, found_kind, found_name in machine.operators.entries():
        if isinstance(atom, Atom) and atom.name != found_name:
            continue
        if attempt(machine, pattern, Struct("op", (found_level, Atom(found_kind), Atom(found_name)))):
            yield


@det("set_prolog_flag", 2)
def set_prolog_flag(machine: Caller, flag: Term, value: Term) -> bool:
    """Source: ISO 13211-1 8.17.1."""
    machine.flags.set(flag, value)
    return True


@nondet("current_prolog_flag", 2)
def current_prolog_flag(machine: Caller, flag: Term, value: Term) -> Iterator[None]:
    """Source: ISO 13211-1 8.17.2."""
    flag = deref(flag)
    if not isinstance(flag, (Var, Atom)):
        raise type_error("atom", flag)
    if isinstance(flag, Atom):
        known = machine.flags.get(flag.name)
        if known is None and machine.flags.iso:
            raise domain_error("prolog_flag", flag)
        if known is not None and machine.unify(value, known):
            yield
        return
    for name, current in machine.flags.items():
        if attempt(machine, Struct("-", (flag, value)), Struct("-", (Atom(name), current))):
            yield


def _character(term: Term) -> Atom:
    term = deref(term)
    if isinstance(term, Var):
        raise instantiation_error()
    if isinstance(term, Atom) and len(term.name) == 1:
        return term
    raise type_error("character", term)


@det("char_conversion", 2)
def char_conversion(machine: Caller, given: Term, wanted: Term) -> bool:
    """Remember a conversion of unquoted characters. Source: ISO 13211-1 8.14.5."""
    source, target = _character(given), _character(wanted)
    machine.flags.conversions[source.name] = target.name
    return True


@nondet("current_char_conversion", 2)
def current_char_conversion(machine: Caller, given: Term, wanted: Term) -> Iterator[None]:
    """Source: ISO 13211-1 8.14.6."""
    for term in (given, wanted):
        if not isinstance(deref(term), Var):
            _character(term)
    table = machine.flags.conversions
    known = deref(given)
    sources = [known.name] if isinstance(known, Atom) else [*map(chr, range(_ASCII)), *table]
    pattern = Struct("-", (given, wanted))
    for source in dict.fromkeys(sources):
        if attempt(machine, pattern, Struct("-", (Atom(source), Atom(table.get(source, source))))):
            yield


_ASCII = 128
