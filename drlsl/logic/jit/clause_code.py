"""Code for the bodies of clauses, in continuation-passing style.

Goals that need no continuation of their own (tests, arithmetic, unification, deterministic builtins, and the
conditions and branches made of them) are emitted in place. Any other goal ends the function: it is returned
to the trampoline as a task, with what follows it as a new function and the variables that this still needs.
"""

from __future__ import annotations

import operator
from collections import Counter
from collections.abc import Callable, Container, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeAlias

from drlsl.logic import core
from drlsl.logic.errors import type_error
from drlsl.logic.jit.code_writer import Function, Module, Scope, build, ensure
from drlsl.logic.jit.fact_rows import emit_row_match
from drlsl.logic.jit.guards import Guard
from drlsl.logic.jit.inline_arithmetic import emit_comparison, emit_is
from drlsl.logic.jit.term_matching import emit_deref, emit_unify
from drlsl.logic.terms import Struct, Term, Var, deref, make_list

_KINDS = {
    "var": "Var",
    "integer": "int",
    "float": "float",
    "atom": "Atom",
    "compound": "Struct",
    "string": "str",
}
_GROUPS = {
    "nonvar": "is not Var",
    "number": "in NUMBERS",
    "atomic": "in ATOMIC",
    "callable": "in CALLABLE",
}
_PURE = frozenset(
    {"==", "\\==", "\\=", "@<", "@>", "@=<", "@>=", "ground", "is_list", "=@=", "subsumes_term"}
)


class Commit(NamedTuple):
    """The end of a condition: its choice points are removed, or that of the other branch if it is soft."""

    height: Var
    soft: bool = False


Step: TypeAlias = core.Goal | Commit
Rest: TypeAlias = tuple[str, list[Var]]  # a function that goes on with a body, and what it is given


@dataclass
class Place:
    """A place where code is being emitted, and the state there.

    Attributes:
        function: the function under construction.
        scope: the known facts about the clause's variables.
        fail: emits the code for the failure of a goal.
        k: the local with the continuation.
        pending: emits the choice point for the remaining clauses, as long as that has been postponed.
        loop: emits a last call of the predicate itself as a jump to its beginning, if that is possible.
    """

    function: Function
    scope: Scope
    fail: Callable[[], None]
    k: str = "k"
    pending: Callable[[], None] | None = None
    loop: Callable[[Sequence[str]], None] | None = None

    def commit(self) -> None:
        """Emit the choice point for the remaining clauses."""
        if self.pending is not None:
            self.pending()
            self.pending = None
            self.fail = self.give_up

    def give_up(self) -> None:
        """Emit the failure of the whole call."""
        self.function.emit("return FAIL")


class BodyEmitter:
    """Emits the bodies of one predicate's clauses."""

    def __init__(self, module: Module, linker: core.Resolver, key: tuple[str, int]) -> None:
        self._module = module
        self._resolve = linker.resolve
        self.key = key
        self._clause: core.Clause | None = None
        # What a cut cuts back to: the height in a local, or so many choice points above it.
        self._heights: dict[core.Barrier, tuple[Var, int]] = {}
        self._goals: Sequence[Step] = ()
        self._rests: dict[int, Rest] = {}

    def emit_clause(self, place: Place, clause: core.Clause, body: core.Goal, height: Var) -> None:
        """Emit a clause's body; cuts in it cut back to the height in the local of `height`."""
        self._clause = clause
        self._heights[core.CLAUSE] = height, 0
        self._sequence(place, core.steps(body))

    def is_guard(self, goal: core.Goal) -> bool:
        """Return whether a goal is a test that is sure to bind nothing."""
        return self._is_simple(goal) and self._is_pure(goal)

    def emit_guarded(self, place: Place, clause: core.Clause, guard: Guard, height: Var) -> None:
        """Emit a clause's body, with the code going on behind it where the guard does not hold.

        What the first test makes known of the scope is known there too.
        """
        self._clause = clause
        self._heights[core.CLAUSE] = height, 0
        function = place.function
        depth = function.indent
        inner = place
        for test in guard.tests:
            function.emit(f"if {self._simple_test(inner, test)}:")
            function.indent += 1
            inner = replace(inner, scope=inner.scope.copy())
        self._sequence(inner, guard.goals)
        function.indent = depth

    def emit_rests(self, clause: core.Clause, body: core.Goal, height: Var) -> dict[int, Rest]:
        """Emit a clause's body; return the continuations of its calls, by the number of goals in each."""
        self._clause = clause
        self._heights[core.CLAUSE] = height, 0
        self._goals = core.steps(body)
        names = {variable: self._module.fresh("v") for variable in core.term_variables(clause.head)}
        place = Place(Function("", self._module), Scope({height: "h", **names}), lambda: None)
        self._continuation(place, self._goals)
        return self._rests

    def _about(self, function: Function, goal: Step, scope: Scope) -> None:
        term = None if type(goal) is Commit or type(goal) is core.NotCallable else goal.term  # type: ignore[union-attr]
        function.about(term, self._clause, scope)

    def _sequence(self, place: Place, goals: Sequence[Step]) -> None:
        """Emit goals one after the other, followed by the continuation."""
        for index, goal in enumerate(goals):
            rest = goals[index + 1 :]
            self._about(place.function, goal, place.scope)
            if place.pending is not None and type(goal) is core.Cut:
                # There is nothing to cut but the untried clauses.
                place.pending = None
                place.fail = place.give_up
            elif type(goal) is Commit or self._is_inline(goal):  # type: ignore[arg-type]  # a goal
                if place.pending is not None and core.cuts(goal):  # type: ignore[arg-type]  # no commit yet
                    place.commit()
                self._inline(place, goal, rest)
            else:
                place.commit()
                self._leave(place, goal, rest)  # type: ignore[arg-type]  # a goal
                return
        place.commit()
        place.function.emit(f"return {place.k}")

    def _continuation(self, place: Place, rest: Sequence[Step], k: str | None = None) -> str:
        """Return the expression of a task that continues with `rest`."""
        if not rest:
            return k or place.k
        function = self._module.function()
        expression, inner = self._capture(place, function, rest, k or place.k, first="")
        left = len(rest)
        if left <= len(self._goals) and all(map(operator.is_, rest, self._goals[-left:])):
            names = {name: variable for variable, name in inner.scope.names.items()}
            self._rests[left] = function.name, list(names.values())
        self._sequence(inner, rest)
        return expression

    def _heights_of(self, goals: Iterable[Step], known: Container[Var]) -> list[Var]:
        """Return the known variables with what the cuts in goals cut back to."""
        found = {goal.height: None for goal in goals if type(goal) is Commit}
        todo = [goal for goal in goals if type(goal) is not Commit]
        while todo:
            goal = todo.pop()
            if type(goal) is core.Cut:
                if goal.barrier in self._heights:
                    found[self._heights[goal.barrier][0]] = None
            else:
                todo += core.inside(goal)  # type: ignore[arg-type]  # a goal
        return [height for height in found if height in known]

    def _capture(
        self, place: Place, function: Function, goals: Sequence[Step], k: str, first: str
    ) -> tuple[str, Place]:
        """Return a task, or with `first` a choice point, of a function and the variables its goals need."""
        scope = place.scope
        heights = self._heights_of(goals, scope.names)
        live = [variable for variable in variables_of(goals) if variable in scope.names] + heights
        names = list(dict.fromkeys(scope.names[variable] for variable in live))
        inner = Scope({variable: scope.names[variable] for variable in live})
        for variable in live:
            number = scope.numbers.get(variable)
            if number is not None and number in names:
                inner.numbers[variable] = number
        inner.integers = scope.integers & set(names)
        function.commits = bool(heights)
        function.begin(*(("_", "_") if first else ("_",)), *names, "k")
        start = f"{function.name}, {first}, " if first else f"{function.name}, "
        expression = f"({start}{', '.join([*names, k])})"
        return expression, Place(function, inner, lambda: function.emit("return FAIL"))

    def _choice(self, place: Place, goals: Sequence[Step], k: str) -> None:
        """Emit a choice point that continues with other goals."""
        function = self._module.function()
        expression, inner = self._capture(place, function, goals, k, first="len(trail)")
        place.function.emit(f"choices.append({expression})")
        self._sequence(inner, goals)

    def _leave(self, place: Place, goal: core.Goal, rest: Sequence[Step]) -> None:
        """Emit a goal that needs a continuation, and the goals after it."""
        match goal:
            case core.Call(name, args):
                self._call(place, name, args, rest)
            case core.Disjunction(first, second):
                joined = self._joined(place, goal, rest)
                self._choice(joined, core.steps(second), joined.k)
                self._sequence(joined, core.steps(first))
            case core.IfThenElse():
                self._branches(self._joined(place, goal, rest), goal)
            case core.Negation(inner, barrier, term):
                self._shared(place, term, rest)
                height = self._height(place, barrier, 1)
                self._choice(place, rest, place.k)
                self._sequence(replace(place, loop=None), [*core.steps(inner), Commit(height), core.FAILURE])
            case core.Opaque(inner, barrier):
                self._height(place, barrier, 0)
                self._sequence(place, [*core.steps(inner), *rest])
            case core.Findall():
                self._findall(place, goal, rest)
            case core.NotCallable(term):
                error = self._module.namespace.name("E", type_error)
                place.function.emit(f'raise {error}("callable", {build(place.function, place.scope, term)})')

    def _call(self, place: Place, name: str, args: tuple[Term, ...], rest: Sequence[Step]) -> None:
        function, scope = place.function, place.scope
        op, target = self._resolve(name, len(args))
        if op == core.CALL and args and target.rows is not None and target.tabled is None:
            self._call_rows(place, name, args, rest, target)
        parts = [build(function, scope, arg) for arg in args]
        if not rest and place.loop is not None and (name, len(args)) == self.key:
            place.loop(parts)
            return
        k = self._continuation(place, rest)
        namespace = self._module.namespace
        if op == core.CALL:
            predicate = namespace.name("P", target)
            if not target.defined:
                function.emit(f"if not {predicate}.defined:")
                function.emit(f" return m.undefined({predicate}, ({', '.join([*parts, ''])}), {k})")
            function.emit(f"return ({', '.join([f'{predicate}.entry, 0, None', *parts, k])})")
        elif op == core.CONTROL:
            function.emit(f"return {namespace.name('F', target)}(m, ({', '.join([*parts, ''])}), {k})")
        else:
            if target in core.QUICK:
                parts = self._settle_quickly(function, core.QUICK[target], parts, k)
            arguments = ", ".join(["m", *parts])
            function.emit(f"return start_generator(m, {namespace.name('F', target)}({arguments}), {k})")

    def _settle_quickly(self, function: Function, quick: Any, parts: Sequence[str], k: str) -> list[str]:
        """Emit the quick test that decides most calls of a builtin; return its arguments as locals."""
        names = [function.local() for _ in parts]
        function.emit(f"{', '.join([*names, ''])} = {', '.join([*parts, ''])}")
        settled = function.local("b")
        arguments = ", ".join(["m", *names])
        function.emit(f"{settled} = {self._module.namespace.name('Q', quick)}({arguments})")
        function.emit(f"if {settled}: return {k}")
        function.emit(f"if {settled} is False: return FAIL")
        return names

    def _call_rows(
        self, place: Place, name: str, args: tuple[Term, ...], rest: Sequence[Step], target: Any
    ) -> None:
        """Emit a call of facts held as rows, for as long as they are; the code after it is for later."""
        scope, predicate = place.scope, self._module.namespace.name("P", target)
        asked = Struct(name, args)
        after = variables_of(rest)
        live = [each for each in core.term_variables(make_list([asked, *after])) if each in scope.names]
        live += self._heights_of(rest, scope.names)
        names = list(dict.fromkeys(scope.names[variable] for variable in live))
        loop = self._module.function()
        inner = Place(loop, Scope({variable: scope.names[variable] for variable in live}), lambda: None)
        loop.about(asked, self._clause, inner.scope)
        loop.begin("_", "mark", "rows", "index", *names, "k")
        loop.emit("mark = len(trail); end = len(rows)")
        with loop.block("while index < end:"):
            loop.emit("row = rows[index]; index += 1")
            counts = Counter(each for arg in args for each in core.term_variables(arg))
            wanted = set(after) | {each for each in counts if counts[each] > 1}
            emit_row_match(loop, inner.scope, args, wanted)
            state = ", ".join([f"{loop.name}, mark, rows, index", *names, "k"])
            loop.emit(f"if index < end: choices.append(({state}))")
            if rest:
                task = self._continuation(inner, rest)
                task_local = loop.local("t")
                loop.emit(f"{task_local} = {task}")
                loop.emit(f"return {task_local}[0](m, {task_local})")
            else:
                loop.emit("return k")
        loop.emit("return FAIL")
        first = deref(args[0])
        candidates = f"{predicate}.rows"
        if type(first) is not Var or first in scope.names:
            candidates = f"{predicate}.candidate_rows(deref({build(place.function, scope, first)}))"
        call = ", ".join([f"{loop.name}, 0, {candidates}, 0", *names, place.k])
        place.function.emit(f"if {predicate}.rows is not None: return {loop.name}(m, ({call}))")

    def _shared(self, place: Place, term: Term, rest: Sequence[Step]) -> None:
        """Make the variables that a control construct shares with the goals after it."""
        following = set(variables_of(rest))
        ensure(place.function, place.scope, [each for each in core.term_variables(term) if each in following])

    def _joined(self, place: Place, goal: core.Disjunction | core.IfThenElse, rest: Sequence[Step]) -> Place:
        """Return the place of the branches of a control construct, which go on with one continuation."""
        self._shared(place, goal.term, rest)
        if not rest:
            return replace(place)
        k = place.function.local("k")
        expression = self._continuation(place, rest)
        place.function.emit(f"{k} = {expression}")
        return replace(place, k=k, loop=None)

    def _branches(self, place: Place, goal: core.IfThenElse) -> None:
        function = place.function
        condition, then, otherwise, soft, barrier = goal[:5]
        if not soft and self._is_test(condition):
            before = place.scope.copy()
            test = self._test(place, core.steps(condition))
            with function.block(f"if {test}:"):
                self._sequence(replace(place), core.steps(then))
            with function.block("else:"):
                self._sequence(replace(place, scope=before), core.steps(otherwise))
            return
        # A cut in the condition leaves the choice point for the other branch.
        height = self._height(place, barrier, 1)
        # Bindings of the condition for `then` must outlive the calls between them.
        self._shared(place, condition.term, [then])
        self._choice(place, core.steps(otherwise), place.k)
        self._sequence(
            replace(place, loop=None), [*core.steps(condition), Commit(height, soft), *core.steps(then)]
        )

    def _height(self, place: Place, barrier: core.Barrier, above: int) -> Var:
        """Return a variable whose local is the number of choice points that cuts keep, here and `above`."""
        height = Var("Height")
        name = place.scope.names[height] = place.function.local("h")
        place.function.emit(f"{name} = len(choices)")
        self._heights[barrier] = height, above
        return height

    def _findall(self, place: Place, goal: core.Findall, rest: Sequence[Step]) -> None:
        function = place.function
        self._shared(place, goal.goal.term, rest)
        ensure(function, place.scope, core.term_variables(goal.template))
        answer = build(function, place.scope, goal.result)
        after = self._continuation(place, rest)
        found, k = function.local("l"), function.local("k")
        function.emit(f"{found} = []")
        function.emit(f"choices.append(begin_findall(m, {found}, {answer}, {after}))")
        function.emit(f"{k} = (collect, {build(function, place.scope, goal.template)}, {found}, None)")
        inner = replace(place, k=k, loop=None)
        self._height(inner, goal.barrier, 0)
        self._sequence(inner, core.steps(goal.goal))

    def _is_inline(self, goal: core.Goal) -> bool:
        """Return whether a goal can be emitted in place."""
        if type(goal) is core.IfThenElse:
            parts = (*core.steps(goal.then), *core.steps(goal.otherwise))
            return not goal.soft and self._is_test(goal.condition) and all(map(self._is_inline, parts))
        return type(goal) is core.Cut or self._is_simple(goal)

    def _is_test(self, goal: core.Goal) -> bool:
        """Return whether a goal is a conjunction of simple ones."""
        return all(map(self._is_simple, core.steps(goal)))

    def _is_simple(self, goal: core.Goal) -> bool:
        """Return whether a goal is one test, unification or deterministic builtin."""
        match goal:
            case core.Call(name, args):
                return self._resolve(name, len(args))[0] == core.DET
            case core.Negation(inner):
                return self._is_test(inner)
        return type(goal) is core.Truth

    def _inline(self, place: Place, goal: Step, rest: Sequence[Step]) -> None:
        function, scope = place.function, place.scope
        self._about(function, goal, scope)
        match goal:
            case core.Truth(True):
                return
            case core.Truth(False):
                place.fail()
            case Commit(height, True):
                function.emit(f"soft_cut(choices, {scope.names[height]})")
            case Commit(height):
                self._emit_cut(place, height, 0)
            case core.Cut(barrier):
                self._emit_cut(place, *self._heights[barrier])
            case core.IfThenElse():
                self._inline_branches(place, goal, rest)
            case core.Call("=", (left, right)):
                emit_unify(function, scope, left, right, place.fail)
            case core.Call("is", (left, right)):
                emit_is(function, scope, left, right, place.fail)
            case _:
                test = self._simple_test(place, goal)
                with function.block(f"if not ({test}):"):
                    place.fail()

    def _emit_cut(self, place: Place, height: Var, above: int) -> None:
        name = place.scope.names[height]
        left = f"{name} + {above}" if above else name
        place.function.emit(f"if len(choices) > {left}: cut(m, {left})")

    def _inline_branches(self, place: Place, goal: core.IfThenElse, rest: Sequence[Step]) -> None:
        """Emit an if-then-else whose parts are all in place: the code continues after it."""
        function, scope = place.function, place.scope
        following = set(variables_of(rest))
        escaping = [
            each for each in core.term_variables(goal.term) if each not in scope.names and each in following
        ]
        targets = {variable: function.local("v") for variable in escaping}
        before = scope.copy()
        test = self._test(place, core.steps(goal.condition))
        function.emit(f"if {test}:")
        self._inline_branch(replace(place), goal.then, rest, targets)
        function.emit("else:")
        self._inline_branch(replace(place, scope=before.copy()), goal.otherwise, rest, targets)
        place.scope = before
        place.scope.names.update(targets)

    def _inline_branch(
        self, place: Place, branch: core.Goal, rest: Sequence[Step], targets: dict[Var, str]
    ) -> None:
        function = place.function
        function.indent += 1
        goals = core.steps(branch)
        for index, goal in enumerate(goals):
            self._inline(place, goal, [*goals[index + 1 :], *rest])
        for variable, target in targets.items():
            known = place.scope.names.get(variable)
            function.emit(f"{target} = {known or 'Var()'}")
        function.emit("pass")
        function.indent -= 1

    def _test(self, place: Place, goals: Sequence[core.Goal]) -> str:
        """Return the lines before a condition, and its expression; it leaves no bindings if it is false."""
        function = place.function
        if len(goals) == 1 and self._is_pure(goals[0]):
            return self._simple_test(place, goals[0])
        result, mark = self._all_hold(place, goals, True)
        function.emit(f"if not {result} and len(trail) > {mark}: undo(trail, {mark})")
        return result

    def _all_hold(self, place: Place, goals: Sequence[core.Goal], value: bool) -> tuple[str, str]:
        """Emit what sets a local to `value` if all goals hold, else to its contrary.

        Return that local, and the one with the trail's length before.
        """
        function = place.function
        result, mark = function.local("b"), function.local("w")
        function.emit(f"{result} = {not value}")
        function.emit(f"{mark} = len(trail)")
        depth = function.indent
        for goal in goals:
            function.emit(f"if {self._simple_test(place, goal)}:")
            function.indent += 1
        function.emit(f"{result} = {value}")
        function.indent = depth
        return result, mark

    def _is_pure(self, goal: core.Goal) -> bool:
        """Return whether a simple goal surely binds nothing."""
        match goal:
            case core.Call(name, (_,)):
                return name in _KINDS or name in _GROUPS or name in _PURE
            case core.Call(name, args):
                return len(args) > 0 and (name in core.COMPARISONS or name in _PURE)
        return type(goal) is core.Truth

    def _simple_test(self, place: Place, goal: core.Goal) -> str:
        """Return the lines before, and the expression of, one simple goal."""
        function, scope = place.function, place.scope
        self._about(function, goal, scope)
        match goal:
            case core.Truth(holds):
                return str(holds)
            case core.Negation():
                return self._negated_test(place, goal)
            case core.Call(name, (arg,)) if name in _KINDS or name in _GROUPS:
                local = function.local()
                function.emit(f"{local} = {build(function, scope, arg)}")
                emit_deref(function, local)
                check = f"is {_KINDS[name]}" if name in _KINDS else _GROUPS[name]
                return f"type({local}) {check}"
            case core.Call("is", (result, expression)):
                return self._is_test_of_value(place, result, expression)
            case core.Call("=", (left, right)):
                return self._unification_test(place, left, right)
            case core.Call(name, args):
                if len(args) == 2 and name in core.COMPARISONS:
                    return emit_comparison(function, scope, name, args)
                parts = ["m", *(build(function, scope, arg) for arg in args)]
                target = self._resolve(name, len(args))[1]
                return f"{self._module.namespace.name('F', target)}({', '.join(parts)})"
        raise AssertionError(f"{goal} is not simple")

    def _is_test_of_value(self, place: Place, result: Term, expression: Term) -> str:
        result = deref(result)
        if type(result) is Var and result not in place.scope.names:
            emit_is(place.function, place.scope, result, expression, place.give_up)
            return "True"
        ensure(place.function, place.scope, core.term_variables(result))
        name = place.function.local("v")
        value = Var()
        emit_is(place.function, place.scope, value, expression, place.give_up)
        place.function.emit(f"{name} = {place.scope.names[value]}")
        return f"unify({build(place.function, place.scope, result)}, {name}, trail)"

    def _unification_test(self, place: Place, left: Term, right: Term) -> str:
        function, scope = place.function, place.scope
        left, right = deref(left), deref(right)
        for variable, other in ((left, right), (right, left)):
            if type(variable) is Var and variable not in scope.names and variable is not other:
                if variable in core.term_variables(other):
                    continue
                expression = build(function, scope, other)
                name = scope.names[variable] = function.local("v")
                function.emit(f"{name} = {expression}")
                return "True"
        return f"unify({build(function, scope, left)}, {build(function, scope, right)}, trail)"

    def _negated_test(self, place: Place, goal: core.Negation) -> str:
        """Return the expression of a negation, whose bindings are always undone."""
        function = place.function
        goals = core.steps(goal.goal)
        # Outer variables that occur here first must exist outside, too.
        ensure(function, place.scope, core.term_variables(goal.term))
        inner = replace(place, scope=place.scope.copy())
        if len(goals) == 1 and self._is_pure(goals[0]):
            return f"not ({self._simple_test(inner, goals[0])})"
        result, mark = self._all_hold(inner, goals, False)
        function.emit(f"if len(trail) > {mark}: undo(trail, {mark})")
        return result


def variables_of(goals: Sequence[Step]) -> list[Var]:
    """Return the variables of goals, in order of appearance."""
    return core.term_variables(make_list([goal.term for goal in goals if type(goal) is not Commit]))  # type: ignore[union-attr]
