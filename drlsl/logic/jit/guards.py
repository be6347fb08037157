"""Clauses that tests choose: behind the test of one of them the others need not be left as a choice.

In ``max(X, Y, X) :- ...`` nothing of the kind can be said, since the head may bind. But where a head only
names its arguments, tests at the beginning of the body look at what the call was given, and so do those of
the clauses behind it: where ``X =< Y`` holds for one, ``X > Y`` fails for the other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from drlsl.logic.core import Clause, index_key
from drlsl.logic.jit.code_writer import conjuncts, is_atom
from drlsl.logic.terms import Struct, Term, Var, deref

# What cannot hold where a test does.
_EXCLUDED = {
    "<": (">=", ">", "=:=", "=="),
    ">": ("=<", "<", "=:=", "=="),
    "=<": (">",),
    ">=": ("<",),
    "=:=": ("=\\=", "<", ">"),
    "=\\=": ("=:=",),
    "==": ("\\==",),
    "\\==": ("==",),
    "var": ("nonvar",),
    "nonvar": ("var",),
}
_TURNED = {"<": ">", ">": "<", "=<": ">=", ">=": "=<"}

Guard = tuple[list[Term], list[Term]]


def guard_of(clause: Clause, later: Sequence[Clause], is_test: Callable[[Term], bool]) -> Guard | None:
    """The tests that a clause begins with, and the goals behind them, if the tests rule the later ones out.

    `is_test` tells whether a goal is sure to bind nothing. A cut behind the tests is left away: it has
    nothing to remove.
    """
    names = [deref(arg) for arg in clause.args]
    if any(type(name) is not Var for name in names) or len(set(names)) < len(names):
        return None
    goals = conjuncts(clause.body)
    count = next((at for at, goal in enumerate(goals) if not is_test(goal)), len(goals))
    tests = goals[:count]
    if tests and count < len(goals) and is_atom(goals[count], "!"):
        return tests, goals[count + 1 :]
    if all(any(_excludes(clause, test, other) for test in tests) for other in later):
        return tests, goals[count:]
    return None


def _excludes(clause: Clause, test: Term, other: Clause) -> bool:
    """Whether another clause begins with a test that fails wherever this test of a clause holds."""
    against = conjuncts(other.body)[0]
    if type(test) is not Struct or type(against) is not Struct:
        return False
    excluded = _EXCLUDED.get(test.name, ())
    ours = [_operand(arg, clause) for arg in test.args]
    theirs = [_operand(arg, other) for arg in against.args]
    if None in ours:
        return False
    if ours == theirs and against.name in excluded:
        return True
    return ours == theirs[::-1] and _TURNED.get(against.name, against.name) in excluded


def _operand(term: Term, clause: Clause) -> Any:
    """An argument or a constant that a test looks at, in words that two clauses share; None for any other."""
    term = deref(term)
    if type(term) is Var:
        return next((at for at, arg in enumerate(clause.args) if deref(arg) is term), None)
    return None if type(term) is Struct else ("constant", index_key(term))
