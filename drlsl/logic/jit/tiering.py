"""Decide when to compile a predicate: once the plain solver has spent on it the time of compiling.

Then it takes at most about twice the time of the better choice, however often the predicate is called.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from functools import partial
from typing import Any, Final

from drlsl.logic.core import Clause, Machine, Predicate, Resolver, Task, interpret, try_all
from drlsl.logic.errors import PrologError
from drlsl.logic.terms import Struct, deref

PATIENCE: Final = 8.0
"""Calls by the plain solver after which compiling one node of a clause's term pays for itself."""

# Compiling takes at least the time of this number of nodes, so smaller predicates are not measured.
_SMALL: Final = 64
# Importing the compiler takes the time of compiling this number of nodes.
_LOADING: Final = 1000
_MOST_CLAUSES: Final = 40
_LARGEST_CLAUSE: Final = 10_000
_DEEPEST_CLAUSE: Final = 60
# A smaller clause is soon done with; its next call may find its predicate compiled.
_LARGE: Final = 100
# The cost of a return to a clause, as a part of the cost of a call.
_REST: Final = 0.15

_COMPILER: Final = "drlsl.logic.jit.predicate"
_unpaid = PATIENCE * _LOADING
"""Calls by the plain solver that have yet to be made before the compiler is imported."""


def cold_entry(linker: Resolver, predicate: Predicate) -> Any:
    """Return the function that calls a predicate without code, once its cold calls are used up."""
    # Undefined predicates are left to the plain solver, which reports the place of the call.
    predicate.cold = int(PATIENCE * _SMALL) if predicate.defined else sys.maxsize
    cold = partial(_call_cold, linker, predicate, measured=False)
    if predicate.tabled is None:
        return cold
    predicate.clauses_entry = cold
    return partial(_call_tabled, predicate)


def _call_cold(
    linker: Resolver, predicate: Predicate, machine: Machine, task: Task, *, measured: bool
) -> Task:
    """Call the predicate by the plain solver; compile it once it has been called often enough.

    Compiled code comes here with every call, the plain solver only when no cold calls are left.
    """
    if predicate.cold:
        predicate.cold -= 1
    elif not measured:
        predicate.cold = int(PATIENCE * max(0, _size(predicate) - _SMALL))
        again: Task = _settle(predicate, partial(_call_cold, linker, predicate, measured=True))(machine, task)
        return again
    elif _is_loading_due(predicate):
        entry = _compile(linker, predicate)
        _settle(predicate, entry or partial(_call_plain, predicate))
        if entry is not None:
            compiled: Task = entry(machine, task)
            return compiled
        predicate.cold = sys.maxsize
    return _call_plain(predicate, machine, task)


def _is_loading_due(predicate: Predicate) -> bool:
    """Return whether the compiler is loaded, or the calls of all such predicates pay for that as well."""
    global _unpaid
    if _unpaid <= 0 or _COMPILER in sys.modules:
        return True
    predicate.cold = int(PATIENCE * _size(predicate))
    _unpaid -= predicate.cold
    return not predicate.cold


def _settle(predicate: Predicate, entry: Any) -> Any:
    """Have the clauses of a predicate run by a function."""
    if predicate.tabled is None:
        predicate.entry = entry
    else:
        predicate.clauses_entry = entry
    return entry


def _call_plain(predicate: Predicate, machine: Machine, task: Task) -> Task:
    return try_all(machine, predicate, [deref(arg) for arg in task[3:-1]], task[-1])


def _call_tabled(predicate: Predicate, machine: Machine, task: Task) -> Task:
    return interpret(machine, predicate, [deref(arg) for arg in task[3:-1]], task[-1])


class _Unbound:
    """Calls a compiled predicate with an unbound first argument, for which it has no code at first."""

    __slots__ = ("_code", "_left", "_linker", "_predicate", "entry")

    def __init__(self, linker: Resolver, predicate: Predicate) -> None:
        self.entry: Any = None  # the code that comes here
        self._linker = linker
        self._predicate = predicate
        self._left = int(PATIENCE * _size(predicate))
        self._code: Any = None

    def __call__(self, machine: Machine, task: Task) -> Task:
        # Such a call tries every clause sooner or later.
        self._left -= len(self._predicate)
        if self._left >= 0:
            return _call_plain(self._predicate, machine, task)
        if self._code is None:
            from drlsl.logic.jit.predicate import compile_predicate

            self._code = compile_predicate(self._predicate, self._linker)
            predicate = self._predicate
            if self.entry is (predicate.entry if predicate.tabled is None else predicate.clauses_entry):
                _settle(predicate, self._code)
        compiled: Task = self._code(machine, task)
        return compiled


def settle_rest(linker: Resolver, clause: Clause) -> None:
    """Measure a clause that the plain solver often returns to; the second time, compile its body.

    A main clause is called once and then searched by backtracking, so compiling its predicate is too late.
    """
    code = clause.code
    if clause.predicate.dynamic or not _is_modest(clause):
        return
    if not code.measured:
        code.measured = True
        size = _size_of([clause])
        if size >= _LARGE:
            code.patience = max(1, int(PATIENCE * _REST * size))
        return
    from drlsl.logic.jit.resumption import compile_rest

    try:
        compile_rest(clause, linker)
    except (PrologError, RecursionError, SyntaxError):
        return


def _size(predicate: Predicate) -> int:
    """Return the number of nodes in the terms of a predicate's clauses; 0 if it will not be compiled."""
    return _size_of(predicate.clauses) if _is_compilable(predicate) else 0


def _size_of(clauses: Iterable[Clause]) -> int:
    size = 0
    for clause in clauses:
        todo = [clause.head, clause.body]
        while todo:
            term = deref(todo.pop())
            size += 1
            if type(term) is Struct:
                todo.extend(term.args)
    return size


def _is_compilable(predicate: Predicate) -> bool:
    return not predicate.dynamic and predicate.rows is None and 0 < len(predicate) <= _MOST_CLAUSES


def _is_modest(clause: Clause) -> bool:
    """Return whether a clause is small enough to be compiled: long functions take Python long."""
    left = _LARGEST_CLAUSE
    todo = [(clause.head, 0), (clause.body, 0)]
    while todo:
        term, depth = todo.pop()
        term = deref(term)
        left -= 1
        if not left or depth > _DEEPEST_CLAUSE:
            return False
        if type(term) is Struct:
            # The depth of a conjunction or a list is that of its elements.
            is_chain = len(term.args) == 2 and term.name in (",", ".")
            todo.extend((arg, depth + 1) for arg in term.args[:-1])
            todo.append((term.args[-1], depth if is_chain else depth + 1))
    return True


def _compile(linker: Resolver, predicate: Predicate) -> Any:
    """Return the compiled entry point, or None for a predicate that stays with the plain solver."""
    if not _is_compilable(predicate) or not all(map(_is_modest, predicate.clauses)):
        return None
    # Imported late: short programs need no compiler.
    from drlsl.logic.jit.predicate import compile_predicate

    try:
        unbound = _Unbound(linker, predicate)
        unbound.entry = compile_predicate(predicate, linker, unbound)
        return unbound.entry
    except (PrologError, RecursionError, SyntaxError):
        # A body that is not a goal is an error only once it is reached, as in the plain solver; and
        # Python limits the nesting of code.
        return None
