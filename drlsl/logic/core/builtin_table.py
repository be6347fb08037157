"""The table of built-in predicates: pure functions of a machine and its arguments.

A builtin keeps no state of its own. All that it reads or changes belongs to the calling machine, so any
number of engines share this table.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, Protocol, TextIO, TypeAlias, TypeVar

if TYPE_CHECKING:
    from drlsl.logic.core.clauses import Program
    from drlsl.logic.limits import Meter
    from drlsl.logic.syntax import Flags
    from drlsl.logic.terms import Operators, Term


class Caller(Protocol):
    """The machine's interface for the builtins that it calls."""

    @property
    def meter(self) -> Meter:
        """The meter that long-running builtins report to."""

    @property
    def flags(self) -> Flags: ...

    @property
    def operators(self) -> Operators: ...

    @property
    def program(self) -> Program: ...

    @property
    def globals(self) -> dict[str, Term]:
        """The engine's global variables (``nb_setval/2``, ``b_setval/2``)."""

    @property
    def state(self) -> dict[str, Any]:
        """The state of builtin modules for each engine: open streams, random generators."""

    output: TextIO
    trail: list[Any]
    """The bindings that backtracking must undo."""

    def unify(self, left: Term, right: Term) -> bool:
        """Make two terms equal, recording each binding on the trail; return True if that is possible."""

    def trail_call(self, undo: Callable[[], None]) -> None:
        """Have `undo` called when execution backtracks beyond this point."""


Det: TypeAlias = Callable[..., bool]
Nondet: TypeAlias = Callable[..., Iterator[bool | None]]
_D = TypeVar("_D", bound=Det)
_N = TypeVar("_N", bound=Nondet)
_Q = TypeVar("_Q", bound=Callable[..., bool | None])
# A control construct: a function of the machine, the arguments and the continuation that returns the next
# task.
Control: TypeAlias = Callable[[Any, Any, Any], Any]
_C = TypeVar("_C", bound=Control)
Indicator: TypeAlias = tuple[str, int]

# Filled while the modules of this package are imported and never changed after.
DET_BUILTINS: dict[Indicator, Det] = {}
NONDET_BUILTINS: dict[Indicator, Nondet] = {}
CONTROL_BUILTINS: dict[Indicator, Control] = {}
# For some nondeterministic builtins: functions that decide the usual calls, with at most one solution.
QUICK: dict[Nondet, Callable[..., bool | None]] = {}


def is_builtin(name: str, arity: int) -> bool:
    """Return whether the engine itself provides a predicate, which no program may change."""
    return any((name, arity) in table for table in (DET_BUILTINS, NONDET_BUILTINS, CONTROL_BUILTINS))


def builtin_indicators() -> set[Indicator]:
    """Return name and arity of every built-in predicate and control construct."""
    return {*DET_BUILTINS, *NONDET_BUILTINS, *CONTROL_BUILTINS}


def det(name: str, arity: int) -> Callable[[_D], _D]:
    """Declare a deterministic builtin: ``f(machine, *args) -> bool``; the arguments are not dereferenced.

    False is failure; the solver undoes the function's bindings.
    """

    def register(function: _D) -> _D:
        DET_BUILTINS[name, arity] = function
        return function

    return register


def nondet(name: str, arity: int) -> Callable[[_N], _N]:
    """Declare a nondeterministic builtin: a generator that yields once for each solution after unifying.

    The machine undoes the bindings before it resumes the generator, and closes it on a cut. Yielding True
    marks the last solution, which saves a choice point.
    """

    def register(function: _N) -> _N:
        NONDET_BUILTINS[name, arity] = function
        return function

    return register


def quick(nondeterministic: Nondet) -> Callable[[_Q], _Q]:
    """Declare a function that is tried before a nondeterministic builtin, with the same arguments.

    It returns True or False if that is the whole answer, and None if the builtin must be called.
    """

    def register(function: _Q) -> _Q:
        QUICK[nondeterministic] = function
        return function

    return register


def control(name: str, arity: int) -> Callable[[_C], _C]:
    """Declare a control construct: ``f(machine, args, continuation)`` returns the next task."""

    def register(function: _C) -> _C:
        CONTROL_BUILTINS[name, arity] = function
        return function

    return register
