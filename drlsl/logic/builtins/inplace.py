"""Arithmetic of the plain solver: evaluated from the patterns of a clause, without building terms."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, TypeAlias

from drlsl.logic.core import (
    BINARY,
    COMPARISONS,
    DET_BUILTINS,
    UNARY,
    DeepPattern,
    Local,
    Number,
    Pattern,
    build,
    evaluate,
    of_one_type,
    unify,
)
from drlsl.logic.terms import Var

Frame: TypeAlias = list[Any]
InPlace: TypeAlias = Callable[[Any, tuple[Any, ...], Frame], bool]


def value_of(part: Any, frame: Frame, machine: Any) -> Number:
    """Return the value of an expression of a clause, with the same errors as `evaluate`."""
    kind = type(part)
    if kind is int:
        return part  # type: ignore[no-any-return]  # kind says so
    if kind is Local:
        term = frame[part.index]
        while type(term) is Var:
            ref = term.ref
            if ref is None:
                break
            term = ref
        if type(term) is int:
            return term
        return evaluate(Var() if term is None else term, machine)
    if kind is Pattern:
        args = part.args
        if len(args) == 2:
            binary = BINARY.get(part.name)
            if binary is not None:
                return binary(value_of(args[0], frame, machine), value_of(args[1], frame, machine), machine)
        elif len(args) == 1:
            unary = UNARY.get(part.name)
            if unary is not None:
                return unary(value_of(args[0], frame, machine), machine)
    if kind is Pattern or kind is DeepPattern:
        return evaluate(build(part, frame), machine)
    return evaluate(part, machine)


def _is(machine: Any, parts: tuple[Any, ...], frame: Frame) -> bool:
    value = value_of(parts[1], frame, machine)
    result = parts[0]
    if type(result) is Local:
        term = frame[result.index]
        if term is None:
            term = frame[result.index] = Var()
        if type(term) is Var and term.ref is None:
            term.ref = value
            machine.trail.append(term)
            return True
        return unify(term, value, machine.trail)
    if isinstance(result, Pattern):
        result = build(result, frame)
    return unify(result, value, machine.trail)


def _comparison(holds: Callable[[Any, Any], bool]) -> InPlace:
    def compare(machine: Any, parts: tuple[Any, ...], frame: Frame) -> bool:
        left, right = value_of(parts[0], frame, machine), value_of(parts[1], frame, machine)
        if type(left) is not type(right):
            left, right = of_one_type(left, right)
        return holds(left, right)

    return compare


ARITHMETIC: Final[dict[Any, InPlace]] = {
    DET_BUILTINS["is", 2]: _is,
    **{DET_BUILTINS[name, 2]: _comparison(row.holds) for name, row in COMPARISONS.items()},
}
"""Deterministic builtins that need no terms, as functions of a clause's frame."""
