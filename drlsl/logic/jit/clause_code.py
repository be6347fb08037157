"""Code for the bodies of clauses, in continuation-passing style.

Goals that need no continuation of their own (tests, arithmetic, unification, deterministic builtins, and the
conditions and branches made of them) are emitted in place. Any other goal ends the function: it is returned
to the trampoline as a task, with what follows it as a new function and the variables that this still needs.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass, replace
from typing import Any

from drlsl.logic.core import CALL, CONTROL, DET, QUICK, Resolver, check_body, joined, term_variables
from drlsl.logic.errors import PrologError
from drlsl.logic.jit.code_writer import Function, Module, Scope, build, conjuncts, ensure, is_atom
from drlsl.logic.jit.fact_rows import emit_row_match
from drlsl.logic.jit.guards import Guard
from drlsl.logic.jit.inline_arithmetic import COMPARISONS, emit_comparison, emit_is
from drlsl.logic.jit.term_matching import emit_deref, emit_unify
from drlsl.logic.terms import TRUE, Atom, Struct, Term, Var, deref, make_list

_FAIL = Atom("fail")
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


@dataclass
class Place:
    """Where code is being emitted, and what holds there.

    Attributes:
        function: the function under construction.
        scope: what is known of the clause's variables.
        fail: emits what to do when a goal fails.
        k: the local with the continuation.
        pending: emits the choice point for the clauses left to try, as long as that has been put off.
        loop: emits a last call of the predicate itself as a jump to its beginning, where that is possible.
    """

    function: Function
    scope: Scope
    fail: Callable[[], None]
    k: str = "k"
    pending: Callable[[], None] | None = None
    loop: Callable[[Sequence[str]], None] | None = None

    def commit(self) -> None:
        """Leave the choice point for the clauses left to try."""
        if self.pending is not None:
            self.pending()
            self.pending = None
            self.fail = self.give_up

    def give_up(self) -> None:
        """Emit the failure of the whole call."""
        self.function.emit("return FAIL")


class BodyEmitter:
    """Emits the bodies of one predicate's clauses."""

    def __init__(self, module: Module, linker: Resolver, key: tuple[str, int]) -> None:
        self._module = module
        self._resolve = linker.resolve
        self.key = key
        self._clause: Any = None

    def emit_clause(self, place: Place, clause: Any, height: Var) -> None:
        """Emit a clause's body; cuts in it cut back to the height in the local of `height`."""
        self._clause = clause
        check_body(joined(clause.body), clause.body)
        self._sequence(place, conjuncts(with_cuts(clause.body, Struct("$cut", (height, 0)))), height)

    def is_guard(self, goal: Term) -> bool:
        """Whether a goal is a test that is sure to bind nothing."""
        return self._is_simple(goal) and self._is_pure(goal)

    def emit_guarded(self, place: Place, clause: Any, height: Var, guard: Guard) -> None:
        """Emit a clause's body, with the code going on behind it where the guard does not hold.

        What the first test makes known of the scope is known there too.
        """
        self._clause = clause
        check_body(joined(clause.body), clause.body)
        tests, goals = guard
        function = place.function
        depth = function.indent
        inner = place
        for test in tests:
            function.emit(f"if {self._simple_test(inner, test)}:")
            function.indent += 1
            inner = replace(inner, scope=inner.scope.copy())
        cut = Struct("$cut", (height, 0))
        self._sequence(inner, [with_cuts(goal, cut) for goal in goals])
        function.indent = depth

    # ------------------------------------------------------------------ sequences

    def _sequence(self, place: Place, goals: list[Term], own: Var | None = None) -> None:
        """Emit goals one after the other, and after the last of them the continuation."""
        for index, goal in enumerate(goals):
            rest = goals[index + 1 :]
            goal = deref(goal)
            place.function.about(goal, self._clause, place.scope)
            if place.pending is not None and type(goal) is Struct and _is_cut(goal) and goal.args[0] is own:
                # Nothing has been left to cut but the clauses not tried yet.
                place.pending = None
                place.fail = place.give_up
                continue
            if self._is_inline(goal):
                if place.pending is not None and has_cut(goal):
                    place.commit()
                self._inline(place, goal, rest)
                continue
            place.commit()
            self._leave(place, goal, rest)
            return
        place.commit()
        place.function.emit(f"return {place.k}")

    def _continuation(self, place: Place, rest: list[Term], k: str | None = None) -> str:
        """The expression of a task that goes on with `rest`."""
        if not rest:
            return k or place.k
        function = self._module.function()
        expression, inner = self._capture(place, function, rest, k or place.k, first="")
        self._sequence(inner, rest)
        return expression

    def _capture(
        self, place: Place, function: Function, goals: list[Term], k: str, first: str
    ) -> tuple[str, Place]:
        """A task, or with `first` a choice point, that runs a function with the variables its goals need."""
        scope = place.scope
        live = [variable for variable in term_variables(make_list(goals)) if variable in scope.names]
        names = list(dict.fromkeys(scope.names[variable] for variable in live))
        inner = Scope({variable: scope.names[variable] for variable in live})
        for variable in live:
            number = scope.numbers.get(variable)
            if number is not None and number in names:
                inner.numbers[variable] = number
        inner.integers = scope.integers & set(names)
        function.commits = any(_cuts(goal, inner.names) for goal in goals)
        function.begin(*(("_", "_") if first else ("_",)), *names, "k")
        start = f"{function.name}, {first}, " if first else f"{function.name}, "
        expression = f"({start}{', '.join([*names, k])})"
        return expression, Place(function, inner, lambda: function.emit("return FAIL"))

    def _choice(self, place: Place, goals: list[Term], k: str) -> None:
        """Emit a choice point that goes on with other goals."""
        function = self._module.function()
        expression, inner = self._capture(place, function, goals, k, first="len(trail)")
        place.function.emit(f"choices.append({expression})")
        self._sequence(inner, goals)

    # ------------------------------------------------------------------ goals that end the function

    def _leave(self, place: Place, goal: Term, rest: list[Term]) -> None:
        """Emit a goal that needs a continuation, and what follows it."""
        if type(goal) is Var:
            goal = Struct("call", (goal,))
        name = goal.name if isinstance(goal, (Struct, Atom)) else ""
        args = goal.args if type(goal) is Struct else ()
        if len(args) == 2 and name in (";", "->", "*->"):
            self._leave_control(place, goal, rest)
        elif len(args) == 1 and name in ("\\+", "not"):
            self._shared(place, goal, rest)
            self._negation(place, args[0], rest)
        elif len(args) == 1 and name in ("once", "ignore", "call"):
            self._opaque(place, name, args[0], rest)
        elif len(args) == 2 and name == "forall":
            inner = Struct("\\+", (Struct(",", (args[0], Struct("\\+", (args[1],)))),))
            self._leave(place, inner, rest)
        elif len(args) == 3 and name == "findall" and _can_inline(args[1]):
            self._findall(place, args, rest)
        else:
            self._call(place, name, args, rest)

    def _call(self, place: Place, name: str, args: Sequence[Term], rest: list[Term]) -> None:
        function, scope = place.function, place.scope
        op, target = self._resolve(name, len(args))
        if op == CALL and args and target.rows is not None and target.tabled is None:
            self._call_rows(place, name, args, rest, target)
        parts = [build(function, scope, arg) for arg in args]
        if not rest and place.loop is not None and (name, len(args)) == self.key:
            place.loop(parts)
            return
        k = self._continuation(place, rest)
        namespace = self._module.namespace
        if op == CALL:
            predicate = namespace.name("P", target)
            if not target.defined:
                function.emit(f"if not {predicate}.defined:")
                function.emit(f" return m.undefined({predicate}, ({', '.join([*parts, ''])}), {k})")
            function.emit(f"return ({', '.join([f'{predicate}.entry, 0, None', *parts, k])})")
        elif op == CONTROL:
            function.emit(f"return {namespace.name('F', target)}(m, ({', '.join([*parts, ''])}), {k})")
        else:
            if target in QUICK:
                parts = self._settle_quickly(function, QUICK[target], parts, k)
            arguments = ", ".join(["m", *parts])
            function.emit(f"return start_generator(m, {namespace.name('F', target)}({arguments}), {k})")

    def _settle_quickly(self, function: Function, quick: Any, parts: Sequence[str], k: str) -> list[str]:
        """Ask first what settles most calls of a builtin; returns its arguments as locals."""
        names = [function.local() for _ in parts]
        function.emit(f"{', '.join([*names, ''])} = {', '.join([*parts, ''])}")
        settled = function.local("b")
        arguments = ", ".join(["m", *names])
        function.emit(f"{settled} = {self._module.namespace.name('Q', quick)}({arguments})")
        function.emit(f"if {settled}: return {k}")
        function.emit(f"if {settled} is False: return FAIL")
        return names

    def _call_rows(
        self, place: Place, name: str, args: Sequence[Term], rest: list[Term], target: Any
    ) -> None:
        """A call of facts held as rows, for as long as they are: what follows is for when they are not."""
        scope, predicate = place.scope, self._module.namespace.name("P", target)
        goals = [Struct(name, tuple(args)), *rest]
        live = [variable for variable in term_variables(make_list(goals)) if variable in scope.names]
        names = list(dict.fromkeys(scope.names[variable] for variable in live))
        loop = self._module.function()
        inner = Place(loop, Scope({variable: scope.names[variable] for variable in live}), lambda: None)
        loop.about(goals[0], self._clause, inner.scope)
        loop.begin("_", "mark", "rows", "index", *names, "k")
        loop.emit("mark = len(trail); end = len(rows)")
        loop.emit("while index < end:")
        loop.indent += 1
        loop.emit("row = rows[index]; index += 1")
        counts = Counter(each for arg in args for each in term_variables(arg))
        wanted = set(term_variables(make_list(rest))) | {each for each in counts if counts[each] > 1}
        emit_row_match(loop, inner.scope, args, wanted)
        state = ", ".join([f"{loop.name}, mark, rows, index", *names, "k"])
        loop.emit(f"if index < end: choices.append(({state}))")
        if rest:
            task = self._continuation(inner, rest)
            after = loop.local("t")
            loop.emit(f"{after} = {task}")
            loop.emit(f"return {after}[0](m, {after})")
        else:
            loop.emit("return k")
        loop.indent -= 1
        loop.emit("return FAIL")
        first = deref(args[0])
        candidates = f"{predicate}.rows"
        if type(first) is not Var or first in scope.names:
            candidates = f"{predicate}.candidate_rows(deref({build(place.function, scope, first)}))"
        call = ", ".join([f"{loop.name}, 0, {candidates}, 0", *names, place.k])
        place.function.emit(f"if {predicate}.rows is not None: return {loop.name}(m, ({call}))")

    def _shared(self, place: Place, goal: Term, rest: list[Term]) -> None:
        """Make the variables that a control construct shares with what follows it."""
        following = set(term_variables(make_list(rest)))
        ensure(place.function, place.scope, [each for each in term_variables(goal) if each in following])

    def _join(self, place: Place, goal: Term, rest: list[Term]) -> str:
        """The local of a continuation that several branches of a control construct go on with."""
        self._shared(place, goal, rest)
        if not rest:
            return place.k
        k = place.function.local("k")
        expression = self._continuation(place, rest)
        place.function.emit(f"{k} = {expression}")
        return k

    def _leave_control(self, place: Place, goal: Term, rest: list[Term]) -> None:
        assert type(goal) is Struct
        k = self._join(place, goal, rest)
        inner = replace(place, k=k, loop=None if rest else place.loop)
        left = deref(goal.args[0])
        if goal.name == ";" and type(left) is Struct and len(left.args) == 2 and left.name in ("->", "*->"):
            self._branches(inner, left, deref(goal.args[1]))
        elif goal.name == ";":
            self._choice(inner, conjuncts(goal.args[1]), k)
            self._sequence(inner, conjuncts(left))
        else:
            self._branches(inner, goal, _FAIL)

    def _branches(self, place: Place, condition_then: Struct, otherwise: Term) -> None:
        condition, then = condition_then.args
        function = place.function
        if condition_then.name == "->" and self._is_test(condition):
            before = place.scope.copy()
            test = self._test(place, conjuncts(condition))
            function.emit(f"if {test}:")
            function.indent += 1
            self._sequence(replace(place), conjuncts(then))
            function.indent -= 1
            function.emit("else:")
            function.indent += 1
            self._sequence(replace(place, scope=before), conjuncts(otherwise))
            function.indent -= 1
            return
        height = self._height(place)
        # What the condition binds for `then` must outlive the calls between them.
        used = set(term_variables(then))
        ensure(function, place.scope, [each for each in term_variables(condition) if each in used])
        self._choice(place, conjuncts(otherwise), place.k)
        commit = Struct("$cut" if condition_then.name == "->" else "$soft_cut", (height, 0))
        inner = replace(place, loop=None)
        guarded = with_cuts(condition, Struct("$cut", (height, 1)))
        self._sequence(inner, [*conjuncts(guarded), commit, *conjuncts(then)])

    def _height(self, place: Place) -> Var:
        """A variable whose local is the number of choice points here."""
        height = Var("Height")
        name = place.scope.names[height] = place.function.local("h")
        place.function.emit(f"{name} = len(choices)")
        return height

    def _negation(self, place: Place, goal: Term, rest: list[Term]) -> None:
        height = self._height(place)
        self._choice(place, rest, place.k)
        guarded = with_cuts(deref(goal), Struct("$cut", (height, 1)))
        commit = Struct("$cut", (height, 0))
        self._sequence(replace(place, loop=None), [*conjuncts(guarded), commit, _FAIL])

    def _opaque(self, place: Place, name: str, goal: Term, rest: list[Term]) -> None:
        if not _can_inline(goal):
            self._call(place, name, (goal,), rest)
        elif name == "once":
            self._leave(place, Struct("->", (goal, TRUE)), rest)
        elif name == "ignore":
            self._leave(place, Struct(";", (Struct("->", (goal, TRUE)), TRUE)), rest)
        else:
            height = self._height(place)
            self._sequence(place, [*conjuncts(with_cuts(deref(goal), Struct("$cut", (height, 0)))), *rest])

    def _findall(self, place: Place, args: Sequence[Term], rest: list[Term]) -> None:
        template, goal, result = args
        function = place.function
        self._shared(place, goal, rest)
        ensure(function, place.scope, term_variables(template))
        answer = build(function, place.scope, result)
        after = self._continuation(place, rest)
        found, k = function.local("l"), function.local("k")
        function.emit(f"{found} = []")
        function.emit(f"choices.append(begin_findall(m, {found}, {answer}, {after}))")
        function.emit(f"{k} = (collect, {build(function, place.scope, template)}, {found}, None)")
        inner = replace(place, k=k, loop=None)
        height = self._height(inner)
        self._sequence(inner, conjuncts(with_cuts(deref(goal), Struct("$cut", (height, 0)))))

    # ------------------------------------------------------------------ goals in place

    def _is_inline(self, goal: Term) -> bool:
        """Whether a goal can be emitted in place."""
        goal = deref(goal)
        if type(goal) is Struct and len(goal.args) == 2:
            if goal.name == ",":
                return self._is_inline(goal.args[0]) and self._is_inline(goal.args[1])
            if goal.name == ";":
                left = deref(goal.args[0])
                return (
                    type(left) is Struct
                    and left.name == "->"
                    and len(left.args) == 2
                    and self._is_inline(left)
                    and self._is_inline(goal.args[1])
                )
            if goal.name == "->":
                return self._is_test(goal.args[0]) and self._is_inline(goal.args[1])
        return _is_cut(goal) or self._is_simple(goal)

    def _is_test(self, goal: Term) -> bool:
        """Whether a goal is a conjunction of simple ones."""
        return all(self._is_simple(part) for part in conjuncts(goal))

    def _is_simple(self, goal: Term) -> bool:
        """Whether a goal is one test, unification or deterministic builtin."""
        goal = deref(goal)
        if type(goal) is Atom:
            return goal.name in ("true", "fail", "false") or self._resolve(goal.name, 0)[0] == DET
        if type(goal) is not Struct:
            return False
        if len(goal.args) == 1 and goal.name in ("\\+", "not"):
            return self._is_test(goal.args[0])
        return not _is_cut(goal) and self._resolve(goal.name, len(goal.args))[0] == DET

    def _inline(self, place: Place, goal: Term, rest: list[Term]) -> None:
        function = place.function
        function.about(goal, self._clause, place.scope)
        if goal is TRUE:
            return
        if type(goal) is Struct and len(goal.args) == 2:
            if goal.name == ",":
                second = conjuncts(goal.args[1])
                self._inline(place, deref(goal.args[0]), [*second, *rest])
                for index, part in enumerate(second):
                    self._inline(place, deref(part), [*second[index + 1 :], *rest])
                return
            if goal.name in (";", "->"):
                self._inline_branches(place, goal, rest)
                return
            if goal.name == "=":
                emit_unify(function, place.scope, goal.args[0], goal.args[1], place.fail)
                return
            if goal.name == "is":
                emit_is(function, place.scope, goal.args[0], goal.args[1], place.fail)
                return
            if _is_cut(goal):
                self._emit_cut(place, goal)
                return
        if type(goal) is Atom and goal.name in ("fail", "false"):
            place.fail()
            return
        test = self._simple_test(place, goal)
        function.emit(f"if not ({test}):")
        function.indent += 1
        place.fail()
        function.indent -= 1

    def _emit_cut(self, place: Place, goal: Struct) -> None:
        height = place.scope.names[goal.args[0]]  # type: ignore[index]  # a variable made by _height
        if goal.name == "$soft_cut":
            place.function.emit(f"soft_cut(choices, {height})")
            return
        above = f"{height} + 1" if goal.args[1] else height
        place.function.emit(f"if len(choices) > {above}: cut(m, {above})")

    def _inline_branches(self, place: Place, goal: Struct, rest: list[Term]) -> None:
        """If-then-else whose parts are all in place: the code goes on behind it."""
        function, scope = place.function, place.scope
        condition_then, otherwise = (goal.args[0], goal.args[1]) if goal.name == ";" else (goal, _FAIL)
        pair = deref(condition_then)
        assert type(pair) is Struct
        following = set(term_variables(make_list(rest)))
        escaping = [each for each in term_variables(goal) if each not in scope.names and each in following]
        targets = {variable: function.local("v") for variable in escaping}
        before = scope.copy()
        test = self._test(place, conjuncts(pair.args[0]))
        function.emit(f"if {test}:")
        self._inline_branch(replace(place), pair.args[1], rest, targets)
        function.emit("else:")
        self._inline_branch(replace(place, scope=before.copy()), otherwise, rest, targets)
        place.scope = before
        place.scope.names.update(targets)

    def _inline_branch(self, place: Place, branch: Term, rest: list[Term], targets: dict[Var, str]) -> None:
        function = place.function
        function.indent += 1
        goals = conjuncts(branch)
        for index, goal in enumerate(goals):
            self._inline(place, deref(goal), [*goals[index + 1 :], *rest])
        for variable, target in targets.items():
            known = place.scope.names.get(variable)
            function.emit(f"{target} = {known or 'Var()'}")
        function.emit("pass")
        function.indent -= 1

    # ------------------------------------------------------------------ tests

    def _test(self, place: Place, goals: list[Term]) -> str:
        """The lines before, and the expression of, a condition; it leaves no bindings when it is false."""
        function = place.function
        if len(goals) == 1 and self._is_pure(goals[0]):
            return self._simple_test(place, deref(goals[0]))
        result, mark = function.local("b"), function.local("w")
        function.emit(f"{result} = False")
        function.emit(f"{mark} = len(trail)")
        depth = function.indent
        for goal in goals:
            function.emit(f"if {self._simple_test(place, deref(goal))}:")
            function.indent += 1
        function.emit(f"{result} = True")
        function.indent = depth
        function.emit(f"if not {result} and len(trail) > {mark}: undo(trail, {mark})")
        return result

    def _is_pure(self, goal: Term) -> bool:
        """Whether a simple goal is sure to bind nothing."""
        goal = deref(goal)
        if type(goal) is not Struct:
            return type(goal) is Atom and goal.name in ("true", "fail", "false")
        if len(goal.args) == 1:
            return goal.name in _KINDS or goal.name in _GROUPS or goal.name in _PURE
        return goal.name in COMPARISONS or goal.name in _PURE

    def _simple_test(self, place: Place, goal: Term) -> str:
        """The lines before, and the expression of, one simple goal."""
        function, scope = place.function, place.scope
        function.about(goal, self._clause, scope)
        if type(goal) is Atom:
            if goal.name in ("true", "fail", "false"):
                return str(goal is TRUE)
            return f"{self._module.namespace.name('F', self._resolve(goal.name, 0)[1])}(m)"
        assert type(goal) is Struct
        if len(goal.args) == 1 and (goal.name in _KINDS or goal.name in _GROUPS):
            name = function.local()
            function.emit(f"{name} = {build(function, scope, goal.args[0])}")
            emit_deref(function, name)
            check = f"is {_KINDS[goal.name]}" if goal.name in _KINDS else _GROUPS[goal.name]
            return f"type({name}) {check}"
        if len(goal.args) == 1 and goal.name in ("\\+", "not"):
            return self._negated_test(place, goal.args[0])
        if len(goal.args) == 2:
            if goal.name in COMPARISONS:
                return emit_comparison(function, scope, goal)
            if goal.name == "is":
                return self._is_test_of_value(place, goal)
            if goal.name == "=":
                return self._unification_test(place, goal)
        parts = ["m", *(build(function, scope, arg) for arg in goal.args)]
        target = self._resolve(goal.name, len(goal.args))[1]
        return f"{self._module.namespace.name('F', target)}({', '.join(parts)})"

    def _is_test_of_value(self, place: Place, goal: Struct) -> str:
        result = deref(goal.args[0])
        if type(result) is Var and result not in place.scope.names:
            emit_is(place.function, place.scope, result, goal.args[1], place.give_up)
            return "True"
        ensure(place.function, place.scope, term_variables(result))
        name = place.function.local("v")
        value = Var()
        emit_is(place.function, place.scope, value, goal.args[1], place.give_up)
        place.function.emit(f"{name} = {place.scope.names[value]}")
        return f"unify({build(place.function, place.scope, result)}, {name}, trail)"

    def _unification_test(self, place: Place, goal: Struct) -> str:
        function, scope = place.function, place.scope
        left, right = deref(goal.args[0]), deref(goal.args[1])
        for variable, other in ((left, right), (right, left)):
            if type(variable) is Var and variable not in scope.names and variable is not other:
                if variable in term_variables(other):
                    continue
                expression = build(function, scope, other)
                name = scope.names[variable] = function.local("v")
                function.emit(f"{name} = {expression}")
                return "True"
        return f"unify({build(function, scope, left)}, {build(function, scope, right)}, trail)"

    def _negated_test(self, place: Place, goal: Term) -> str:
        """The expression of a negation; what it binds is undone either way."""
        function = place.function
        inner = replace(place, scope=place.scope.copy())
        goals = conjuncts(goal)
        # Variables of outside that occur here first must exist outside too.
        ensure(function, place.scope, term_variables(goal))
        inner.scope = place.scope.copy()
        if len(goals) == 1 and self._is_pure(goals[0]):
            return f"not ({self._simple_test(inner, deref(goals[0]))})"
        result, mark = function.local("b"), function.local("w")
        function.emit(f"{mark} = len(trail)")
        function.emit(f"{result} = True")
        depth = function.indent
        for part in goals:
            function.emit(f"if {self._simple_test(inner, deref(part))}:")
            function.indent += 1
        function.emit(f"{result} = False")
        function.indent = depth
        function.emit(f"if len(trail) > {mark}: undo(trail, {mark})")
        return result


def with_cuts(body: Term, cut: Struct) -> Term:
    """A body with each cut of its own replaced; the inside of conditions and negations is left alone."""
    body = deref(body)
    if type(body) is Atom:
        return cut if body.name == "!" else body
    if type(body) is not Struct or len(body.args) != 2:
        return body
    if body.name == ",":
        parts = [with_cuts(part, cut) for part in conjuncts(body)]
        result = parts[-1]
        for part in reversed(parts[:-1]):
            result = Struct(",", (part, result))
        return result
    if body.name == ";":
        return Struct(";", (with_cuts(body.args[0], cut), with_cuts(body.args[1], cut)))
    if body.name in ("->", "*->"):
        return Struct(body.name, (body.args[0], with_cuts(body.args[1], cut)))
    return body


def _is_cut(goal: Term) -> bool:
    return type(goal) is Struct and goal.name in ("$cut", "$soft_cut") and len(goal.args) == 2


def has_cut(goal: Term) -> bool:
    """Whether a body has a cut of its own clause in it, before or after `with_cuts`."""
    todo = [goal]
    while todo:
        term = deref(todo.pop())
        if _is_cut(term) or is_atom(term, "!"):
            return True
        if type(term) is Struct and len(term.args) == 2 and term.name in (",", ";", "->", "*->"):
            todo.extend(term.args)
    return False


def _cuts(goal: Term, known: Container[Any]) -> bool:
    """Whether a goal, after `with_cuts`, removes choice points that were made before it."""
    todo = [goal]
    while todo:
        term = deref(todo.pop())
        if type(term) is Struct and _is_cut(term) and term.args[0] in known:
            return True
        if type(term) is Struct and len(term.args) == 2 and term.name in (",", ";", "->", "*->"):
            todo.extend(term.args)
    return False


def _can_inline(goal: Term) -> bool:
    """Whether a goal is known well enough to be emitted rather than called as a term."""
    goal = deref(goal)
    if type(goal) is Var:
        return False
    try:
        check_body(joined(goal), goal)
    except PrologError:
        return False
    return True
