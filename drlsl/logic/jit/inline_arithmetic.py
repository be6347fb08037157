"""Code for arithmetic: inline for small operations on integers, else by the evaluator's own functions."""

from __future__ import annotations

from collections.abc import Sequence

from drlsl.logic.core import BINARY, COMPARISONS, OPERATIONS, UNARY, of_one_type
from drlsl.logic.jit.code_writer import Function, Scope, build
from drlsl.logic.jit.term_matching import Fail
from drlsl.logic.terms import Struct, Term, Var, deref

_INLINE = {name: row.infix[0] for (name, _), row in OPERATIONS.items() if row.kind == "ring" and row.infix}
# Products of integers below this are fast; larger ones are accounted for.
_LARGEST_FACTOR = 1 << 60
_DEEPEST = 30


def emit_value(function: Function, scope: Scope, term: Term, depth: int = 0) -> str:
    """Return an expression (a local or a literal) for the value of an arithmetic expression."""
    term = deref(term)
    if type(term) is int or type(term) is float:
        return function.constant(term)
    if type(term) is Var:
        return _emit_variable(function, scope, term)
    if type(term) is Struct and depth < _DEEPEST:
        if len(term.args) == 2 and term.name in BINARY:
            left = emit_value(function, scope, term.args[0], depth + 1)
            right = emit_value(function, scope, term.args[1], depth + 1)
            return _emit_binary(function, scope, term, left, right)
        if len(term.args) == 1 and term.name in UNARY:
            value = emit_value(function, scope, term.args[0], depth + 1)
            name = function.local("n")
            operation = function.module.namespace.name("U", UNARY[term.name])
            function.emit(f"{name} = {operation}({value}, m)")
            return name
    name = function.local("n")
    function.emit(f"{name} = evaluate({build(function, scope, term)}, m)")
    return name


def _emit_variable(function: Function, scope: Scope, variable: Var) -> str:
    known = scope.numbers.get(variable)
    if known is not None:
        return known
    name = function.local("n")
    term = build(function, scope, variable)
    # Most are numbers, or bound to one; the evaluator handles the others.
    function.emit(f"{name} = {term}.ref if type({term}) is Var else {term}")
    function.emit(f"if type({name}) is not int and type({name}) is not float: {name} = evaluate({term}, m)")
    scope.numbers[variable] = name
    return name


def _is_integer(expression: str, scope: Scope) -> bool:
    return expression in scope.integers or expression.lstrip("(-").rstrip(")").isdigit()


def _emit_binary(function: Function, scope: Scope, term: Struct, left: str, right: str) -> str:
    name = function.local("n")
    operation = function.module.namespace.name("B", BINARY[term.name])
    inline = _INLINE.get(term.name)
    if right.isdigit() and int(right) > 0 and term.name in ("mod", "//"):
        inline = "%" if term.name == "mod" else "//"
    if inline is None:
        function.emit(f"{name} = {operation}({left}, {right}, m)")
        return name
    parts = list(dict.fromkeys((left, right)))
    tests = [f"type({part}) is int" for part in parts if not _is_integer(part, scope)]
    if inline == "*":
        bound = _LARGEST_FACTOR
        tests += [f"-{bound} < {part} < {bound}" for part in parts if not _is_exact(part)]
    elif inline == "//":
        tests.append(f"{left} >= 0")  # Python rounds down, where Prolog truncates
    if not tests:
        function.emit(f"{name} = {left} {inline} {right}")
        scope.integers.add(name)
        return name
    test = " and ".join(tests)
    function.emit(f"{name} = {left} {inline} {right} if {test} else {operation}({left}, {right}, m)")
    return name


def emit_is(function: Function, scope: Scope, result: Term, expression: Term, fail: Fail) -> None:
    """Emit ``Result is Expression``."""
    result = deref(result)
    value = emit_value(function, scope, expression)
    if type(result) is Var and result not in scope.names:
        if value.isidentifier():
            scope.names[result] = scope.numbers[result] = value
            return
        name = scope.names[result] = scope.numbers[result] = function.local("v")
        function.emit(f"{name} = {value}")
        if _is_integer(value, scope):
            scope.integers.add(name)
        return
    with function.block(f"if not unify({build(function, scope, result)}, {value}, trail):"):
        fail()


def emit_comparison(function: Function, scope: Scope, name: str, args: Sequence[Term]) -> str:
    """Return the lines before, and the test for, an arithmetic comparison."""
    left, right = (emit_value(function, scope, arg) for arg in args)
    comparison = COMPARISONS[name]
    test = f"{left} {comparison.text} {right}"
    if all(_is_integer(part, scope) for part in (left, right)) or any(map(_is_exact, (left, right))):
        return test
    holds = function.module.namespace.name("Q", comparison.holds)
    alike = function.module.namespace.name("Q", of_one_type)
    return f"({test} if type({left}) is type({right}) else {holds}(*{alike}({left}, {right})))"


def _is_exact(expression: str) -> bool:
    """Return whether an operand is an integer that floats represent exactly, for Python's comparison."""
    return expression.lstrip("(-").rstrip(")").isdigit()
