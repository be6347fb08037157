"""Control constructs called with their arguments as terms: call/N, catch/3, findall/3 and others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final

from drlsl.logic.builtins.arguments import check_partial_list, integer, prefix
from drlsl.logic.builtins.lists import check_result
from drlsl.logic.core import (
    CALL,
    CONTROL,
    DET,
    FAIL,
    Caller,
    CatchPoint,
    Machine,
    Task,
    callable_parts,
    collect,
    control,
    copy_term,
    det,
    enter,
    exit_catch,
    exit_cleanup,
    leave_catch,
    leave_cleanup,
    nondet,
    start_generator,
    term_variables,
    told,
    translate_body,
)
from drlsl.logic.errors import (
    Halt,
    PrologError,
    error_from_term,
    instantiation_error,
    representation_error,
    type_error,
)
from drlsl.logic.terms import NIL, Atom, Struct, Term, Var, deref, make_list


def invoke(machine: Machine, goal: Term, extra: Sequence[Term], continuation: Task) -> Task:
    """Return the task that proves a goal with more arguments added, opaque to cuts."""
    name, args = callable_parts(goal)
    args = tuple([deref(arg) for arg in (*args, *extra)])
    op, target = machine.engine.linker.resolve(name, len(args))
    try:
        if op == CALL:
            return enter(machine, target, args, continuation)
        if op == DET:
            return continuation if target(machine, *args) else FAIL
        if op == CONTROL:
            # Not called from here, since its goal may in turn be such a call.
            return _construct, target, name, args, continuation
        return start_generator(machine, target(machine, *args), continuation)
    except PrologError as error:
        if error.goal is None:
            error.goal = told(name, args)
        raise


@control(":", 2)
def qualified(machine: Machine, args: Sequence[Term], continuation: Task) -> Task:
    """Call ``Module:Goal``: there is one name space, so any module is accepted."""
    if type(deref(args[0])) is Var:
        raise instantiation_error()
    return invoke(machine, args[1], (), continuation)


def _construct(machine: Machine, task: Task) -> Task:
    """Begin a control construct."""
    _, target, name, args, continuation = task
    try:
        following: Task = target(machine, args, continuation)
    except PrologError as error:
        if error.goal is None:
            error.goal = told(name, args)
        raise
    return following


def _call(machine: Machine, args: Sequence[Term], continuation: Task) -> Task:
    return invoke(machine, args[0], args[1:], continuation)


for _arity in range(1, 9):
    control("call", _arity)(_call)


def _declare_connective(name: str, arity: int) -> None:
    @control(name, arity)
    def connective(machine: Machine, args: Sequence[Term], continuation: Task) -> Task:
        return machine.call(Struct(name, tuple(args)), continuation)


for _name, _arity in (
    (",", 2),
    (";", 2),
    ("->", 2),
    ("*->", 2),
    ("\\+", 1),
    ("not", 1),
    ("once", 1),
    ("ignore", 1),
):
    _declare_connective(_name, _arity)


@control("!", 0)
@control("true", 0)
def true(_machine: Machine, _args: Sequence[Term], continuation: Task) -> Task:
    """Succeed; a cut that is called by itself has nothing to cut."""
    return continuation


@control("fail", 0)
@control("false", 0)
def false(_machine: Machine, _args: Sequence[Term], _continuation: Task) -> Task:
    return FAIL


@control("forall", 2)
def forall(machine: Machine, args: Sequence[Term], continuation: Task) -> Task:
    return machine.call(Struct("\\+", (Struct(",", (args[0], Struct("\\+", (args[1],)))),)), continuation)


@control("catch", 3)
def catch(machine: Machine, args: Sequence[Term], continuation: Task) -> Task:
    """Source: ISO 13211-1, 7.8.9."""
    point = CatchPoint(args[1], args[2], continuation)
    machine.choices.append((leave_catch, len(machine.trail), point))
    return invoke(machine, args[0], (), (exit_catch, point, continuation))


@control("setup_call_cleanup", 3)
def setup_call_cleanup(machine: Machine, args: Sequence[Term], continuation: Task) -> Task:
    """Run a goal, and another once it is over: has failed, raised, been cut or left no choice points."""
    return machine.call(Struct("once", (args[0],)), (_start_cleanup, args, continuation))


@control("call_cleanup", 2)
def call_cleanup(machine: Machine, args: Sequence[Term], continuation: Task) -> Task:
    return _start_cleanup(machine, (None, (None, *args), continuation))


def _start_cleanup(machine: Machine, task: Task) -> Task:
    _, args, continuation = task
    # A tuple of its own, so that this cleanup can be distinguished by identity.
    goal = (args[2],)
    machine.choices.append((leave_cleanup, len(machine.trail), goal))
    return invoke(machine, args[1], (), (exit_cleanup, goal, continuation))


@det("throw", 1)
def throw(machine: Caller, ball: Term) -> bool:
    """Source: ISO 13211-1, 7.8.10."""
    ball = copy_term(ball, meter=machine.meter)
    if type(ball) is Var:
        raise instantiation_error()
    raise error_from_term(ball)


@control("findall", 3)
def findall(machine: Machine, args: Sequence[Term], continuation: Task) -> Task:
    """Source: ISO 13211-1, 8.10.1."""
    check_result(machine, args[2])
    return _collect_all(machine, args[0], args[1], args[2], None, continuation)


@control("findall", 4)
def findall_with_tail(machine: Machine, args: Sequence[Term], continuation: Task) -> Task:
    check_result(machine, args[2])
    return _collect_all(machine, args[0], args[1], args[2], args[3], continuation)


def _collect_all(
    machine: Machine, template: Term, goal: Term, result: Term, tail: Term | None, continuation: Task
) -> Task:
    found: list[Term] = []
    machine.choices.append((_finish_findall, len(machine.trail), found, result, tail, continuation))
    return invoke(machine, goal, (), (collect, template, found, None))


def begin_findall(machine: Machine, found: list[Term], result: Term, continuation: Task) -> Task:
    """Return the choice point of a findall/3 that continues when its goal has no more solutions."""
    check_result(machine, result)
    return _finish_findall, len(machine.trail), found, result, None, continuation


def _finish_findall(machine: Machine, choice: Task) -> Task:
    _, _, found, result, tail, continuation = choice
    machine.meter.make(len(found))
    answer = make_list(found) if tail is None else make_list(found, tail)
    return continuation if machine.unify(result, answer) else FAIL


def _call_lambda(machine: Machine, args: Sequence[Term], continuation: Task) -> Task:
    """Call ``Free/[X1, ...]>>Goal`` with more arguments; variables not in `Free` are renamed apart."""
    parameters = deref(args[0])
    renaming: dict[Var, Term] = {}
    if type(parameters) is Struct and parameters.name == "/" and len(parameters.args) == 2:
        renaming = {variable: variable for variable in term_variables(parameters.args[0], machine.meter)}
        parameters = parameters.args[1]
    fresh = copy_term(Struct(">>", (parameters, args[1])), renaming, machine.meter)
    assert type(fresh) is Struct
    formal, rest = prefix(fresh.args[0])
    if type(rest) is not Var and rest is not NIL:
        raise type_error("list", parameters)
    given = args[2:]
    for parameter, arg in zip(formal, given, strict=False):
        if not machine.unify(parameter, arg):
            return FAIL
    return invoke(machine, fresh.args[1], given[len(formal) :], continuation)


for _arity in range(2, 10):
    control(">>", _arity)(_call_lambda)


_HIGHEST_STATUS: Final = 2**31 - 1


@det("halt", 0)
def halt(_machine: Caller) -> bool:
    raise Halt(0)


@det("halt", 1)
def halt_with_status(_machine: Caller, status: Term) -> bool:
    code = integer(status)
    if not -_HIGHEST_STATUS <= code <= _HIGHEST_STATUS:
        raise representation_error("exit_status")
    raise Halt(code)


@nondet("repeat", 0)
def repeat(_machine: Caller) -> Iterator[None]:
    while True:
        yield


@nondet("between", 3)
def between(machine: Caller, low: Term, high: Term, value: Term) -> Iterator[bool | None]:
    start = integer(low)
    last = deref(high)
    endless = type(last) is Atom and last.name in ("inf", "infinite")
    stop: Any = None if endless else integer(high)
    value = deref(value)
    if type(value) is int:
        if start <= value and (stop is None or value <= stop):
            yield True
        return
    if type(value) is not Var:
        raise type_error("integer", value)
    while stop is None or start <= stop:
        machine.unify(value, start)
        yield start == stop
        start += 1


@control("phrase", 2)
def phrase(machine: Machine, args: Sequence[Term], continuation: Task) -> Task:
    return _phrase(machine, args[0], args[1], NIL, continuation)


@control("phrase", 3)
def phrase_with_rest(machine: Machine, args: Sequence[Term], continuation: Task) -> Task:
    return _phrase(machine, args[0], args[1], args[2], continuation)


def _phrase(machine: Machine, body: Term, text: Term, rest: Term, continuation: Task) -> Task:
    """Source: ISO/IEC TS 13211-3, 8.1."""
    callable_parts(body)
    check_partial_list(text)
    check_partial_list(rest)
    return machine.call(translate_body(body, text, rest), continuation)
