"""Code that builds a list from its front: a last call fills in the tail of the cell that this call made.

In ``app([H|T], L, [H|R]) :- app(T, L, R)`` the variable `R` only passes the place of the tail to the next
call. If the third argument is unbound, that place is a *hole*: the cell is kept in a local, with its head in
another, and the next round puts the next cell into it. No variable is made, bound, trailed or dereferenced
for it.

A hole is closed before anything can read it: before a clause with alternatives, any goal but a test of
numbers or types, and the end of the loop. A failure leaves it open, because the binding to the first cell is
undone.
"""

from __future__ import annotations

from collections.abc import Sequence

from drlsl.logic.core import COMPARISONS, Call, Clause, Cut, Goal, Truth, conjuncts
from drlsl.logic.jit.code_writer import Function, Scope, build
from drlsl.logic.jit.term_matching import Fail, emit_deref, emit_match
from drlsl.logic.terms import NIL, Atom, Struct, Term, Var, deref

_TESTS = frozenset({"var", "nonvar", "integer", "float", "number", "atom", "atomic", "compound", "callable"})


def open_positions(clauses: Sequence[Clause], bodies: Sequence[Goal], key: tuple[str, int]) -> list[int]:
    """Return the argument positions at which some clause makes a cell with its tail left to a last call."""
    return [
        position
        for position in range(1, key[1])
        if any(
            _extends(clause, position) and keeps_open(clause, body, position, key)
            for clause, body in zip(clauses, bodies, strict=True)
        )
    ]


def keeps_open(clause: Clause, body: Goal, position: int, key: tuple[str, int]) -> bool:
    """Return whether a clause only passes its argument's place, or that cell's tail, to a last call."""
    last = _last_call(body, key)
    if last is None:
        return False
    pattern = deref(clause.args[position])
    extends = _extends(clause, position) and type(pattern) is Struct
    variable = deref(pattern.args[1]) if extends else pattern  # type: ignore[union-attr]  # a cell
    if type(variable) is not Var or deref(last.args[position]) is not variable:
        return False
    return _occurrences(variable, clause) == 2


def _extends(clause: Clause, position: int) -> bool:
    pattern = deref(clause.args[position])
    return type(pattern) is Struct and len(pattern.args) == 2 and type(deref(pattern.args[1])) is Var


def _last_call(body: Goal, key: tuple[str, int]) -> Call | None:
    """Return the last goal if it calls the predicate itself and no earlier goal can inspect a term."""
    *before, last = conjuncts(body)
    if type(last) is Call and (last.name, len(last.args)) == key and all(map(_is_blind, before)):
        return last
    return None


def _is_blind(goal: Goal) -> bool:
    """Return whether a goal inspects only numbers and types."""
    match goal:
        case Call(name, (_,)):
            return name in _TESTS
        case Call(name, (_, _)):
            return name in COMPARISONS or name == "is"
        case Truth(holds):
            return holds
    return type(goal) is Cut


def _occurrences(variable: Var, clause: Clause) -> int:
    count = 0
    todo = [clause.head, clause.body]
    while todo:
        term = deref(todo.pop())
        if term is variable:
            count += 1
        elif type(term) is Struct:
            todo.extend(term.args)
    return count


def close_hole(function: Function, position: int) -> None:
    """Fill a hole, if there is one, with a variable, and make that the argument."""
    function.emit(f"if hole{position} is not None:")
    function.emit(f" a{position} = Var()")
    function.emit(f" hole{position}.args = (lead{position}, a{position})")
    function.emit(f" hole{position} = None")


def emit_hole(
    function: Function, scope: Scope, clause: Clause, position: int, *, kept: bool, fail: Fail
) -> None:
    """Unify the argument at a position that may be a hole with the clause's."""
    name = f"a{position}"
    pattern = deref(clause.args[position])
    if kept and type(pattern) is Struct:
        _emit_cell(function, scope, pattern, position, fail)
        return
    if kept:
        # Passed on unchanged; the jump leaves this argument alone.
        assert type(pattern) is Var
        scope.names[pattern] = name
        return
    value = None
    if type(pattern) is Var:
        value = scope.names.get(pattern)
    elif type(pattern) is not Struct:
        value = function.constant(pattern)
    if value is None:
        close_hole(function, position)
        emit_match(function, scope, pattern, name, fail)
        return
    function.emit(f"if hole{position} is not None:")
    function.emit(f" hole{position}.args = (lead{position}, {value})")
    function.emit(f" hole{position} = None; {name} = {value}")
    with function.block("else:"):
        emit_match(function, scope, pattern, name, fail)


def _emit_cell(function: Function, scope: Scope, pattern: Struct, position: int, fail: Fail) -> None:
    """Match a cell whose tail is left to the last call: put a new one into the hole, or take one apart."""
    name, hole, lead = f"a{position}", f"hole{position}", f"lead{position}"
    tail = deref(pattern.args[1])
    assert type(tail) is Var
    before = scope.copy()
    head = deref(pattern.args[0])
    with function.block(f"if {hole} is not None:"):
        expression = build(function, scope, head)
        _emit_new_cell(function, pattern.name)
        function.emit(f"{hole}.args = ({lead}, cell)")
        function.emit(f"{hole} = cell; {lead} = {expression}")
    with function.block("else:"):
        emit_deref(function, name)
        with function.block(f"if type({name}) is Var:"):
            _rebuild(function, before.copy(), scope, head)
            _emit_new_cell(function, pattern.name)
            function.emit(f"{name}.ref = cell; trail.append({name})")
            function.emit(f"{hole} = cell; {lead} = {build(function, scope, head)}")
        with function.block(
            f"elif type({name}) is Struct and {name}.name == {pattern.name!r} and len({name}.args) == 2:"
        ):
            part = function.local()
            function.emit(f"{part}, {name} = {name}.args")
            inner = before.copy()
            emit_match(function, inner, head, part, fail)
            for variable, local in inner.names.items():
                if variable not in before.names:
                    function.emit(f"{scope.names[variable]} = {local}")
        with function.block("else:"):
            fail()
    scope.names[tail] = name


def _rebuild(function: Function, before: Scope, scope: Scope, head: Term) -> None:
    """Make the locals of variables that the head of the cell introduces, under their present names."""
    for variable, local in scope.names.items():
        if variable not in before.names:
            function.emit(f"{local} = Var()")


def _emit_new_cell(function: Function, name: str) -> None:
    # An error about the unfinished cell would show the placeholder.
    function.emit(f"cell = Struct({name!r}, UNFINISHED)")


UNFINISHED = (NIL, Atom("..."))
