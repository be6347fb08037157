"""Building the arguments of a call, and unifying them with heads and facts, for the plain solver."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from drlsl.logic.core.body import DeepPattern, First, Local, Pattern, build
from drlsl.logic.core.unification import unify
from drlsl.logic.terms import Atom, Struct, Term, Var, deref


def arguments(parts: tuple[Any, ...], frame: list[Any]) -> list[Any]:
    """Return the arguments of a goal, dereferenced."""
    args = []
    for part in parts:
        kind = type(part)
        if kind is Local:
            term = frame[part.index]
            if term is None:
                term = frame[part.index] = Var()
            else:
                while type(term) is Var:
                    ref = term.ref
                    if ref is None:
                        break
                    term = ref
            args.append(term)
        elif kind is Pattern or kind is DeepPattern:
            args.append(build(part, frame))
        elif kind is Var:
            args.append(deref(part))
        else:
            args.append(part)
    return args


def match_row(row: tuple[Any, ...], args: Sequence[Any], trail: list[Any]) -> bool:
    """Unify atomic terms with arguments, one by one."""
    for value, arg in zip(row, args, strict=True):
        while type(arg) is Var:
            ref = arg.ref
            if ref is None:
                arg.ref = value
                trail.append(arg)
                break
            arg = ref
        else:
            if arg is not value and (type(arg) is not type(value) or arg != value):
                return False
    return True


def match(pattern: Pattern, term: Term, frame: list[Any], trail: list[Any]) -> bool:
    """Unify a pattern with a term."""
    while True:
        while type(term) is Var:
            ref = term.ref
            if ref is None:
                term.ref = build(pattern, frame)
                trail.append(term)
                return True
            term = ref
        if type(term) is not Struct or term.name != pattern.name:
            return False
        parts = pattern.args
        args = term.args
        if len(parts) != len(args):
            return False
        for part, arg in zip(parts, args):  # noqa: B905  (the lengths are equal, and strict costs time here)
            kind = type(part)
            if kind is First:
                while type(arg) is Var:
                    ref = arg.ref
                    if ref is None:
                        break
                    arg = ref
                frame[part.index] = arg
            elif kind is Pattern:
                if not match(part, arg, frame, trail):
                    return False
            elif kind is Local:
                known = frame[part.index]
                if known is not arg and not unify(known, arg, trail):
                    return False
            elif arg is not part:
                if type(arg) is Var and arg.ref is None:
                    arg.ref = part
                    trail.append(arg)
                elif (kind is Atom and type(arg) is Atom) or not unify(part, arg, trail):
                    return False
        return True
