"""Lines of generated code, and the known facts about a clause's variables at a place in it."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from drlsl.logic.core import is_ground
from drlsl.logic.terms import Struct, Term, Var, deref

# Deeper terms are built step by step, since Python limits the nesting of expressions.
DEEPEST_EXPRESSION = 6


# Values that functions keep in locals of the same names if they use them.
_OF_MACHINE = ("trail", "choices", "rounds")


class Namespace:
    """The globals of generated code: constants, builtins and predicates under names of their own."""

    def __init__(self, values: dict[str, Any]) -> None:
        self.values = dict(values)
        self._names: dict[tuple[str, Any], str] = {}

    def name(self, prefix: str, value: Any) -> str:
        """Return the name of a value in the code; one name for one object."""
        key = (prefix, id(value))
        known = self._names.get(key)
        if known is None:
            known = self._names[key] = f"{prefix}{len(self._names)}"
            self.values[known] = value
        return known


class Scope:
    """The variables of a clause that are already Python locals, their names, and which are numbers.

    `names` maps a variable to the local that holds its term. `numbers` maps a variable to the local that
    holds the value of its term as an expression; `integers` has the names of locals that are surely integers.
    """

    def __init__(
        self,
        names: dict[Var, str] | None = None,
        numbers: dict[Var, str] | None = None,
        integers: Iterable[str] = (),
    ) -> None:
        self.names = dict(names or {})
        self.numbers = dict(numbers or {})
        self.integers = set(integers)

    def copy(self) -> Scope:
        """Return an independent copy."""
        return Scope(self.names, self.numbers, self.integers)


class Function:
    """One function under construction."""

    def __init__(self, name: str, module: Module) -> None:
        self.name = name
        self.module = module
        self.lines: list[tuple[str, Any]] = []
        self.indent = 1
        self.commits = False  # whether it removes choice points that were made before its call
        self._info: Any = None

    def begin(self, *names: str) -> None:
        """Start with the parts of the task under these names."""
        self.emit(f"{', '.join(names)} = t")

    def emit(self, text: str) -> None:
        """Add a line at the current indentation."""
        self.lines.append((" " * self.indent + text, self._info))

    @contextmanager
    def block(self, text: str) -> Iterator[None]:
        """Add a line, and what is added meanwhile below it, one step to the right."""
        self.emit(text)
        self.indent += 1
        yield
        self.indent -= 1

    def about(self, goal: Term | None, clause: Any, scope: Scope) -> None:
        """Set the goal of the following lines: errors raised there are errors of this goal."""
        self._info = None if goal is None else (goal, clause, dict(scope.names))

    def local(self, prefix: str = "x") -> str:
        """Return a new name for a local."""
        return self.module.fresh(prefix)

    def constant(self, term: Term) -> str:
        """Return an expression for an atomic or ground term."""
        if type(term) is int and abs(term) < 1 << 30:
            return str(term) if term >= 0 else f"({term})"
        if type(term) is str:
            return repr(term)
        return self.module.namespace.name("C", term)


class Module:
    """The functions of one predicate, before Python compiles them."""

    def __init__(self, title: str, namespace: Namespace, voids: Container[Var]) -> None:
        self.title = title
        self.namespace = namespace
        self.voids = voids  # the variables that occur once in their clause, so that no code needs them
        self.functions: list[Function] = []
        self._counter = 0

    def fresh(self, prefix: str) -> str:
        """Return a name that is unused in the module."""
        self._counter += 1
        return f"{prefix}{self._counter}"

    def function(self, name: str | None = None) -> Function:
        """Return a new function ``name(m, t)`` of a machine and a task."""
        function = Function(name or self.fresh("f"), self)
        self.functions.append(function)
        return function

    def load(self) -> dict[str, Any]:
        """Have Python compile the functions; return their globals.

        ``LINES`` of these is for `add_context`, ``COMMITS`` has the names of the functions that commit.
        """
        text: list[str] = []
        info: dict[int, Any] = {}
        number = 0
        for function in self.functions:
            body = "\n".join([line for line, _ in function.lines])
            used = "; ".join([f"{name} = m.{name}" for name in _OF_MACHINE if name in body])
            text += (f"def {function.name}(m, t):", f" {used}", body)
            info.update((number + at, about) for at, (_, about) in enumerate(function.lines, 3) if about)
            number += 2 + len(function.lines)
        values = self.namespace.values
        values["LINES"] = info
        values["COMMITS"] = frozenset(function.name for function in self.functions if function.commits)
        exec(compile("\n".join(text), f"<prolog {self.title}>", "exec"), values)  # noqa: S102  (our own code)
        return values


def ensure(function: Function, scope: Scope, variables: Iterable[Var]) -> None:
    """Make locals of variables that have none yet: fresh, unbound variables."""
    for variable in variables:
        if variable not in scope.names:
            name = scope.names[variable] = function.local("v")
            function.emit(f"{name} = Var()")


def build(function: Function, scope: Scope, term: Term, depth: int = 0) -> str:
    """Return an expression for a term, after the lines that make its new variables."""
    term = deref(term)
    if type(term) is Var:
        if term in function.module.voids and term not in scope.names:
            return "Var()"
        ensure(function, scope, (term,))
        return scope.names[term]
    if type(term) is not Struct:
        return function.constant(term)
    if is_ground(term):
        return function.constant(term)
    if term.name == "." and len(term.args) == 2:
        return _build_list(function, scope, term, depth)
    parts = [build(function, scope, arg, depth + 1) for arg in term.args]
    expression = f"Struct({term.name!r}, ({', '.join(parts)},))"
    return _shortened(function, expression, depth)


def _build_list(function: Function, scope: Scope, term: Term, depth: int) -> str:
    items: list[str] = []
    while type(term) is Struct and term.name == "." and len(term.args) == 2 and not is_ground(term):
        items.append(build(function, scope, term.args[0], depth + 1))
        term = deref(term.args[1])
    expression = build(function, scope, term, depth + 1)
    for count, item in enumerate(reversed(items)):
        if count and count % DEEPEST_EXPRESSION == 0:
            name = function.local()
            function.emit(f"{name} = {expression}")
            expression = name
        expression = f'Struct(".", ({item}, {expression}))'
    return _shortened(function, expression, depth)


def _shortened(function: Function, expression: str, depth: int) -> str:
    if depth < DEEPEST_EXPRESSION:
        return expression
    name = function.local()
    function.emit(f"{name} = {expression}")
    return name


def depth_of(term: Term) -> int:
    """Return the nesting depth of a term, that of a list by its elements."""
    deepest = 0
    todo = [(term, 1)]
    while todo:
        term, depth = todo.pop()
        term = deref(term)
        deepest = max(deepest, depth)
        if type(term) is Struct:
            todo.extend((arg, depth + 1) for arg in term.args[:-1])
            is_cell = term.name == "." and len(term.args) == 2
            todo.append((term.args[-1], depth if is_cell else depth + 1))
    return deepest
