"""Checks of arguments, clocks and other predicates that SWI-Prolog programs rely on."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final

from drlsl.logic.builtins.arguments import atom, integer, items, prefix
from drlsl.logic.builtins.text import any_text, is_character, is_code
from drlsl.logic.core import Caller, check_division, compare, copy_term, det, term_variables
from drlsl.logic.errors import (
    DomainError,
    InstantiationError,
    PrologError,
    PrologTypeError,
    domain_error,
    error_from_term,
    evaluation_error,
    existence_error,
    instantiation_error,
    type_error,
)
from drlsl.logic.terms import NIL, Atom, Struct, Term, Var, deref, make_list

_TYPES: Final[dict[str, Callable[[Term], bool]]] = {
    "any": lambda term: True,
    "atom": lambda term: isinstance(term, Atom),
    "atomic": lambda term: not isinstance(term, Struct),
    "boolean": lambda term: isinstance(term, Atom) and term.name in ("true", "false"),
    "bool": lambda term: isinstance(term, Atom) and term.name in ("true", "false"),
    "callable": lambda term: isinstance(term, (Atom, Struct)),
    "char": is_character,
    "code": is_code,
    "compound": lambda term: isinstance(term, Struct),
    "float": lambda term: isinstance(term, float),
    "integer": lambda term: isinstance(term, int),
    "number": lambda term: isinstance(term, (int, float)),
    "string": lambda term: isinstance(term, str),
    "symbol": lambda term: isinstance(term, Atom),
    "text": lambda term: any_text(term) is not None,
}
_TAILS: Final[dict[str, Callable[[Term], bool]]] = {
    "list": lambda tail: tail is NIL,
    "proper_list": lambda tail: tail is NIL,
    "list_or_partial": lambda tail: tail is NIL or isinstance(tail, Var),
}
"""The types of lists, by what the tail may be."""

_LEAST: Final = {"nonneg": 0, "positive_integer": 1}


@det("must_be", 2)
def must_be(machine: Caller, kind: Term, term: Term) -> bool:
    """Succeed if a term is of a type, else raise the appropriate error."""
    kind, term = deref(kind), deref(term)
    if isinstance(kind, Var):
        raise instantiation_error()
    if isinstance(kind, Struct):
        return _must_fit(machine, kind, term)
    name = kind.name if isinstance(kind, Atom) else ""
    if isinstance(term, Var) and name not in ("any", "list_or_partial"):
        raise instantiation_error()
    if name in _LEAST:
        if not isinstance(term, int):
            raise type_error("integer", term)
        if term < _LEAST[name]:
            raise type_error(name, term)
        return True
    if not _fits(machine, name, kind, term):
        raise type_error(name, term)
    return True


def _fits(machine: Caller, name: str, kind: Term, term: Term) -> bool:
    """Return whether a term is of a type; what walks through the whole term reports that to the meter."""
    if name == "ground":
        return not term_variables(term, machine.meter)
    if name in _TAILS:
        return _TAILS[name](prefix(term, machine)[1])
    if name not in _TYPES:
        raise existence_error("type", kind)
    return _TYPES[name](term)


def _must_fit(machine: Caller, kind: Struct, term: Term) -> bool:
    """Check oneof(List), between(Low, High), list(Type) and list_of(Type)."""
    if kind.name in ("list", "list_of") and len(kind.args) == 1:
        return all(must_be(machine, kind.args[0], element) for element in items(term, machine))
    if isinstance(term, Var):
        raise instantiation_error()
    if kind.name == "oneof" and len(kind.args) == 1:
        choices = items(kind.args[0], machine)
        if not any(compare(term, choice, meter=machine.meter) == 0 for choice in choices):
            raise _outside(kind, term)
        return True
    if kind.name == "between" and len(kind.args) == 2:
        low, high = (deref(bound) for bound in kind.args)
        if not isinstance(low, (int, float)) or not isinstance(high, (int, float)):
            raise type_error("number", low if not isinstance(low, (int, float)) else high)
        if not isinstance(term, (int, float)):
            raise type_error("integer" if isinstance(low, int) and isinstance(high, int) else "number", term)
        if not low <= term <= high:
            raise _outside(kind, term)
        return True
    raise existence_error("type", kind)


def _outside(domain: Struct, culprit: Term) -> PrologError:
    """Return a domain error whose domain is a compound term."""
    return error_from_term(Struct("error", (Struct("domain_error", (domain, culprit)), Var())))


@det("is_of_type", 2)
def is_of_type(machine: Caller, kind: Term, term: Term) -> bool:
    """Succeed if a term is of a type of must_be/2."""
    try:
        return must_be(machine, kind, term)
    except (InstantiationError, PrologTypeError, DomainError):
        return False


def _declare_error(name: str, arity: int) -> None:
    @det(name, arity)
    def raise_error(_machine: Caller, *args: Term) -> bool:
        formal = Struct(name, args) if name != "instantiation_error" else Atom(name)
        raise error_from_term(copy_term(Struct("error", (formal, Var()))))


# Source: SWI-Prolog's library(error).
for _name, _arity in (
    ("type_error", 2),
    ("domain_error", 2),
    ("existence_error", 2),
    ("permission_error", 3),
    ("instantiation_error", 1),
    ("representation_error", 1),
    ("resource_error", 1),
):
    _declare_error(_name, _arity)


@det("divmod", 4)
def divmod_(machine: Caller, dividend: Term, divisor: Term, quotient: Term, rest: Term) -> bool:
    """Unify with the quotient rounded down, and the remainder."""
    left, right = integer(dividend), integer(divisor)
    if right == 0:
        raise evaluation_error("zero_divisor")
    check_division(left, right, machine.meter)
    whole, left_over = divmod(left, right)
    return machine.unify(quotient, whole) and machine.unify(rest, left_over)


@det("statistics", 2)
def statistics(machine: Caller, key: Term, value: Term) -> bool:
    """Unify with times in ms, in total and since the last query of them; ``cputime`` in s."""
    name = atom(key).name
    if name in ("cputime", "process_cputime"):
        return machine.unify(value, time.process_time())
    clocks = {
        "runtime": time.process_time,
        "process_runtime": time.process_time,
        "walltime": time.monotonic,
        "real_time": time.time,
    }
    if name not in clocks:
        raise domain_error("statistics_key", Atom(name))
    now = clocks[name]() if name == "real_time" else 1000 * clocks[name]()
    before = machine.state.get(f"statistics {name}", now)
    machine.state[f"statistics {name}"] = now
    return machine.unify(value, make_list([round(now), round(now - before)]))


@det("get_time", 1)
def get_time(machine: Caller, now: Term) -> bool:
    return machine.unify(now, time.time())


@det("garbage_collect", 0)
def garbage_collect(_machine: Caller) -> bool:
    """Succeed: Python collects garbage by itself."""
    return True


@det("style_check", 1)
def style_check(_machine: Caller, _style: Term) -> bool:
    """Succeed: the loader always warns."""
    return True


@det("numbervars", 3)
def numbervars(machine: Caller, term: Term, start: Term, end: Term) -> bool:
    """Bind the variables of a term to ``'$VAR'(N)``."""
    number = integer(start)
    for variable in term_variables(term, machine.meter):
        machine.unify(variable, Struct("$VAR", (number,)))
        number += 1
    return machine.unify(end, number)


@det("numbervars", 1)
def numbervars_from_zero(machine: Caller, term: Term) -> bool:
    return numbervars(machine, term, 0, Var())
