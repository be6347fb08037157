"""Code that unifies: heads of clauses, and ``=`` in bodies."""

from __future__ import annotations

from collections.abc import Callable

from drlsl.logic.core import is_ground, term_variables
from drlsl.logic.jit.code_writer import Function, Scope, build, depth_of, ensure
from drlsl.logic.terms import Atom, Struct, Term, Var, deref

_DEEPEST_MATCH = 5

Fail = Callable[[], None]


def emit_deref(function: Function, name: str) -> None:
    """Dereference a local in place."""
    function.emit(f"while type({name}) is Var and (r := {name}.ref) is not None: {name} = r")


def emit_match(function: Function, scope: Scope, pattern: Term, name: str, fail: Fail) -> None:
    """Unify a term of the clause with the term in a local; `fail` emits the code for failure."""
    pattern = deref(pattern)
    if type(pattern) is Var:
        if pattern in function.module.voids:
            return
        known = scope.names.get(pattern)
        if known is None:
            scope.names[pattern] = name
        elif known != name:
            _emit_test(function, f"unify({known}, {name}, trail)", fail)
        return
    if type(pattern) is Struct:
        if depth_of(pattern) > _DEEPEST_MATCH or is_ground(pattern):
            _emit_test(function, f"unify({build(function, scope, pattern)}, {name}, trail)", fail)
        else:
            _emit_struct(function, scope, pattern, name, fail)
        return
    constant = function.constant(pattern)
    if type(pattern) is Atom:
        test = f"({name} is {constant} or type({name}) is not Atom and unify({name}, {constant}, trail))"
    else:
        kind = type(pattern).__name__
        test = f"({name} == {constant} and type({name}) is {kind} or unify({name}, {constant}, trail))"
    _emit_test(function, test, fail)


def emit_known(function: Function, scope: Scope, pattern: Term, name: str, fail: Fail) -> None:
    """Unify as `emit_match` does with a term whose functor is known to be the pattern's."""
    pattern = deref(pattern)
    if type(pattern) is not Struct:
        return
    _emit_parts(function, scope, pattern, name, fail)


def _emit_parts(function: Function, scope: Scope, pattern: Struct, name: str, fail: Fail) -> None:
    """Unify the arguments of a term whose functor is the pattern's."""
    voids = function.module.voids
    parts = ["_" if deref(arg) in voids else function.local() for arg in pattern.args]
    if any(part != "_" for part in parts):
        function.emit(f"{', '.join(parts)}, = {name}.args")
    for part, arg in zip(parts, pattern.args, strict=True):
        emit_match(function, scope, arg, part, fail)


def _emit_test(function: Function, test: str, fail: Fail) -> None:
    with function.block(f"if not {test}:"):
        fail()


def _emit_struct(function: Function, scope: Scope, pattern: Struct, name: str, fail: Fail) -> None:
    """Take a compound term apart, or build it for an unbound variable."""
    emit_deref(function, name)
    is_alike = f"{name}.name == {pattern.name!r} and len({name}.args) == {len(pattern.args)}"
    function.emit(f"if type({name}) is Struct and {is_alike}:")
    lines = len(function.lines)
    function.indent += 1
    before = scope.copy()
    _emit_parts(function, scope, pattern, name, fail)
    if len(function.lines) == lines:
        function.emit("pass")
    function.indent -= 1
    with function.block(f"elif type({name}) is Var:"):
        # The variables that the first branch introduced must be the same locals here.
        for variable in term_variables(pattern):
            if variable in scope.names and variable not in before.names:
                before.names[variable] = scope.names[variable]
                function.emit(f"{scope.names[variable]} = Var()")
        function.emit(f"{name}.ref = {build(function, before, pattern)}")
        function.emit(f"trail.append({name})")
    with function.block("else:"):
        fail()


def emit_unify(function: Function, scope: Scope, left: Term, right: Term, fail: Fail) -> None:
    """Unify two terms of the clause."""
    left, right = deref(left), deref(right)
    if type(right) is Var and (type(left) is not Var or right not in scope.names):
        left, right = right, left
    if type(left) is Var:
        if left not in scope.names:
            if type(right) is not Var and left in term_variables(right):
                ensure(function, scope, (left,))
                _emit_test(
                    function, f"unify({scope.names[left]}, {build(function, scope, right)}, trail)", fail
                )
                return
            expression = build(function, scope, right)
            name = scope.names[left] = function.local("v")
            function.emit(f"{name} = {expression}")
            return
        if type(right) is not Var:
            name = scope.names[left]
            if type(right) is Struct:
                # A copy, so that the local of the variable itself is not moved along a chain of bindings.
                name = function.local()
                function.emit(f"{name} = {scope.names[left]}")
            emit_match(function, scope, right, name, fail)
            return
    left_expression = build(function, scope, left)
    right_expression = build(function, scope, right)
    _emit_test(function, f"unify({left_expression}, {right_expression}, trail)", fail)
