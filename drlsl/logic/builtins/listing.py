"""portray_clause/1 and listing/0, 1: clauses laid out as by hand."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from drlsl.logic.builtins.arguments import prefix
from drlsl.logic.builtins.termio import emit, writes
from drlsl.logic.core import Caller, Predicate, copy_term, det, term_variables
from drlsl.logic.errors import instantiation_error, type_error
from drlsl.logic.limits import Meter
from drlsl.logic.terms import (
    NIL,
    TRUE,
    Atom,
    CyclicTerm,
    Struct,
    Term,
    Var,
    deref,
    format_atom,
    format_term,
    is_acyclic,
    parts,
)

_INDENT = "    "
_BRANCHES = {";": ";   ", "->": "->  ", "*->": "*-> ", "|": "|   "}


def portrayed(term: Term, machine: Caller) -> str:
    """Return the text of a clause, with variables named ``A``, ``B`` ... and single ones as ``_``."""
    term = copy_term(term, meter=machine.meter)
    if not is_acyclic(term):
        raise CyclicTerm("the clause contains itself")
    return _Layout(term, machine).clause(term)


class _Layout:
    def __init__(self, term: Term, machine: Caller) -> None:
        self.machine = machine
        self.names = _variable_names(term, machine.meter)

    def clause(self, term: Term) -> str:
        term = deref(term)
        if isinstance(term, Struct) and term.name == ":-" and len(term.args) == 2:
            head, body = term.args
            if deref(body) is TRUE:
                return self._end(self._goal(head, 1199))
            return self._end(f"{self._goal(head, 1199)} :-{self._body(body, 1)}")
        if isinstance(term, Struct) and term.name == ":-" and len(term.args) == 1:
            return self._end(f":- {self._goal(term.args[0], 1199)}")
        return self._end(self._goal(term, 1200))

    @staticmethod
    def _end(text: str) -> str:
        return text + (" .\n" if text[-1:] in "#$&*+-./:<=>?@^~\\" else ".\n")

    def _goal(self, goal: Term, priority: int) -> str:
        return format_term(
            goal,
            self.machine.operators,
            quoted=True,
            numbervars=True,
            spacing=True,
            variable_names=self.names,
            priority=priority,
            meter=self.machine.meter,
        )

    def _body(self, body: Term, depth: int) -> str:
        """Return the goals of a conjunction, each on a separate line."""
        margin = "\n" + _INDENT * depth
        return ",".join(margin + self._control(goal, depth) for goal in _conjuncts(body))

    def _control(self, goal: Term, depth: int) -> str:
        goal = deref(goal)
        if isinstance(goal, Struct) and len(goal.args) == 2 and goal.name in _BRANCHES:
            margin = "\n" + _INDENT * depth
            return "(   " + self._block(goal, depth) + margin + ")"
        if isinstance(goal, Struct) and goal.name == "\\+" and len(goal.args) == 1:
            inner = deref(goal.args[0])
            if isinstance(inner, Struct) and len(inner.args) == 2 and inner.name in (",", *_BRANCHES):
                return "\\+ ( " + self._block(inner, depth).lstrip() + "\n" + _INDENT * depth + "   )"
        return self._goal(goal, 999)

    def _block(self, goal: Term, depth: int) -> str:
        """Return a disjunction or condition whose parts begin in the column after the bracket."""
        margin = "\n" + _INDENT * depth
        text, goal = "", deref(goal)
        while isinstance(goal, Struct) and goal.name in _BRANCHES and len(goal.args) == 2:
            left, right = goal.args
            text += self._part(left, goal.name, depth) + margin + _BRANCHES[goal.name]
            goal = deref(right)
        return text + self._conjunction(goal, depth)

    def _part(self, goal: Term, operator: str, depth: int) -> str:
        goal = deref(goal)
        if operator != ";" or not (isinstance(goal, Struct) and goal.name in ("->", "*->")):
            return self._conjunction(goal, depth)
        margin = "\n" + _INDENT * depth
        condition, then = goal.args
        return (
            self._conjunction(condition, depth)
            + margin
            + _BRANCHES[goal.name]
            + self._conjunction(then, depth)
        )

    def _conjunction(self, goal: Term, depth: int) -> str:
        margin = ",\n" + _INDENT * (depth + 1)
        return margin.join(self._control(part, depth + 1) for part in _conjuncts(goal))


def _conjuncts(goal: Term) -> Iterator[Term]:
    goal = deref(goal)
    while isinstance(goal, Struct) and goal.name == "," and len(goal.args) == 2:
        yield goal.args[0]
        goal = deref(goal.args[1])
    yield goal


def _variable_names(term: Term, meter: Meter) -> dict[int, str]:
    counts: Counter[int] = Counter()
    for part in parts(term):
        meter.spend(1)
        if isinstance(part, Var):
            counts[id(part)] += 1
    names: dict[int, str] = {}
    number = 0
    for variable in term_variables(term, meter):
        if counts[id(variable)] == 1:
            names[id(variable)] = "_"
            continue
        names[id(variable)] = chr(65 + number % 26) + (str(number // 26) if number > 25 else "")
        number += 1
    return names


writes("portray_clause", 1)(lambda machine, term: portrayed(term, machine))


@det("listing", 0)
def listing_all(machine: Caller) -> bool:
    """List every predicate of the program that has clauses or is dynamic."""
    for predicate in list(machine.program.predicates.values()):
        if predicate.defined:
            emit(machine, _listed(machine, predicate))
    return True


@det("listing", 1)
def listing(machine: Caller, what: Term) -> bool:
    """List the clauses of a name, of ``Name/Arity``, or of each of a list of them."""
    what = deref(what)
    elements, tail = prefix(what, machine)
    if elements and tail is NIL:
        return all(listing(machine, element) for element in elements)
    name, arity = _wanted(what)
    for predicate in list(machine.program.predicates.values()):
        if predicate.defined and predicate.name == name and arity in (None, predicate.arity):
            emit(machine, _listed(machine, predicate))
    return True


def _wanted(what: Term) -> tuple[str, int | None]:
    if isinstance(what, Var):
        raise instantiation_error()
    if isinstance(what, Atom):
        return what.name, None
    if isinstance(what, Struct) and what.name == "/" and len(what.args) == 2:
        name, arity = deref(what.args[0]), deref(what.args[1])
        if isinstance(name, Var) or isinstance(arity, Var):
            raise instantiation_error()
        if isinstance(name, Atom) and isinstance(arity, int):
            return name.name, arity
    raise type_error("predicate_indicator", what)


def _listed(machine: Caller, predicate: Predicate) -> str:
    text = ""
    if predicate.dynamic:
        text = f":- dynamic {format_atom(predicate.name)}/{predicate.arity}.\n\n"
    if predicate.rows is not None:
        facts = [Struct(predicate.name, row) if row else Atom(predicate.name) for row in predicate.rows]
        return text + "".join(portrayed(fact, machine) for fact in facts) + "\n"
    for clause in predicate.clauses:
        text += portrayed(Struct(":-", (clause.head, clause.body)), machine)
    return text + "\n"
