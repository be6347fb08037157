"""Check a rule program before it runs: the tiers of each predicate, and findings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from drlsl.logic import Engine
from drlsl.logic.core import (
    GOAL_ARGUMENTS,
    Clause,
    Cut,
    Negation,
    Predicate,
    conjuncts,
    read_body,
    subsumes,
    term_variables,
)
from drlsl.logic.loading import builtin, library
from drlsl.logic.terms import Atom, Struct, Term, Var, deref
from drlsl.lowering.backends import ArrayPrinter
from drlsl.lowering.frontend import Lowered, Query, lower
from drlsl.lowering.ir import Doubt, Node, NotLowerable, Schema, reach

Indicator = tuple[str, int]


@dataclass(frozen=True, slots=True)
class Finding:
    """A finding: its place, and the problem. An `error` will raise or be wrong when it is reached."""

    place: str
    message: str
    error: bool = False

    def __str__(self) -> str:
        return f"{self.place}: {self.message}"


@dataclass(frozen=True, slots=True)
class PredicateReport:
    """The tiers of a predicate besides the interpreter, which runs every one.

    `refused` is the reason why generated code cannot run it, None if it can. `scalar_answer` and
    `array_answer` are the reasons why it cannot be a query of its own in that form; it can still be a part of
    others.
    """

    name: str
    arity: int
    place: str
    refused: str | None = None
    scalar_answer: str | None = None
    array_answer: str | None = None

    @property
    def indicator(self) -> str:
        """Name and arity, such as ``front_is_free/0``."""
        return f"{self.name}/{self.arity}"


@dataclass(frozen=True, slots=True)
class Report:
    """The results of `check_program`: every predicate, the findings, and the predicates that no rule calls.

    `doubts` has the queries that generated code leaves to the interpreter in some scenes, with the reasons.
    """

    predicates: tuple[PredicateReport, ...]
    findings: tuple[Finding, ...]
    uncalled: tuple[str, ...]
    doubts: Mapping[Query, tuple[Doubt, ...]]


def check_program(engine: Engine, schema: Schema, asked: Sequence[Query] = ()) -> Report:
    """Check a loaded program; `asked` are its queries from outside."""
    rules = _rules(engine, schema)
    called = {key for predicate in rules for clause in predicate.clauses for key in _called(clause.body)}
    called |= {(query.name, query.arity) for query in asked}
    uncalled = [predicate.indicator for predicate in rules if predicate.indicator not in called]
    doubts = {query: _doubts(engine, schema, query) for query in asked}
    return Report(
        tuple(_tiers(engine, schema, predicate) for predicate in rules),
        find_mistakes(engine, schema),
        tuple(f"{name}/{arity}" for name, arity in uncalled),
        {query: reasons for query, reasons in doubts.items() if reasons},
    )


def find_mistakes(engine: Engine, schema: Schema) -> tuple[Finding, ...]:
    """Return the findings in a loaded program; facts are those of `schema` and of dynamic predicates."""
    findings = [Finding(warning.place, warning.message) for warning in engine.warnings]
    for predicate in _rules(engine, schema):
        findings.extend(_unreachable(predicate))
        for clause in predicate.clauses:
            findings.extend(_undefined(engine, schema, clause))
            findings.extend(_floundering(clause))
    return tuple(findings)


def _rules(engine: Engine, schema: Schema) -> list[Predicate]:
    return [
        predicate
        for key, predicate in engine.program.predicates.items()
        if key not in schema.relations and predicate.clauses
    ]


def _tiers(engine: Engine, schema: Schema, predicate: Predicate) -> PredicateReport:
    name, arity = predicate.indicator
    place = _place(predicate.clauses[0])
    try:
        lower(engine, schema, [Query(name, arity, "holds")])
    except NotLowerable as refusal:
        reason = f"{refusal.span}: {refusal.reason}" if refusal.span is not None else refusal.reason
        return PredicateReport(name, arity, place, refused=reason)
    if arity == 0:
        return PredicateReport(name, arity, place)
    try:
        lowered = lower(engine, schema, [Query(name, arity, "first")])
    except NotLowerable as refusal:
        return PredicateReport(name, arity, place, scalar_answer=refusal.reason, array_answer=refusal.reason)
    try:
        ArrayPrinter(lowered)
    except NotLowerable as refusal:
        return PredicateReport(name, arity, place, array_answer=refusal.reason)
    return PredicateReport(name, arity, place)


def _doubts(engine: Engine, schema: Schema, query: Query) -> tuple[Doubt, ...]:
    """Return the reasons why a query can be undecided; none if it cannot, or only the interpreter runs it."""
    try:
        lowered = lower(engine, schema, [query])
    except NotLowerable:
        return ()
    return tuple(_reasons(lowered))


def _reasons(lowered: Lowered) -> Iterator[Doubt]:
    """Yield the doubts whose conditions make the only answer undecided.

    Conditions are compared up to their loops, which are renumbered when a quantifier binds them.
    """
    (answer,) = lowered.answers
    if answer.undecided is lowered.pool.false:
        return
    shapes: dict[Node, int] = {}
    numbers: dict[object, int] = {}

    def shape(node: Node) -> int:
        for part in reach([node], shapes):
            inside = () if part.op == "loop" else tuple(shapes[arg] for arg in part.args)
            data = None if part.op == "loop" else part.data
            shapes[part] = numbers.setdefault((part.op, part.kind, inside, data), len(numbers))
        return shapes[node]

    used = {shape(part) for part in reach([answer.undecided])}
    for doubt, conditions in lowered.doubts.items():
        parts = (part for cond in conditions for part in _tests(cond))
        if any(part is lowered.pool.false or shape(part) in used for part in parts):
            yield doubt


def _tests(cond: Node) -> Iterator[Node]:
    """Yield the comparisons in a condition."""
    if cond.op in ("not", "and", "or"):
        for arg in cond.args:
            yield from _tests(arg)
    else:
        yield cond


def _place(clause: Clause) -> str:
    return str(clause.span) if clause.span is not None else "asserted"


def _goals(body: Term) -> Iterator[tuple[Indicator, Term]]:
    """Yield the goals of a body, including nested ones."""
    body = deref(body)
    if isinstance(body, Atom):
        yield (body.name, 0), body
    elif isinstance(body, Struct):
        key = (body.name, len(body.args))
        yield key, body
        for place in GOAL_ARGUMENTS.get(key, ()):
            yield from _goals(_without_carets(body.args[place]))
        if body.name == "call" and len(body.args) > 1:
            called = deref(body.args[0])
            if isinstance(called, Atom | Struct):
                inner = called.args if isinstance(called, Struct) else ()
                yield (called.name, len(inner) + len(body.args) - 1), body


def _without_carets(goal: Term) -> Term:
    goal = deref(goal)
    while isinstance(goal, Struct) and goal.name == "^" and len(goal.args) == 2:
        goal = deref(goal.args[1])
    return goal


def _called(body: Term) -> Iterator[Indicator]:
    for key, _ in _goals(body):
        yield key


def _undefined(engine: Engine, schema: Schema, clause: Clause) -> Iterator[Finding]:
    for name, arity in dict.fromkeys(_called(clause.body)):
        known = (
            engine.program.find(name, arity) is not None
            or (name, arity) in schema.relations
            or (name, arity) in GOAL_ARGUMENTS
            or name in ("!", "call")
            or builtin(name, arity) is not None
            or library().find(name, arity) is not None
        )
        if not known:
            problem = f"{name}/{arity} is not defined{engine.similar(name, arity)}"
            yield Finding(_place(clause), problem, error=True)


def _unreachable(predicate: Predicate) -> Iterator[Finding]:
    clauses: Sequence[Clause] = predicate.clauses
    for number, clause in enumerate(clauses):
        for earlier in clauses[:number]:
            if _cuts_at_once(earlier) and subsumes(earlier.head, clause.head):
                message = f"this clause of {predicate.name}/{predicate.arity} is never reached: the one at "
                yield Finding(_place(clause), f"{message}{_place(earlier)} cuts it off")
                break


def _cuts_at_once(clause: Clause) -> bool:
    return isinstance(conjuncts(read_body(clause.body))[0], Cut)


def _floundering(clause: Clause) -> Iterator[Finding]:
    """Yield negations of goals with a variable that only a later goal binds."""
    bound = set(term_variables(clause.head))
    goals = conjuncts(read_body(clause.body))
    for number, goal in enumerate(goals):
        later = {variable for other in goals[number + 1 :] for variable in term_variables(other.term)}
        variables = term_variables(goal.term)
        if isinstance(goal, Negation):
            for variable in variables:
                if variable not in bound and variable in later:
                    name = _name(clause, variable)
                    message = f"{name} is unbound in this negation and bound only behind it"
                    yield Finding(_place(clause), message)
        else:
            bound.update(variables)


def _name(clause: Clause, variable: Var) -> str:
    return next((name for name, known in clause.names.items() if known is variable), "a variable")
