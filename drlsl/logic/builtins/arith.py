"""Arithmetic evaluation and comparison as predicates."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from drlsl.logic.builtins.arguments import integer
from drlsl.logic.core import COMPARISONS, Caller, det, evaluate, generator, of_one_type
from drlsl.logic.errors import domain_error, instantiation_error, type_error
from drlsl.logic.terms import Struct, Term, Var, deref


@det("is", 2)
def is_(machine: Caller, result: Term, expression: Term) -> bool:
    """Source: ISO 13211-1, 8.6.1."""
    value = evaluate(expression, machine)
    if type(result) is Var and result.ref is None:
        return machine.unify(result, value)
    result = deref(result)
    return machine.unify(result, value)


def _declare_comparison(name: str, holds: Callable[[Any, Any], bool]) -> None:
    @det(name, 2)
    def comparison(machine: Caller, left: Term, right: Term) -> bool:
        """Source: ISO 13211-1, 8.7.1."""
        return holds(*of_one_type(evaluate(left, machine), evaluate(right, machine)))


for _name, _row in COMPARISONS.items():
    _declare_comparison(_name, _row.holds)


@det("succ", 2)
def succ(machine: Caller, low: Term, high: Term) -> bool:
    """Relate a natural number and its successor, either way."""
    low, high = deref(low), deref(high)
    if type(low) is Var:
        if type(high) is Var:
            raise instantiation_error()
        value = _natural(high)
        return value > 0 and machine.unify(low, value - 1)
    value = _natural(low)
    if type(high) is not Var:
        _natural(high)
    return machine.unify(high, value + 1)


def _natural(term: Term) -> int:
    value = integer(term)
    if value < 0:
        raise type_error("not_less_than_zero", value)
    return value


@det("plus", 3)
def plus(machine: Caller, left: Term, right: Term, total: Term) -> bool:
    """Relate integers with ``left + right =:= total``, of which at most one is unknown."""
    if type(deref(total)) is Var:
        return machine.unify(total, integer(left) + integer(right))
    if type(deref(right)) is Var:
        return machine.unify(right, integer(total) - integer(left))
    return machine.unify(left, integer(total) - integer(right))


@det("set_random", 1)
def set_random(machine: Caller, option: Term) -> bool:
    """Make the engine's random numbers repeatable, by ``seed(S)``."""
    option = deref(option)
    if type(option) is Var:
        raise instantiation_error()
    if type(option) is not Struct or option.name != "seed" or len(option.args) != 1:
        raise domain_error("set_random_option", option)
    generator(machine).seed(integer(option.args[0]))
    return True


@det("random", 1)
def random(machine: Caller, value: Term) -> bool:
    """Unify with a random float in (0, 1)."""
    return machine.unify(value, generator(machine).random())


@det("random_between", 3)
def random_between(machine: Caller, low: Term, high: Term, value: Term) -> bool:
    """Unify with a random integer between two bounds, both included."""
    first, last = integer(low), integer(high)
    return first <= last and machine.unify(value, generator(machine).randint(first, last))
