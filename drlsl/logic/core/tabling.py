"""Tabled predicates: a call is answered from a table that holds all its answers, each once.

The clauses of a tabled predicate are run to their last answer before the caller continues with the first. A
variant of a running call takes the present answers, and those that are added meanwhile; clauses are run again
until every such call has seen every answer. So left recursion ends if the number of answers is finite. An
answer missing in an incomplete table may still come: a negation, a condition, a findall/3 or a cut over such
a call is refused.

Source: Zhou, Shen, Yuan, You: Implementation of a linear tabling mechanism, 2001 (iteration of leaders).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

from drlsl.logic.core.body import BRANCH, CUT, EITHER, FAIL_NODE, SOFT_CUT, Node
from drlsl.logic.core.machine import FAIL, Choice, Machine, Task, collect, run, run_clauses
from drlsl.logic.core.unification import copy_term, term_variables
from drlsl.logic.errors import PrologPermissionError, permission_error, resource_error
from drlsl.logic.terms import Atom, Struct, Term, Var, deref

if TYPE_CHECKING:
    from drlsl.logic.core.clauses import Predicate

_MOST_ANSWERS: Final = 1_000_000  # of one table
_PARTS_OF_AN_INFERENCE: Final = 10  # of an answer: this many take the time of a call


class _Incomplete(PrologPermissionError):
    """A call whose answers must all be known, but are not."""

    def __init__(self, predicate: Predicate) -> None:
        indicator = Struct("/", (Atom(predicate.name), predicate.arity))
        super().__init__(permission_error("commit_to", "incomplete_table", indicator).term)

    def message(self) -> str:
        return (
            f"{super().message()}: its answers are still being found, so no negation, condition, "
            "findall/3 or cut may depend on them"
        )


class Table:
    """The answers to one call: the bindings of its variables in each, and whether they are ground."""

    __slots__ = ("answers", "complete", "done", "exhausted", "known", "lowest", "missed", "readers")

    def __init__(self) -> None:
        self.answers: list[tuple[tuple[Term, ...], bool]] = []
        self.known: set[Any] = set()
        self.complete = False
        self.lowest = 0  # the outermost evaluation that it depends on, while it is incomplete
        self.begin_round()
        self.done = False  # whether its clauses were run in this round

    def begin_round(self) -> None:
        """Forget which calls read the table in the previous round."""
        self.done = False
        self.readers = 0  # calls that have not read every answer yet
        self.exhausted = False  # whether one has
        self.missed = False  # whether an answer came after that


class _Evaluation:
    """A table whose clauses are being run; `lowest` is the place of the outermost that it depends on."""

    __slots__ = ("choice", "generation", "grown", "height", "key", "lowest", "members", "place", "table")

    def __init__(self, key: Any, table: Table, place: int, generation: int) -> None:
        self.key = key
        self.table = table
        self.place = place
        self.lowest = place
        self.generation = generation
        self.members: dict[Any, Table] = {}  # tables that were evaluated inside and depend on this one
        self.grown = False
        self.height = 0
        self.choice: Choice = ()


class Evaluations:
    """The tables that one search is filling."""

    __slots__ = ("stack", "tables")

    def __init__(self) -> None:
        self.stack: list[_Evaluation] = []
        self.tables: dict[Any, Table] = {}

    def drop_abandoned(self, choices: list[Choice]) -> None:
        """Forget the evaluations whose choice point an error has removed."""
        while self.stack:
            innermost = self.stack[-1]
            if len(choices) > innermost.height and choices[innermost.height] is innermost.choice:
                break
            self.drop_innermost()

    def drop_innermost(self) -> None:
        """Forget the innermost evaluation and the tables that depend on it."""
        dropped = self.stack.pop()
        for key in (dropped.key, *dropped.members):
            self.tables.pop(key, None)
            for evaluation in self.stack:
                evaluation.members.pop(key, None)


def call_table(machine: Machine, predicate: Predicate, args: Sequence[Term], continuation: Task) -> Task:
    """Call a tabled predicate with dereferenced arguments."""
    variables = term_variables(Struct("v", tuple(args)))
    key = predicate, variant_key(args)
    table = predicate.program.tables.get(key)
    if table is not None:
        return _read(machine, table, 0, variables, continuation)
    if machine.evaluations is None:
        machine.evaluations = Evaluations()
    open_: Evaluations = machine.evaluations
    open_.drop_abandoned(machine.choices)
    table = open_.tables.get(key)
    if table is not None and table.done:
        _depend(open_, table.lowest, predicate, continuation)
        table.readers += 1
        return _read(machine, table, 0, variables, continuation)
    if table is None:
        table = open_.tables[key] = Table()
    table.done = True
    table.lowest = place = len(open_.stack)
    evaluation = _Evaluation(key, table, place, predicate.program.tables.generation)
    open_.stack.append(evaluation)
    return _run_clauses(machine, predicate, args, evaluation, variables, continuation)


def _run_clauses(
    machine: Machine,
    predicate: Predicate,
    args: Sequence[Term],
    evaluation: _Evaluation,
    variables: list[Var],
    continuation: Task,
) -> Task:
    """Search every answer of the clauses, then continue at `_end_round`."""
    choice = (_end_round, len(machine.trail), predicate, args, evaluation, variables, continuation)
    evaluation.choice = choice
    evaluation.height = len(machine.choices)
    machine.choices.append(choice)
    return run_clauses(machine, predicate, args, (_add_answer, evaluation, variables, continuation))


def _add_answer(machine: Machine, task: Task) -> Task:
    """Keep an answer of the clauses if it is new, and search the next."""
    evaluation, variables = task[1], task[2]
    table: Table = evaluation.table
    answer = copy_term(Struct("v", tuple(variables)), None, machine.meter).args if variables else ()  # type: ignore[union-attr]
    key = variant_key(answer)
    if key in table.known:
        return FAIL
    if len(table.answers) >= _MOST_ANSWERS:
        raise resource_error("table_space")
    table.known.add(key)
    table.answers.append((answer, not any(type(part) is tuple and part[0] is Var for part in key)))
    table.missed = table.missed or table.exhausted
    evaluation.grown = True
    # An answer takes time and memory by its size, and counts accordingly.
    machine.left -= 1 + len(key) // _PARTS_OF_AN_INFERENCE
    if machine.left < 0:
        machine.tick(task)
    return FAIL


def _end_round(machine: Machine, choice: Choice) -> Task:
    """Run clauses without more answers again, or leave that to an outer evaluation, or end."""
    _, _, predicate, args, evaluation, variables, continuation = choice
    open_: Evaluations = machine.evaluations
    while open_.stack[-1] is not evaluation:
        open_.drop_innermost()
    table: Table = evaluation.table
    tables = {evaluation.key: table, **evaluation.members}
    if evaluation.lowest < evaluation.place:
        open_.stack.pop()
        outer = open_.stack[-1]
        outer.lowest = min(outer.lowest, evaluation.lowest)
        outer.grown = outer.grown or evaluation.grown
        outer.members |= tables
        for each in tables.values():
            each.lowest = evaluation.lowest
        table.readers += 1
        return _read(machine, table, 0, variables, continuation)
    if evaluation.grown and any(each.missed or each.readers for each in tables.values()):
        for each in tables.values():
            each.begin_round()
        table.done = True
        evaluation.grown = False
        return _run_clauses(machine, predicate, args, evaluation, variables, continuation)
    open_.stack.pop()
    for key, each in tables.items():
        each.complete = True
        open_.tables.pop(key, None)
    predicate.program.tables.keep(tables, evaluation.generation)
    return _read(machine, table, 0, variables, continuation)


def _read(machine: Machine, table: Table, index: int, variables: list[Var], continuation: Task) -> Task:
    """Continue with the answer at a place of a table, leaving a choice point for the later ones."""
    answers = table.answers
    if index >= len(answers):
        table.readers -= 1
        table.exhausted = True
        return FAIL
    answer, is_ground = answers[index]
    trail = machine.trail
    if not table.complete or index + 1 < len(answers):
        machine.choices.append((_next_answer, len(trail), table, index + 1, variables, continuation))
    if not is_ground:
        answer = copy_term(Struct("v", answer), None, machine.meter).args  # type: ignore[union-attr]  # a compound term's copy
    for variable, value in zip(variables, answer, strict=True):
        variable.ref = value
        trail.append(variable)
    return continuation


def _next_answer(machine: Machine, choice: Choice) -> Task:
    machine.left -= 1
    if machine.left < 0:
        machine.tick(choice[5])
    return _read(machine, *choice[2:])


def _depend(open_: Evaluations, lowest: int, predicate: Predicate, continuation: Task) -> None:
    """Record that the innermost evaluation reads a table that the one at `lowest` will complete.

    Raises:
        PrologPermissionError: A construct in between must know all its answers.
    """
    innermost = open_.stack[-1]
    innermost.lowest = min(innermost.lowest, lowest)
    outer = open_.stack[lowest]
    task: Any = continuation
    while not (task[0] is _add_answer and task[1] is outer):
        if task[0] is run:
            commits = _node_commits(task[1])
            task = task[2][1]
        else:
            commits = task[0] is collect or _code_commits(task[0])
            task = task[-1]
        if commits or type(task) is not tuple:
            raise _Incomplete(predicate)


def _code_commits(function: Any) -> bool:
    """Return whether the compiled code after a goal removes choice points made before it."""
    return getattr(function, "__name__", "") in getattr(function, "__globals__", {}).get("COMMITS", ())


def _node_commits(start: Node) -> bool:
    """Return whether the rest of a body removes choice points made before it."""
    todo: list[tuple[Node, frozenset[int]]] = [(start, frozenset())]
    seen: set[tuple[int, frozenset[int]]] = set()
    while todo:
        node, opened = todo.pop()
        while node is not None and (id(node), opened) not in seen:
            seen.add((id(node), opened))
            if node.op == CUT and node.slot not in opened:
                return True
            if node.op == SOFT_CUT and node.slot not in opened and node.other is not FAIL_NODE:
                return True
            if node.op == BRANCH:
                opened |= {node.slot}
            if node.op in (BRANCH, EITHER) and node.other is not None:
                todo.append((node.other, opened))
            node = node.next
    return False


def variant_key(terms: Sequence[Term]) -> tuple[Any, ...]:
    """Return a key that sequences of terms share exactly if they are equal up to renaming variables."""
    key: list[Any] = []
    numbers: dict[Var, tuple[type, int]] = {}
    todo = list(reversed(terms))
    while todo:
        term = deref(todo.pop())
        kind = type(term)
        if kind is Struct:
            key.append((term.name, len(term.args)))  # type: ignore[union-attr]  # kind says so
            todo.extend(reversed(term.args))  # type: ignore[union-attr]  # kind says so
        elif kind is Var:
            key.append(numbers.setdefault(term, (Var, len(numbers))))  # type: ignore[arg-type]  # kind says so
        elif kind is float:
            key.append((float, repr(term) if term != term else term))  # here a NaN equals itself
        elif kind is str:
            key.append((str, term))
        else:
            key.append(term)
    return tuple(key)
