"""Clauses that are chosen by tests: after the test of one, the others need no choice point.

This is impossible for ``max(X, Y, X) :- ...``, whose head may bind. But if a head only names its arguments,
tests at the beginning of the body depend only on the call's arguments, and so do those of later clauses: if
``X =< Y`` holds for one, ``X > Y`` fails for the other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from drlsl.logic.core import Call, Clause, Cut, Goal, index_key, steps
from drlsl.logic.terms import Struct, Term, Var, deref

# The tests that cannot hold if a test holds.
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


class Guard(NamedTuple):
    """The tests that a clause begins with, and the goals behind them."""

    tests: Sequence[Goal]
    goals: Sequence[Goal]


def guard_of(
    clauses: Sequence[Clause], bodies: Sequence[Goal], is_test: Callable[[Goal], bool]
) -> Guard | None:
    """Return the first tests of a clause, and the goals after them, if the tests exclude the later clauses.

    `is_test` returns whether a goal surely binds nothing. A cut right after the tests is dropped: it has
    nothing to remove. If it is the first goal, there are no tests, and the clause excludes all later ones.
    """
    names = [deref(arg) for arg in clauses[0].args]
    if any(type(name) is not Var for name in names) or len(set(names)) < len(names):
        return None
    goals = steps(bodies[0])
    count = next((at for at, goal in enumerate(goals) if not is_test(goal)), len(goals))
    tests = goals[:count]
    if count < len(goals) and type(goals[count]) is Cut:
        return Guard(tests, goals[count + 1 :])
    for other, body in zip(clauses[1:], bodies[1:], strict=True):
        against = steps(body)[0]
        if not any(_excludes(clauses[0], test, other, against) for test in tests):
            return None
    return Guard(tests, goals[count:])


def _excludes(clause: Clause, test: Goal, other: Clause, against: Goal) -> bool:
    """Return whether another clause begins with a test that fails whenever this test of a clause holds."""
    if type(test) is not Call or type(against) is not Call:
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
    """Return a key for a test's argument or constant, equal in both clauses; None for other terms."""
    term = deref(term)
    if type(term) is Var:
        return next((at for at, arg in enumerate(clause.args) if deref(arg) is term), None)
    return None if type(term) is Struct else ("constant", index_key(term))
