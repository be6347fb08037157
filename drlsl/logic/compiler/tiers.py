"""When a predicate is compiled: after it has been called often enough to be worth it."""

from __future__ import annotations

from functools import partial
from typing import Any, Final

from drlsl.logic.errors import PrologError
from drlsl.logic.program import Predicate
from drlsl.logic.solver import Machine, Task, interpret
from drlsl.logic.terms import deref

# Compiling takes about as long as this many calls of the plain solver.
_WORTH_IT: Final = 100
_MOST_CLAUSES: Final = 40


def cold_entry(linker: Any, predicate: Predicate) -> Any:
    """The function that compiled code calls a predicate by before that is compiled itself."""
    predicate.calls = 0
    return partial(_call_cold, linker, predicate)


def _call_cold(linker: Any, predicate: Predicate, machine: Machine, task: Task) -> Task:
    """Call the predicate by the plain solver; at the last cold call, compile it."""
    predicate.calls += 1
    if predicate.calls > _WORTH_IT:
        entry = _compile(linker, predicate)
        if entry is not None:
            predicate.entry = entry
            compiled: Task = entry(machine, task)
            return compiled
        predicate.entry = partial(_call_plain, predicate)
    return interpret(machine, predicate, [deref(arg) for arg in task[3:-1]], task[-1])


def _call_plain(predicate: Predicate, machine: Machine, task: Task) -> Task:
    return interpret(machine, predicate, [deref(arg) for arg in task[3:-1]], task[-1])


def _compile(linker: Any, predicate: Predicate) -> Any:
    """The compiled entry point, or None for a predicate that stays with the plain solver."""
    if predicate.dynamic or predicate.rows is not None or not 0 < len(predicate) <= _MOST_CLAUSES:
        return None
    # Imported late: programs that run for a moment need no compiler.
    from drlsl.logic.compiler.predicate import compile_predicate

    try:
        return compile_predicate(predicate, linker)
    except PrologError:
        # A body that is no goal is an error only once it is reached, which the plain solver waits for.
        return None
