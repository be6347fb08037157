"""The control constructs of a body, read once into a tree of typed goals.

Solver, compiler, proofs, lowering and coverage all read this tree, so a control construct has one meaning. A
new one is a row of `CONSTRUCTS` if the others can express its meaning; otherwise it is a further class, a
part of `Goal`, and the type checker lists the readers that do not know it yet.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple, TypeAlias

from drlsl.logic.errors import instantiation_error, type_error
from drlsl.logic.limits import Meter
from drlsl.logic.syntax import ReadTerm, Span
from drlsl.logic.terms import TRUE, Atom, CyclicTerm, Struct, Term, Var, deref, is_acyclic

# After this many control constructs, a body is checked, to be sure that it is finite.
_MANY: Final = 20_000
# A goal takes as much time and memory as this many cells of a list.
_CELLS_OF_GOAL: Final = 4


class Barrier:
    """The target of a cut: the beginning of a clause, a condition or a called goal."""

    __slots__ = ()


CLAUSE: Final = Barrier()
"""The beginning of the clause, or of the queried goal."""


# In every goal, `term` is its written form and `place` its position, if its clause's positions are known.


class Call(NamedTuple):
    """A goal for a predicate or a builtin; a variable is a goal for call/1."""

    name: str
    args: tuple[Term, ...]
    term: Term
    place: Span | None


class Truth(NamedTuple):
    """``true`` or ``fail``."""

    holds: bool
    term: Term
    place: Span | None


class Cut(NamedTuple):
    """``!``, which removes every choice point left since its barrier."""

    barrier: Barrier
    term: Term
    place: Span | None


class Conjunction(NamedTuple):
    """Two or more goals one after the other; none of them is a conjunction itself."""

    goals: tuple[Goal, ...]
    term: Term
    place: Span | None


class Disjunction(NamedTuple):
    """The solutions of the first goal, then those of the second."""

    first: Goal
    second: Goal
    term: Term
    place: Span | None


class IfThenElse(NamedTuple):
    """`then` for the first solution of the condition, or for each if it is soft; else `otherwise`."""

    condition: Goal
    then: Goal
    otherwise: Goal
    soft: bool
    barrier: Barrier
    term: Term
    place: Span | None


class Negation(NamedTuple):
    """``\\+ G``: holds, without bindings, if the goal has no solution."""

    goal: Goal
    barrier: Barrier
    term: Term
    place: Span | None


class Opaque(NamedTuple):
    """``call(G)``: the goal, in which a cut is local."""

    goal: Goal
    barrier: Barrier
    term: Term
    place: Span | None


class Findall(NamedTuple):
    """``findall(Template, G, L)``: L is the list of the template's instances, one for each solution."""

    template: Term
    goal: Goal
    result: Term
    barrier: Barrier
    term: Struct
    place: Span | None


class Derived(NamedTuple):
    """A construct defined by others: its goals as written, and its meaning."""

    goals: tuple[Goal, ...]
    meaning: Goal
    term: Struct
    place: Span | None


class NotCallable(NamedTuple):
    """A term that is not a goal: an error once it is reached. Source: ISO 13211-1, 7.6.2."""

    term: Term
    place: Span | None


Goal: TypeAlias = (
    Call
    | Truth
    | Cut
    | Conjunction
    | Disjunction
    | IfThenElse
    | Negation
    | Opaque
    | Findall
    | Derived
    | NotCallable
)

SUCCEED: Final = Truth(True, TRUE, None)
FAILURE: Final = Truth(False, Atom("fail"), None)


class _Parts(NamedTuple):
    """The parts of a construct: its goals, and the barriers of those with local cuts."""

    term: Struct
    place: Span | None
    goals: Sequence[Goal]
    barriers: Sequence[Barrier]


class Construct(NamedTuple):
    """The definition of a control construct: which arguments are goals, and how it is read.

    A cut in one of the arguments `local` is local to that goal. If all of them are `called`, the bindings of
    their variables at that time are part of the goal, and a term that is not a goal is an error once it is
    reached.
    """

    places: tuple[int, ...]
    local: tuple[int, ...]
    called: bool
    read: Callable[[_Parts], Goal]


def _if_then(parts: _Parts) -> Goal:
    term, place, (condition, then), barriers = parts
    return IfThenElse(condition, then, FAILURE, term.name == "*->", barriers[0], term, place)


def _either(parts: _Parts) -> Goal:
    term, place, (first, second), _ = parts
    if type(first) is IfThenElse and first.otherwise is FAILURE and _is_arrow(first.term):
        return IfThenElse(first.condition, first.then, second, first.soft, first.barrier, term, place)
    return Disjunction(first, second, term, place)


def _is_arrow(term: Term) -> bool:
    return type(term) is Struct and term.name in ("->", "*->")


def _negation(parts: _Parts) -> Goal:
    return Negation(parts.goals[0], parts.barriers[0], parts.term, parts.place)


def _opaque(parts: _Parts) -> Goal:
    return Opaque(parts.goals[0], parts.barriers[0], parts.term, parts.place)


def _findall(parts: _Parts) -> Goal:
    term, place, (goal,), (barrier,) = parts
    return Findall(term.args[0], goal, term.args[2], barrier, term, place)


def _derived(meaning: Callable[[_Parts], Goal]) -> Callable[[_Parts], Goal]:
    def read(parts: _Parts) -> Goal:
        return Derived(tuple(parts.goals), meaning(parts), parts.term, parts.place)

    return read


def _once(parts: _Parts) -> Goal:
    """``once(G) :- ( G -> true ).``"""
    term, place, (goal,), (barrier,) = parts
    return IfThenElse(goal, SUCCEED, FAILURE, False, barrier, term, place)


def _ignore(parts: _Parts) -> Goal:
    """``ignore(G) :- ( G -> true ; true ).``"""
    term, place, (goal,), (barrier,) = parts
    return IfThenElse(goal, SUCCEED, SUCCEED, False, barrier, term, place)


def _forall(parts: _Parts) -> Goal:
    """``forall(G, A) :- \\+ ( G, \\+ A ).``"""
    term, place, (goal, action), (barrier, inner) = parts
    against = Negation(action, inner, term, place)
    goals = (*goal.goals, against) if type(goal) is Conjunction else (goal, against)
    return Negation(Conjunction(goals, term, place), barrier, term, place)


CONSTRUCTS: Final[dict[tuple[str, int], Construct]] = {
    (";", 2): Construct((0, 1), (), False, _either),
    ("->", 2): Construct((0, 1), (0,), False, _if_then),
    ("*->", 2): Construct((0, 1), (0,), False, _if_then),
    ("\\+", 1): Construct((0,), (0,), True, _negation),
    ("not", 1): Construct((0,), (0,), True, _negation),
    ("call", 1): Construct((0,), (0,), True, _opaque),
    ("findall", 3): Construct((1,), (1,), True, _findall),
    ("once", 1): Construct((0,), (0,), True, _derived(_once)),
    ("ignore", 1): Construct((0,), (0,), True, _derived(_ignore)),
    ("forall", 2): Construct((0, 1), (0, 1), True, _derived(_forall)),
}
"""Every control construct except the conjunction, by name and arity."""

CONNECTIVES: Final = frozenset(
    {",", *(name for (name, _), construct in CONSTRUCTS.items() if not construct.called)}
)
"""The names of the connectives, all of arity 2, that join goals to a body."""

_CONTROL: Final = frozenset({(",", 2), *CONSTRUCTS})

GOAL_ARGUMENTS: Final[dict[tuple[str, int], tuple[int, ...]]] = {
    (",", 2): (0, 1),
    ("|", 2): (0, 1),
    (":", 2): (1,),
    ("findall", 4): (1,),
    ("bagof", 3): (1,),
    ("setof", 3): (1,),
    ("aggregate_all", 3): (1,),
    ("aggregate_all", 4): (2,),
    ("catch", 3): (0, 2),
    ("call_cleanup", 2): (0, 1),
    ("setup_call_cleanup", 3): (0, 1, 2),
} | {key: construct.places for key, construct in CONSTRUCTS.items()}
"""The places of goals in control constructs, and in builtins that call an argument unchanged."""


class _Region:
    """The goals that connectives join to one called goal, or to a body."""

    __slots__ = ("has_variable", "is_callable")

    def __init__(self) -> None:
        self.has_variable = False
        self.is_callable = True


class _Join(NamedTuple):
    """A construct whose goals are being read: those from `start` on."""

    construct: Construct | None  # None for a conjunction
    term: Struct
    place: Span | None
    start: int
    barriers: Sequence[Barrier]
    regions: Sequence[_Region]

    def joined(self, goals: list[Goal]) -> Goal:
        """Return the construct of these goals."""
        if self.construct is None:
            return Conjunction(tuple(goals), self.term, self.place)
        for index, region in enumerate(self.regions):
            called = self.term.args[self.construct.places[index]]
            if not region.is_callable:
                return NotCallable(deref(called), goals[index].place)
            if region.has_variable:
                if self.term.name == "call":
                    return Call("call", self.term.args, self.term, self.place)
                goals[index] = Call("call", (called,), called, goals[index].place)
        return self.construct.read(_Parts(self.term, self.place, goals, self.barriers))


_Part: TypeAlias = "tuple[Term, Barrier, _Region, Span | None]"


class _Reading:
    """A body being read: the parts still to read, and the goals that wait to be joined."""

    __slots__ = ("_body", "_done", "_met", "_meter", "_origin", "todo")

    def __init__(self, body: Term, origin: ReadTerm | None, meter: Meter | None) -> None:
        self._body = body
        self._origin = origin
        self._meter = meter
        self._met = 0
        self._done: list[Goal] = []
        self.todo: list[_Part | _Join] = []

    def run(self) -> Goal:
        """Return the goal of all that is to be read."""
        done, todo = self._done, self.todo
        while todo:
            entry = todo.pop()
            if type(entry) is _Join:
                goals = done[entry.start :]
                del done[entry.start :]
                done.append(entry.joined(goals))
                continue
            term, barrier, region, place = entry  # type: ignore[misc]  # a part
            goal = _leaf(entry)  # type: ignore[arg-type]
            if goal is not None:
                done.append(goal)
                continue
            term = deref(term)
            assert type(term) is Struct
            if term.name == ",":
                self._conjunction(term, barrier, region, place)
            else:
                self._construct(term, barrier, region, place)
        return done[0]

    def _meet(self, goals: int) -> None:
        """Account for goals of control constructs."""
        before = self._met
        self._met += goals
        if before < _MANY <= self._met and not is_acyclic(self._body):
            raise CyclicTerm("the body contains itself")
        if self._meter is not None:
            self._meter.make(_CELLS_OF_GOAL * goals)

    def _inside(self, term: Struct, index: int, place: Span | None) -> Span | None:
        if self._origin is None:
            return place
        return self._origin.place(term, index) or place

    def _conjunction(self, term: Struct, barrier: Barrier, region: _Region, place: Span | None) -> None:
        """Read every goal of a conjunction, however it is bracketed."""
        parts: list[_Part] = []
        commas = 0
        open_: list[tuple[Term, Span | None]] = [(term, place)]
        while open_:
            part, at = open_.pop()
            part = deref(part)
            if type(part) is Struct and part.name == "," and len(part.args) == 2:
                open_.append((part.args[1], self._inside(part, 1, at) if self._origin else at))
                open_.append((part.args[0], self._inside(part, 0, at) if self._origin else at))
                commas += 1
                if commas % _MANY == 0:
                    self._meet(_MANY)
            else:
                parts.append((part, barrier, region, at))
        self._meet(commas % _MANY)
        goals = [goal for goal in map(_leaf, parts) if goal is not None]
        if len(goals) == len(parts):
            self._done.append(Conjunction(tuple(goals), term, place))
            return
        self.todo.append(_Join(None, term, place, len(self._done), (), ()))
        parts.reverse()
        self.todo += parts

    def _construct(self, term: Struct, barrier: Barrier, region: _Region, place: Span | None) -> None:
        """Read the goals of another control construct."""
        construct = CONSTRUCTS[term.name, len(term.args)]
        self._meet(1)
        barriers: list[Barrier] = []
        regions: list[_Region] = []
        parts: list[_Part | _Join] = []
        for index in construct.places:
            inner, own = barrier, region
            if index in construct.local:
                inner = Barrier()
                barriers.append(inner)
            if construct.called:
                own = _Region()
                regions.append(own)
            parts.append((term.args[index], inner, own, self._inside(term, index, place)))
        self.todo.append(_Join(construct, term, place, len(self._done), barriers, regions))
        parts.reverse()
        self.todo += parts


def read_body(
    body: Term, place: Span | None = None, origin: ReadTerm | None = None, meter: Meter | None = None
) -> Goal:
    """Read a body, or a called goal; one that joins a term that is not a goal is `NotCallable` as a whole.

    The goals' position is `place`, or a more exact one if `origin`, the term around the body, knows it.

    Raises:
        CyclicTerm: The body has no end.
        LimitExceeded: It is too large for the limits of the meter.
    """
    body = deref(body)
    if type(body) is Atom:
        return _atomic(body, CLAUSE, place)
    if type(body) is Struct and (body.name, len(body.args)) not in _CONTROL:
        return Call(body.name, body.args, body, place)
    whole = _Region()
    reading = _Reading(body, origin, meter)
    reading.todo.append((body, CLAUSE, whole, place))
    goal = reading.run()
    return goal if whole.is_callable else NotCallable(body, place)


def _leaf(part: _Part) -> Goal | None:
    """Return a goal without inner goals; None for a control construct."""
    term, barrier, region, place = part
    term = deref(term)
    kind = type(term)
    if kind is Struct:
        name, args = term.name, term.args  # type: ignore[union-attr]  # kind says so
        if (name, len(args)) in _CONTROL:
            return None
        return Call(name, args, term, place)
    if kind is Atom:
        return _atomic(term, barrier, place)  # type: ignore[arg-type]
    if kind is Var:
        region.has_variable = True
        return Call("call", (term,), term, place)
    region.is_callable = False
    return NotCallable(term, place)


def _atomic(goal: Atom, barrier: Barrier, place: Span | None) -> Goal:
    name = goal.name
    if name == "true":
        return Truth(True, goal, place)
    if name == "!":
        return Cut(barrier, goal, place)
    if name in ("fail", "false"):
        return Truth(False, goal, place)
    return Call(name, (), goal, place)


def conjuncts(goal: Goal) -> tuple[Goal, ...]:
    """Return the goals of a conjunction, with derived constructs replaced by their meaning."""
    return goal.goals if type(goal) is Conjunction else (goal,)


def steps(body: Goal) -> tuple[Goal, ...]:
    """Return the goals that a conjunction joins, those that others define as what they mean."""
    goals = conjuncts(body)
    if any(type(goal) is Derived for goal in goals):
        return tuple(goal.meaning if type(goal) is Derived else goal for goal in goals)
    return goals


def cuts(goal: Goal) -> bool:
    """Return whether a goal has a cut that reaches beyond it."""
    todo = [goal]
    while todo:
        part = todo.pop()
        kind = type(part)
        if kind is Cut:
            return True
        if kind is Conjunction:
            todo += part.goals  # type: ignore[union-attr]  # kind says so
        elif kind is Disjunction:
            todo += (part.first, part.second)  # type: ignore[union-attr]
        elif kind is IfThenElse:
            todo += (part.then, part.otherwise)  # type: ignore[union-attr]
    return False


def inside(goal: Goal) -> tuple[Goal, ...]:
    """Return the goals inside a goal."""
    kind = type(goal)
    if kind is Call or kind is Truth or kind is Cut or kind is NotCallable:
        return ()
    match goal:
        case Conjunction(goals):
            return goals
        case Disjunction(first, second):
            return first, second
        case IfThenElse(condition, then, otherwise):
            return condition, then, otherwise
        case Negation(inner) | Opaque(inner) | Findall(_, inner):
            return (inner,)
        case Derived(_, meaning):
            return (meaning,)
    return ()


def joined(body: Term, meter: Meter | None = None) -> list[Term]:
    """Return the goals joined by the connectives of a body, dereferenced.

    Raises:
        CyclicTerm: The body has no end.
        LimitExceeded: It is too large for the limits of the meter.
    """
    found: list[Term] = []
    todo = [body]
    met = 0
    while todo:
        term = deref(todo.pop())
        if type(term) is Struct and len(term.args) == 2 and term.name in CONNECTIVES:
            todo.extend(term.args)
            met += 1
            if met == _MANY and not is_acyclic(body):
                raise CyclicTerm("the body contains itself")
            if meter is not None:
                meter.make(_CELLS_OF_GOAL)
        else:
            found.append(term)
    return found


def check_body(goals: Sequence[Term], body: Term) -> None:
    """Check that all joined goals of a body are callable.

    Raises:
        PrologTypeError: ``type_error(callable, Body)``. Source: ISO 13211-1, 7.6.2.
    """
    for goal in goals:
        if type(goal) is not Atom and type(goal) is not Var and type(goal) is not Struct:
            raise type_error("callable", body)


def callable_parts(goal: Term) -> tuple[str, tuple[Term, ...]]:
    """Return the name and the arguments of a goal.

    Raises:
        InstantiationError: The goal is a variable.
        PrologTypeError: The goal is not callable.
    """
    goal = deref(goal)
    if type(goal) is Struct:
        return goal.name, goal.args
    if type(goal) is Atom:
        return goal.name, ()
    if type(goal) is Var:
        raise instantiation_error()
    raise type_error("callable", goal)
