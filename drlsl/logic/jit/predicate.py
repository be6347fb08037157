"""Code for whole predicates: the switch on the first argument and the clauses behind it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from drlsl.logic.builtins import begin_findall
from drlsl.logic.core import (
    FAIL,
    Clause,
    Goal,
    NotCallable,
    Predicate,
    Resolver,
    collect,
    cut,
    cuts,
    evaluate,
    index_key,
    read_body,
    soft_cut,
    start_generator,
    undo,
    unify,
)
from drlsl.logic.errors import type_error
from drlsl.logic.jit.clause_code import BodyEmitter, Place
from drlsl.logic.jit.code_writer import Module, Namespace, Scope
from drlsl.logic.jit.guards import Guard, guard_of
from drlsl.logic.jit.holes import UNFINISHED, close_hole, emit_hole, keeps_open, open_positions
from drlsl.logic.jit.term_matching import emit_deref, emit_known, emit_match
from drlsl.logic.terms import Atom, Struct, Var, deref

RUNTIME: Final[dict[str, Any]] = {
    "ATOMIC": frozenset({Atom, int, float, str}),
    "Atom": Atom,
    "CALLABLE": frozenset({Atom, Struct}),
    "FAIL": FAIL,
    "NUMBERS": frozenset({int, float}),
    "Struct": Struct,
    "UNFINISHED": UNFINISHED,
    "Var": Var,
    "begin_findall": begin_findall,
    "collect": collect,
    "cut": cut,
    "deref": deref,
    "evaluate": evaluate,
    "soft_cut": soft_cut,
    "start_generator": start_generator,
    "undo": undo,
    "unify": unify,
}

# Up to this number of constants as first arguments are compared one by one; more are looked up.
_FEW = 4

Alternatives = tuple[Any, ...]


def compile_predicate(predicate: Predicate, linker: Resolver, unbound: Any = None) -> Any:
    """Return the entry point of a predicate's generated code.

    Calls whose first argument is unbound go to `unbound`, if given and the clauses differ in first arguments,
    which saves about half of the code.

    Raises:
        PrologError: A body is not callable; the plain solver will report it when it is reached.
    """
    return _PredicateCompiler(predicate, linker, unbound).compile()


class _PredicateCompiler:
    """Emits the entry function of one predicate."""

    def __init__(self, predicate: Predicate, linker: Resolver, unbound: Any) -> None:
        self._clauses = list(predicate.clauses)
        self._bodies = [body_of(clause) for clause in self._clauses]
        self._module = Module(f"{predicate.name}/{predicate.arity}", Namespace(RUNTIME), voids(self._clauses))
        # A recursive call of a tabled predicate is a call like any other: it reads the table.
        own = (predicate.name, predicate.arity) if predicate.tabled is None else ("", -1)
        self._emitter = BodyEmitter(self._module, linker, own)
        self._args = [f"a{index}" for index in range(predicate.arity)]
        self._function = self._module.function("entry")
        self._holes = open_positions(self._clauses, self._bodies, own)
        self._unbound = unbound
        self._values: dict[int, str] = {}  # locals with the values of arguments as expressions, by position
        self._loops = False  # whether a clause jumps back to the beginning
        # The clauses that are tried one after the other, rather than alone.
        self._chained: set[int] = set()

    def compile(self) -> Any:
        """Emit and load the code."""
        function = self._function
        function.begin("_", "_", "alts", *self._args, "k")
        for position in self._holes:
            function.emit(f"hole{position} = None")
        begin = len(function.lines)
        with function.block("while True:"):
            guards = self._guards()
            if guards is not None:
                for number, guard in enumerate(guards):
                    self._only_clause(number, guard=guard)
            else:
                self._switch()
                if self._chained:
                    self._alternatives()
        if self._loops:
            self._limit_rounds(begin)
        return self._module.load()["entry"]

    def _limit_rounds(self, begin: int) -> None:
        """Limit the rounds of the loop that begins at a line; then return to the trampoline."""
        function = self._function
        function.lines[begin : begin + 1] = [(" while rounds:", None), ("  rounds -= 1", None)]
        function.about(None, None, Scope())
        for position in self._holes:
            close_hole(function, position)
        function.emit(f"return m.rest(({', '.join(['entry, 0, None', *self._args, 'k'])}))")

    def _guards(self) -> list[Guard | None] | None:
        """Return the first tests of all clauses but the last, if they alone decide between them."""
        guards: list[Guard | None] = []
        for number in range(len(self._clauses) - 1):
            guard = guard_of(self._clauses[number:], self._bodies[number:], self._emitter.is_guard)
            if guard is None:
                return None
            guards.append(guard)
        return [*guards, None]

    def _alternatives(self) -> None:
        """Try the clauses of a chain one after the other."""
        function = self._function
        for position in self._holes:
            close_hole(function, position)
        function.emit("mark = len(trail)")
        if any(map(cuts, self._bodies)):
            function.emit("h = len(choices)")
        with function.block("while alts:"):
            # Bindings of a clause that failed; after the last one, backtracking undoes them.
            function.emit("if len(trail) > mark: undo(trail, mark)")
            function.emit("i, alts = alts")
            for count, number in enumerate(sorted(self._chained)):
                with function.block(f"{'elif' if count else 'if'} i == {number}:"):
                    self._clause_of_chain(number)
        function.about(None, None, Scope())
        function.emit("else: return FAIL")

    def _switch(self) -> None:
        """Choose the clauses that may match by the first argument, unless they are given."""
        function = self._function
        chains, others = _chains(self._clauses)
        every = range(len(self._clauses))
        if not chains:
            function.emit(f"if alts is None: alts = {self._chain(every)!r}")
            return
        structs = {key: chain for key, chain in chains.items() if type(key) is tuple and type(key[0]) is str}
        rest = {key: chain for key, chain in chains.items() if key not in structs}
        with function.block("if alts is None:"):
            emit_deref(function, "a0")
            function.emit("kind = type(a0)")
            if structs:
                function.emit("if kind is Struct:")
                function.indent += 1
            for count, ((name, arity), chain) in enumerate(structs.items()):
                function.emit(f"{'elif' if count else 'if'} a0.name == {name!r} and len(a0.args) == {arity}:")
                self._chosen(chain, first_known=True)
            if structs:
                function.emit("else:")
                self._chosen(others, first_known=False)
                function.indent -= 1
            function.emit(f"{'elif' if structs else 'if'} kind is Var:")
            self._switch_unbound(every)
            self._switch_constants(rest, others)

    def _switch_unbound(self, every: Sequence[int]) -> None:
        function = self._function
        function.indent += 1
        if self._unbound is None:
            function.emit(f"alts = {self._chain(every)!r}")
        else:
            for position in self._holes:
                close_hole(function, position)
            call = self._module.namespace.name("U", self._unbound)
            function.emit(f"return {call}(m, ({', '.join(['entry, 0, None', *self._args, 'k'])}))")
        function.indent -= 1

    def _chain(self, numbers: Sequence[int]) -> Alternatives:
        """Return the clauses to try as linked pairs: the first, and the chain of the others."""
        self._chained.update(numbers)
        chain: Alternatives = ()
        for number in reversed(numbers):
            chain = (number, chain)
        return chain

    def _switch_constants(self, chains: dict[Any, list[int]], others: list[int]) -> None:
        function = self._function
        if len(chains) <= _FEW and all(type(key) is Atom or type(key) is int for key in chains):
            for key, chain in chains.items():
                constant = function.constant(key)
                test = f"a0 is {constant}" if type(key) is Atom else f"a0 == {constant} and kind is int"
                function.emit(f"elif {test}:")
                self._chosen(chain, first_known=True)
            function.emit("else:")
            self._chosen(others, first_known=False)
            return
        table = {key: self._chain(chain) for key, chain in chains.items()}
        lookup = self._module.namespace.name("T", table)
        function.emit("else:")
        function.emit(" key = (kind, a0) if kind is float or kind is str else a0")
        function.emit(f" alts = {lookup}.get(key, {self._chain(others)!r})")

    def _chosen(self, chain: list[int], *, first_known: bool) -> None:
        """Emit the code for a first argument that only these clauses match."""
        function = self._function
        function.indent += 1
        if not chain:
            function.emit("return FAIL")
        elif len(chain) == 1:
            self._only_clause(chain[0], first_known=first_known)
        else:
            function.emit(f"alts = {self._chain(chain)!r}")
        function.indent -= 1

    def _only_clause(self, number: int, *, first_known: bool = False, guard: Guard | None = None) -> None:
        """Emit a clause without alternatives: its failure is the call's."""
        function, clause, args = self._function, self._clauses[number], self._args
        height = Var("Height")
        scope = Scope({height: "h"})
        function.about(clause.head, clause, scope)
        if cuts(self._bodies[number]):
            function.emit("h = len(choices)")

        def fail() -> None:
            function.emit("return FAIL")

        def jump(parts: Sequence[str]) -> None:
            parts = list(parts)
            for position in self._holes:
                if position in kept:
                    parts[position] = args[position]
            self._assign(parts)
            function.emit("continue")

        kept = {
            position
            for position in self._holes
            if keeps_open(clause, self._bodies[number], position, self._emitter.key)
        }
        for position, (name, pattern) in enumerate(zip(args, clause.args, strict=True)):
            if position in self._holes:
                emit_hole(function, scope, clause, position, kept=position in kept, fail=fail)
            elif position == 0 and first_known:
                emit_known(function, scope, pattern, name, fail)
            else:
                emit_match(function, scope, pattern, name, fail)
        names = {
            position: arg for position, each in enumerate(clause.args) if type(arg := deref(each)) is Var
        }
        scope.numbers.update((names[at], value) for at, value in self._values.items() if at in names)
        place = Place(function, scope, fail, loop=jump)
        if guard is None:
            self._emitter.emit_clause(place, clause, self._bodies[number], height)
        else:
            self._emitter.emit_guarded(place, clause, guard, height)
            numbers = scope.numbers
            self._values = {at: numbers[name] for at, name in names.items() if name in numbers}

    def _clause_of_chain(self, number: int) -> None:
        """Emit a clause with others after it."""
        function, clause, args = self._function, self._clauses[number], self._args
        height = Var("Height")
        scope = Scope({height: "h"})
        function.about(clause.head, clause, scope)

        def next_clause() -> None:
            function.emit("continue")

        def leave_choice() -> None:
            if number < len(self._clauses) - 1:
                function.emit(f"if alts: choices.append(({', '.join(['entry, mark, alts', *args, 'k'])}))")

        def jump(parts: Sequence[str]) -> None:
            self._assign(parts)
            function.emit("alts = None")
            function.emit("break")

        may_bind = False
        for position, (name, pattern) in enumerate(zip(args, clause.args, strict=True)):
            if position == 0 and self._unbound is not None and type(deref(pattern)) is not Var:
                # The switch has chosen this clause by the functor of a bound first argument.
                emit_known(function, scope, pattern, name, next_clause)
                may_bind = type(deref(pattern)) is Struct
                continue
            is_new = type(deref(pattern)) is Var and deref(pattern) not in scope.names
            if may_bind and type(deref(pattern)) is Struct:
                # The next clause must not find this clause's bindings in the argument itself.
                local = function.local()
                function.emit(f"{local} = {name}")
                name = local
            may_bind = may_bind or not is_new
            emit_match(function, scope, pattern, name, next_clause)
        place = Place(function, scope, next_clause, pending=leave_choice, loop=jump)
        self._emitter.emit_clause(place, clause, self._bodies[number], height)

    def _assign(self, parts: Sequence[str]) -> None:
        """Give the arguments their values for the next round, all at once."""
        self._loops = True
        changed = [(arg, part) for arg, part in zip(self._args, parts, strict=True) if arg != part]
        if changed:
            left, right = ", ".join(arg for arg, _ in changed), ", ".join(part for _, part in changed)
            self._function.emit(f"{left} = {right}")


def body_of(clause: Clause) -> Goal:
    """Return the goals of a clause.

    Raises:
        PrologTypeError: Its body is not callable.
    """
    body = read_body(clause.body)
    if type(body) is NotCallable:
        raise type_error("callable", body.term)
    return body


def voids(clauses: Sequence[Clause]) -> set[Var]:
    """Return the variables that occur only once in their clause."""
    once: set[Var] = set()
    again: set[Var] = set()
    for clause in clauses:
        todo = [clause.head, clause.body]
        while todo:
            term = deref(todo.pop())
            if type(term) is Struct:
                todo.extend(term.args)
            elif type(term) is Var:
                (again if term in once else once).add(term)
    return once - again


def _chains(clauses: Sequence[Clause]) -> tuple[dict[Any, list[int]], list[int]]:
    """Return the clauses that may match each named first argument, and those for any other."""
    chains: dict[Any, list[int]] = {}
    others: list[int] = []
    for number, clause in enumerate(clauses):
        first = deref(clause.args[0]) if clause.args else Var()
        if type(first) is Var:
            for chain in chains.values():
                chain.append(number)
            others.append(number)
        else:
            chains.setdefault(index_key(first), list(others)).append(number)
    return chains, others
