"""Explain why a goal holds or fails: proof trees and reasons of failures, over a program's own clauses.

The search here is a second, small interpreter that records its steps. It expands the program's own predicates
and the control constructs; builtins, the library and deeper goals are left to the machine. Its steps are data
(`drlsl.logic.explain.explanation`), for people and for programs.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from typing import Final, NamedTuple, TypeAlias

from drlsl.logic.core import (
    CALL,
    FAILURE,
    FOUND,
    Call,
    Clause,
    Conjunction,
    Cut,
    Derived,
    Disjunction,
    Goal,
    Host,
    IfThenElse,
    Limits,
    Machine,
    Negation,
    NotCallable,
    Opaque,
    Predicate,
    Truth,
    body_of,
    callable_parts,
    conjuncts,
    copy_term,
    read_body,
    undo,
    unify,
    variant_key,
)
from drlsl.logic.errors import resource_error
from drlsl.logic.explain.explanation import Explanation, Step, shown, value
from drlsl.logic.limits import Meter, exceeded
from drlsl.logic.syntax import Span
from drlsl.logic.terms import TRUE, Term, Var, deref

MAX_DEPTH: Final = 24  # nested calls of the program's predicates that are shown
MAX_GOALS: Final = 30_000  # goals that one explanation may try
MAX_REASONS: Final = 6  # failures shown of one goal of one clause

# A generator of the proofs of a goal, one for each solution. Its value at the end is the reason of the
# failure, or None after a solution.
_Proofs: TypeAlias = Generator["_Draft", None, "_Draft | None"]
_Conjunction: TypeAlias = Generator["tuple[_Draft, ...]", None, tuple[Step, ...]]


class _Scope(NamedTuple):
    """Shared by the goals of one clause: its variables by name, and the terms in their place in this call."""

    names: dict[str, Var]
    labels: dict[int, str]  # names of the variables of the clause as it is stored, by id
    renaming: dict[Var, Term] | None  # None where goals are proved as they are written


class _Goal(NamedTuple):
    """A goal to prove, as its clause has it, and the call that it belongs to."""

    goal: Goal
    scope: _Scope

    @property
    def term(self) -> Term:
        """The goal as it is called."""
        return self.instance(self.goal.term)

    def instance(self, term: Term) -> Term:
        """Return a term of the clause as it is in this call."""
        renaming = self.scope.renaming
        return term if renaming is None else copy_term(term, renaming)

    def part(self, goal: Goal) -> _Goal:
        """Return a goal inside this one."""
        return _Goal(goal, self.scope)

    def conjuncts(self) -> list[_Goal]:
        """Return the goals of a conjunction in order."""
        return [self.part(goal) for goal in conjuncts(self.goal)]


class _Draft(NamedTuple):
    """A step without its text, which must be made while the bindings that it shows exist."""

    goal: _Goal
    holds: bool
    kind: str
    children: tuple[_Draft | Step, ...] = ()
    note: str = ""
    clause: Span | None = None
    scope: _Scope | None = None  # of the clause that was used


class _Frame:
    """The clause body that a cut commits."""

    __slots__ = ("cut",)

    def __init__(self) -> None:
        self.cut = False


def explain(
    engine: Host, goal: Term, variables: dict[str, Var], *, limits: Limits, max_depth: int = MAX_DEPTH
) -> Explanation:
    """Prove a goal once and explain the proof, or explain why it fails.

    Raises:
        PrologError: The goal raised an error.
        LimitExceeded: It went beyond the limits, or tried more than `MAX_GOALS` goals.
    """
    labels = {id(variable): name for name, variable in variables.items()}
    root = _Goal(read_body(goal, meter=Meter(limits)), _Scope(variables, labels, None))
    search = _Search(engine, limits, max_depth)
    text = shown(goal, engine.operators, labels)
    proofs = search.conjunction(root.conjuncts(), _Frame(), 0)
    try:
        steps = next(proofs)
    except StopIteration as end:
        return Explanation(text, False, {}, end.value)
    except RecursionError:
        raise resource_error("recursion") from None
    try:
        return Explanation(text, True, search.bindings(root.scope), search.finish_all(steps))
    finally:
        proofs.close()


class _Search:
    """One explanation in progress."""

    def __init__(self, engine: Host, limits: Limits, max_depth: int) -> None:
        self.engine = engine
        self.limits = limits
        self.meter = Meter(limits)
        self.max_depth = max_depth
        self.tried = 0
        self.trail: list[Var] = []
        self.bodies: dict[Clause, Goal] = {}
        self.tabled: set[object] = set()  # the calls of tabled predicates that are being explained

    # The texts of steps.

    def bindings(self, scope: _Scope) -> dict[str, str | int | float]:
        """Return the values of the named variables that are bound."""
        return {
            name: value(variable, self.engine.operators)
            for name, variable in scope.names.items()
            if not name.startswith("_") and not isinstance(deref(variable), Var)
        }

    def texts(self, goal: _Goal) -> tuple[str, str]:
        """Return the goal with its present bindings, and as written in the program."""
        if goal.scope.renaming is None:
            free = goal.scope.labels
        else:
            free = {id(deref(variable)): name for name, variable in goal.scope.names.items()}
        operators = self.engine.operators
        return shown(goal.term, operators, free), shown(goal.goal.term, operators, goal.scope.labels)

    def finish(self, draft: _Draft | Step) -> Step:
        """Return the step with the present bindings of its goal and variables."""
        if isinstance(draft, Step):
            return draft
        text, source = self.texts(draft.goal)
        scope = draft.scope or (None if draft.holds else draft.goal.scope)
        bindings = {} if scope is None else self.bindings(scope)
        children = self.finish_all(draft.children)
        place = draft.goal.goal.place
        return Step(
            text, draft.holds, draft.kind, source, place, draft.clause, bindings, children, draft.note
        )

    def finish_all(self, drafts: Sequence[_Draft | Step]) -> tuple[Step, ...]:
        return tuple(map(self.finish, drafts))

    # Conjunctions.

    def conjunction(self, goals: list[_Goal], frame: _Frame, depth: int) -> _Conjunction:
        """Yield the steps of each solution; at the end, the failures of the furthest goal reached."""
        running = [self.prove(goals[0], frame, depth)]
        steps: list[_Draft] = []
        reasons = _Reasons(self)
        try:
            while running:
                del steps[len(running) - 1 :]
                try:
                    steps.append(next(running[-1]))
                except StopIteration as end:
                    running.pop()
                    reasons.add(len(running), end.value)
                    if frame.cut:
                        break
                    continue
                if len(running) < len(goals):
                    running.append(self.prove(goals[len(running)], frame, depth))
                else:
                    yield tuple(steps)
        finally:
            for proofs in reversed(running):
                proofs.close()
        return reasons.steps()

    def prove(self, goal: _Goal, frame: _Frame, depth: int) -> _Proofs:
        """Return the proofs of one goal in the body of `frame`."""
        self.tried += 1
        if self.tried > MAX_GOALS:
            raise exceeded("goals", f"{MAX_GOALS:,} goals of an explanation")
        match goal.goal:
            case Call(name, args):
                if (name, len(args)) == ("call", 1):
                    return self._known_late(goal, args[0], depth)
            case Cut():
                return self._cut(goal, frame)
            case Conjunction():
                return self._joined(goal, "all", (), goal.conjuncts(), frame, depth)
            case Disjunction(first, second):
                return self._alternatives(goal, goal.part(first), goal.part(second), frame, depth)
            case IfThenElse():
                return self._condition(goal, goal.goal, frame, depth)
            case Negation(inner):
                return self._negation(goal, goal.part(inner), depth)
            case Opaque(inner):
                return self._opaque(goal.part(inner), depth)
            case Derived((cases, action), _, term) if term.name == "forall":
                return self._forall(goal, goal.part(cases), goal.part(action), depth)
            case Derived((inner,), _, term) if term.name == "once":
                return self._first(self._opaque(goal.part(inner), depth))
            case Truth() | NotCallable():
                return self._leaf(goal, "builtin")
        return self._call(goal, *callable_parts(goal.term), depth)

    def _known_late(self, goal: _Goal, called: Term, depth: int) -> _Proofs:
        """Prove a goal that a variable is bound to by now; a cut inside is local."""
        term = goal.instance(called)
        name, args = callable_parts(term)
        inner = read_body(term, goal.goal.place, meter=self.meter)
        if type(inner) is Call and type(goal.goal.term) is Var:
            return self._call(goal, name, args, depth)
        return self._opaque(_Goal(inner, goal.scope._replace(renaming=None)), depth)

    # Control constructs.

    def _cut(self, goal: _Goal, frame: _Frame) -> _Proofs:
        yield _Draft(goal, True, "cut")
        frame.cut = True
        return None

    def _joined(
        self,
        goal: _Goal,
        kind: str,
        before: tuple[_Draft | Step, ...],
        goals: list[_Goal],
        frame: _Frame,
        depth: int,
    ) -> _Proofs:
        """Return the proofs of a conjunction as steps of one kind, after other steps."""
        return _drafts(
            self.conjunction(goals, frame, depth),
            lambda steps: _Draft(goal, True, kind, (*before, *steps)),
            lambda steps: _Draft(goal, False, kind, (*self.finish_all(before), *steps)),
        )

    def _alternatives(self, goal: _Goal, left: _Goal, right: _Goal, frame: _Frame, depth: int) -> _Proofs:
        first = yield from self._joined(left, "all", (), left.conjuncts(), frame, depth)
        if frame.cut:
            return first
        second = yield from self._joined(right, "all", (), right.conjuncts(), frame, depth)
        if first is None or second is None:
            return None
        return _Draft(goal, False, "either", (first, second))

    def _condition(self, whole: _Goal, goal: IfThenElse, frame: _Frame, depth: int) -> _Proofs:
        """Prove an if-then-else; a soft one goes on with each solution of its condition."""
        condition, then, soft = whole.part(goal.condition), whole.part(goal.then), goal.soft
        proofs = self.conjunction(condition.conjuncts(), _Frame(), depth)
        found, failure = False, None
        try:
            while not (found and not soft):
                try:
                    steps = next(proofs)
                except StopIteration as end:
                    reasons = end.value
                    break
                found = True
                given = _Draft(condition, True, "condition", steps)
                failure = yield from self._joined(whole, "if", (given,), then.conjuncts(), frame, depth)
                if frame.cut:
                    return failure
            if found:
                return failure
            failed = self.finish(_Draft(condition, False, "condition", reasons))
            if goal.otherwise is FAILURE:
                return _Draft(whole, False, "if", (failed,))
            other = whole.part(goal.otherwise)
            return (yield from self._joined(whole, "if", (failed,), other.conjuncts(), frame, depth))
        finally:
            proofs.close()

    def _negation(self, goal: _Goal, inner: _Goal, depth: int) -> _Proofs:
        r"""Yield the proof of ``\+ G`` by the failure of G; a proof of G is the reason of its failure."""
        proofs = self.conjunction(inner.conjuncts(), _Frame(), depth)
        steps: tuple[Step, ...] | None = None
        reasons: tuple[Step, ...] = ()
        try:
            steps = self.finish_all(next(proofs))
        except StopIteration as end:
            reasons = end.value
        finally:
            proofs.close()
        if steps is not None:
            return _Draft(goal, False, "negation", steps)
        yield _Draft(goal, True, "negation", reasons)
        return None

    def _forall(self, goal: _Goal, given: _Goal, action: _Goal, depth: int) -> _Proofs:
        """Yield the proof of forall/2; a case in which the action fails is the reason of its failure."""
        cases = self.conjunction(given.conjuncts(), _Frame(), depth)
        count = 0
        against: tuple[Step, ...] | None = None
        try:
            for case in cases:
                count += 1
                actions = self.conjunction(action.conjuncts(), _Frame(), depth)
                try:
                    next(actions)
                except StopIteration as end:
                    against = (*self.finish_all(case), *end.value)
                    break
                finally:
                    actions.close()
        finally:
            cases.close()
        if against is not None:
            return _Draft(goal, False, "negation", against)
        note = f"in all of {count} cases" if count else "there is no case"
        yield _Draft(goal, True, "negation", note=note)
        return None

    def _opaque(self, inner: _Goal, depth: int) -> _Proofs:
        """Prove a goal that is called: a cut inside is local."""
        return self._joined(inner, "all", (), inner.conjuncts(), _Frame(), depth)

    def _first(self, proofs: _Proofs) -> _Proofs:
        try:
            yield next(proofs)
        except StopIteration as end:
            failure: _Draft | None = end.value
            return failure
        finally:
            proofs.close()
        return None

    # Calls.

    def _call(self, goal: _Goal, name: str, args: tuple[Term, ...], depth: int) -> _Proofs:
        op, target = self.engine.linker.resolve(name, len(args))
        own = op == CALL and target.program is self.engine.program and target.defined
        if not own or depth >= self.max_depth:
            return self._leaf(goal, "goal" if own else "builtin")
        if target.rows is not None:
            return self._rows(goal, target, args)
        if target.tabled is not None:
            return self._tabled(goal, target, args, depth)
        return self._clauses(goal, target, depth)

    def _tabled(self, goal: _Goal, predicate: Predicate, args: tuple[Term, ...], depth: int) -> _Proofs:
        """Yield the proofs of a tabled predicate's call: a call inside itself is answered by the table."""
        call = predicate, variant_key(args)
        if call in self.tabled:
            return (yield from self._leaf(goal, "goal"))
        self.tabled.add(call)
        try:
            return (yield from self._clauses(goal, predicate, depth))
        finally:
            self.tabled.discard(call)

    def _leaf(self, goal: _Goal, kind: str) -> _Proofs:
        """Yield the solver's answers."""
        machine = Machine(self.engine, self.limits, self.meter)
        try:
            found = machine.solve(machine.call(goal.term, FOUND))
            if not found:
                return _Draft(goal, False, kind)
            while found:
                yield _Draft(goal, True, kind)
                found = machine.retry()
            return None
        finally:
            machine.close()

    def _rows(self, goal: _Goal, predicate: Predicate, args: tuple[Term, ...]) -> _Proofs:
        """Yield facts that were loaded in bulk."""
        rows = predicate.candidate_rows(deref(args[0])) if args else predicate.rows or []
        found = False
        mark = len(self.trail)
        try:
            for row in list(rows):
                if all(unify(arg, part, self.trail) for arg, part in zip(args, row, strict=True)):
                    found = True
                    yield _Draft(goal, True, "fact")
                undo(self.trail, mark)
        finally:
            undo(self.trail, mark)
        return None if found else _Draft(goal, False, "fact", note=_no_match(len(predicate)))

    def _clauses(self, goal: _Goal, predicate: Predicate, depth: int) -> _Proofs:
        frame = _Frame()
        attempts: list[_Draft] = []
        unlike = 0
        found = False
        mark = len(self.trail)
        try:
            for clause in list(predicate.clauses):
                body = self._enter(goal, clause)
                if body is None:
                    unlike += 1
                    continue
                proofs = self._clause(goal, clause, body, frame, depth)
                attempt = yield from proofs
                if attempt is None:
                    found = True
                else:
                    attempts.append(attempt)
                undo(self.trail, mark)
                if frame.cut:
                    break
        finally:
            undo(self.trail, mark)
        if found:
            return None
        note = _no_match(unlike) if unlike and not attempts else ""
        return _Draft(goal, False, "predicate", tuple(attempts), note)

    def _enter(self, goal: _Goal, clause: Clause) -> _Goal | None:
        """Return the body of a renamed clause whose head matches; else None, with nothing bound."""
        renaming: dict[Var, Term] = {}
        head = copy_term(clause.head, renaming)
        mark = len(self.trail)
        if not unify(head, goal.term, self.trail):
            undo(self.trail, mark)
            return None
        for variable in clause.names.values():
            renaming.setdefault(variable, Var(variable.name))
        variables = {
            name: var for name, variable in clause.names.items() if type(var := renaming[variable]) is Var
        }
        labels = {id(variable): name for name, variable in clause.names.items()}
        body = self.bodies.get(clause)
        if body is None:
            body = self.bodies[clause] = body_of(clause)
        return _Goal(body, _Scope(variables, labels, renaming))

    def _clause(self, goal: _Goal, clause: Clause, body: _Goal, frame: _Frame, depth: int) -> _Proofs:
        """Return the proofs by one clause whose head matches."""
        if body.goal.term is TRUE:
            return _once(_Draft(goal, True, "fact", (), "", clause.span, body.scope))

        def failed(steps: tuple[Step, ...]) -> _Draft:
            head = _Goal(read_body(clause.head), body.scope._replace(renaming=None))
            return _Draft(head, False, "clause", steps, "", clause.span)

        return _drafts(
            self.conjunction(body.conjuncts(), frame, depth + 1),
            lambda steps: _Draft(goal, True, "rule", steps, "", clause.span, body.scope),
            failed,
        )


def _once(draft: _Draft) -> _Proofs:
    """Yield one proof."""
    yield draft
    return None


def _drafts(
    proofs: _Conjunction,
    held: Callable[[tuple[_Draft, ...]], _Draft],
    failed: Callable[[tuple[Step, ...]], _Draft],
) -> _Proofs:
    """Yield what `held` makes of the steps of each proof; without any, return what `failed` makes of them."""
    found = False
    try:
        while True:
            try:
                steps = next(proofs)
            except StopIteration as end:
                return None if found else failed(end.value)
            found = True
            yield held(steps)
    finally:
        proofs.close()


def _no_match(count: int) -> str:
    return f"none of {count} clauses matches" if count else "there are no clauses"


class _Reasons:
    """The failures of the furthest goal that a conjunction reached."""

    def __init__(self, search: _Search) -> None:
        self._search = search
        self._furthest = -1
        self._found: dict[tuple[str, str], Step] = {}
        self._more = 0

    def add(self, index: int, failure: _Draft | None) -> None:
        if failure is None or index < self._furthest:
            return
        if index > self._furthest:
            self._furthest, self._found, self._more = index, {}, 0
        if len(self._found) < MAX_REASONS:
            step = self._search.finish(failure)
            self._found.setdefault((step.goal, repr(step.bindings)), step)
        else:
            self._more += 1

    def steps(self) -> tuple[Step, ...]:
        found = tuple(self._found.values())
        if self._more:
            more = Step(f"{self._more} more", False, "more", "", None, None, {}, (), "")
            return (*found, more)
        return found
