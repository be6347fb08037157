"""Arithmetic: evaluable functors over unbounded integers and floats.

Source: ISO 13211-1, 9, with Cor.2. What each functor computes stands in `operations`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from drlsl.logic.core.checked_functions import Number
from drlsl.logic.core.operations import BINARY, OPERATIONS, UNARY
from drlsl.logic.errors import instantiation_error, type_error
from drlsl.logic.terms import NIL, Atom, CyclicTerm, Struct, Term, Var, deref, is_acyclic

if TYPE_CHECKING:
    from drlsl.logic.core.builtin_table import Caller

_NESTED: Final = 150
_FEW_NESTED: Final = 8
_STEPS_OF_OPERATION: Final = 3
# After this many steps, a long walk checks once that the term is finite.
_LONG: Final = 10_000


def evaluate(term: Term, machine: Caller, nested: int = 0) -> Number:
    """Return the value of an arithmetic expression.

    Raises:
        InstantiationError: A variable in it is unbound.
        PrologTypeError: Something in it is not evaluable, or of the wrong type.
        EvaluationError: It is undefined. Source: ISO 13211-1, 9.1.4.
    """
    while True:
        kind = type(term)
        if kind is int or kind is float:
            return term  # type: ignore[return-value]  # kind says so
        if kind is Var:
            term = deref(term)
            if type(term) is Var:
                raise instantiation_error()
            continue
        break
    if kind is not Struct:
        return _evaluate_constant(term, machine)
    assert type(term) is Struct
    if nested > _FEW_NESTED:
        # Shared parts are evaluated each time: a term of a few cells may take long.
        machine.meter.spend(_STEPS_OF_OPERATION)
        if nested > _NESTED:
            return _evaluate_deep(term, machine)
    args = term.args
    if len(args) == 2:
        binary = BINARY.get(term.name)
        if binary is not None:
            left = args[0]
            if type(left) is not int:
                left = evaluate(left, machine, nested + 1)
            right = args[1]
            if type(right) is not int:
                right = evaluate(right, machine, nested + 1)
            return binary(left, right, machine)
    elif len(args) == 1:
        unary = UNARY.get(term.name)
        if unary is not None:
            return unary(evaluate(args[0], machine, nested + 1), machine)
    return _evaluate_rare(term, [], machine, nested)


def _evaluate_rare(term: Struct, values: list[Number], machine: Caller, nested: int) -> Number:
    """Return the value of an unusual functor; `values` holds the arguments' values if they are known."""
    name, arity = term.name, len(term.args)
    if name == "." and arity == 2 and deref(term.args[1]) is NIL:
        char = deref(term.args[0])
        if type(char) is Atom and len(char.name) == 1 and not machine.flags.iso:
            return ord(char.name)
        return values[0] if values else evaluate(term.args[0], machine, nested + 1)
    row = OPERATIONS.get((name, arity))
    if row is not None:
        given = values or [evaluate(arg, machine, nested + 1) for arg in term.args]
        return row.evaluate(*given, machine)
    raise type_error("evaluable", Struct("/", (Atom(name), arity)))


def _evaluate_deep(root: Struct, machine: Caller) -> Number:
    """Evaluate with an explicit stack, for expressions nested deeper than Python's.

    Raises:
        CyclicTerm: The expression is infinite.
    """
    values: list[Number] = []
    todo: list[tuple[Term, bool]] = [(root, False)]
    steps = 0
    while todo:
        steps += 1
        machine.meter.spend(_STEPS_OF_OPERATION)
        if steps == _LONG and not is_acyclic(root):
            raise CyclicTerm("the expression contains itself")
        term, ready = todo.pop()
        term = deref(term)
        if type(term) is not Struct:
            values.append(evaluate(term, machine))
            continue
        arity = len(term.args)
        if not ready:
            is_list = term.name == "." and arity == 2 and deref(term.args[1]) is NIL
            todo.append((term, True))
            todo.extend((arg, False) for arg in reversed(term.args[:1] if is_list else term.args))
            continue
        if term.name == "." and arity == 2:
            continue
        args = values[-arity:]
        del values[-arity:]
        if arity == 2 and term.name in BINARY:
            values.append(BINARY[term.name](args[0], args[1], machine))
        elif arity == 1 and term.name in UNARY:
            values.append(UNARY[term.name](args[0], machine))
        else:
            values.append(_evaluate_rare(term, args, machine, 0))
    return values[0]


def _evaluate_constant(term: Term, machine: Caller) -> Number:
    if type(term) is Atom:
        row = OPERATIONS.get((term.name, 0))
        if row is not None:
            return row.evaluate(machine)
        raise type_error("evaluable", Struct("/", (term, 0)))
    if type(term) is str and len(term) == 1:
        return ord(term)
    raise type_error("evaluable", term)
