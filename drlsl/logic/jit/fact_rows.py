"""Code for calls of facts that are held as rows: a loop over them, without a variable for each argument."""

from __future__ import annotations

from collections.abc import Sequence

from drlsl.logic.jit.code_writer import Function, Scope
from drlsl.logic.jit.term_matching import emit_deref
from drlsl.logic.terms import Atom, Struct, Term, Var, deref


def emit_row_match(function: Function, scope: Scope, args: Sequence[Term], wanted: set[Var]) -> None:
    """Unify a goal's arguments with the local `row`, or continue with the next row.

    Variables that are `wanted` and have no local yet get one; others match anything.
    """
    for index, arg in enumerate(args):
        arg = deref(arg)
        value = f"row[{index}]"
        if type(arg) is Struct:
            # Rows hold only atomic terms.
            _next_row(function)
            return
        if type(arg) is not Var:
            constant = function.constant(arg)
            if type(arg) is Atom:
                function.emit(f"if {value} is not {constant}:")
            else:
                function.emit(f"if {value} != {constant} or type({value}) is not {type(arg).__name__}:")
            function.indent += 1
            _next_row(function)
            function.indent -= 1
        elif arg in scope.names:
            _match_known(function, scope.names[arg], value)
        elif arg in wanted:
            name = scope.names[arg] = function.local("v")
            function.emit(f"{name} = {value}")


def _match_known(function: Function, known: str, value: str) -> None:
    name = function.local()
    function.emit(f"{name} = {known}")
    emit_deref(function, name)
    function.emit(f"if type({name}) is Var:")
    function.emit(f" {name}.ref = {value}; trail.append({name})")
    with function.block(
        f"elif {name} is not {value} and ({name} != {value} or type({name}) is not type({value})):"
    ):
        _next_row(function)


def _next_row(function: Function) -> None:
    function.emit("if len(trail) > mark: undo(trail, mark)")
    function.emit("continue")
