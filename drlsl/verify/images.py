"""Rules about another scene than the present one: its mirror image, or one of its vehicles alone.

A property may say ``in(Image, Goal)``: Goal, asked in the image. The image is given by clauses
``image(Image, Fact, Goal)``: its facts are the instances of Fact for which Goal holds here. `expand` turns
this into plain Prolog, by copies of the predicates that depend on those facts; interpreter, generated code
and solver then all read the same program.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Final, TypeAlias

from drlsl.errors import UserError
from drlsl.logic import Engine
from drlsl.logic.core import GOAL_ARGUMENTS, Clause
from drlsl.logic.loading import library
from drlsl.logic.terms import Atom, Struct, Term, deref

Indicator: TypeAlias = tuple[str, int]

_GOALS: Final = {key: places for key, places in GOAL_ARGUMENTS.items() if key != ("call", 1)}
"""The goals among the arguments of goals; a call stands for what it calls."""

IN: Final = ("in", 2)


def indicator(goal: Term) -> Indicator | None:
    """Return name and arity of a goal; None for a variable or a number."""
    goal = deref(goal)
    if isinstance(goal, Struct):
        return goal.name, len(goal.args)
    return (goal.name, 0) if isinstance(goal, Atom) else None


def calls(goal: Term) -> Iterator[Indicator]:
    """Yield the predicates that a goal calls, also inside control constructs and ``in``."""
    goal = deref(goal)
    called = indicator(goal)
    if called is None:
        return
    if isinstance(goal, Struct) and (called in _GOALS or called == IN):
        for place in _GOALS.get(called, (1,)):
            yield from calls(goal.args[place])
    elif isinstance(goal, Struct) and goal.name == "call":
        closure = indicator(goal.args[0])
        if closure is not None and len(goal.args) == 1:
            yield from calls(goal.args[0])
        elif closure is not None:
            yield closure[0], closure[1] + len(goal.args) - 1
    else:
        yield called


def rewritten(goal: Term, change: Callable[[Term], Term | None]) -> Term:
    """Return a goal with each goal in it replaced for which `change` returns another."""
    goal = deref(goal)
    changed = change(goal)
    if changed is not None:
        return changed
    called = indicator(goal)
    if isinstance(goal, Struct) and called in _GOALS:
        places = _GOALS[called]
        args = (rewritten(arg, change) if n in places else arg for n, arg in enumerate(goal.args))
        return Struct(goal.name, tuple(args))
    if isinstance(goal, Struct) and called == ("call", 1):
        return rewritten(goal.args[0], change)
    return goal


def expand(engine: Engine) -> None:
    """Replace every ``in(Image, Goal)`` of an engine's clauses by a goal over copies of what it calls.

    Raises:
        UserError: an image has no clauses, or a rule calls a goal that is unknown before it runs.
    """
    images: dict[str, _Copies] = {}

    def change(goal: Term) -> Term | None:
        if indicator(goal) != IN or not isinstance(goal, Struct):
            return None
        name = deref(goal.args[0])
        if not isinstance(name, Atom):
            raise UserError("in/2 needs the name of an image as its first argument")
        if name.name not in images:
            images[name.name] = _Copies(engine, name.name)
        _refuse_given_goals(engine, goal.args[1], name.name)
        return rewritten(goal.args[1], images[name.name].change)

    for key in engine.predicates():
        clauses = engine.clauses(*key)
        if any(IN in _shallow(clause.body) for clause in clauses):
            engine.define(*key, [_with_body(clause, rewritten(clause.body, change)) for clause in clauses])


def _refuse_given_goals(engine: Engine, asked: Term, image: str) -> None:
    """Refuse an image of a predicate that calls a given goal, as maplist/2 does: it would run here.

    Raises:
        UserError: such a predicate is called, perhaps indirectly.
    """
    seen: set[Indicator] = set()
    open_ = [(key, key) for key in calls(asked)]
    while open_:
        key, called_as = open_.pop()
        if key in seen:
            continue
        seen.add(key)
        bodies = _bodies(engine, key)
        if key in _GIVEN_GOALS or any(map(_calls_unknown, bodies)):
            what = f"{called_as[0]}/{called_as[1]} calls a goal that it is given"
            raise UserError(
                f"{what}, which in({image}, ...) cannot ask there; write that goal itself instead"
            )
        # readers know the calls inside the library by the name that they call
        inside = key in library().exports and not engine.defines(*key)
        for body in bodies:
            open_.extend((called, called_as if inside else called) for called in calls(body))


def _bodies(engine: Engine, key: Indicator) -> list[Term]:
    """Return the bodies of a predicate of the program, or else of the library."""
    clauses = engine.clauses(*key) if engine.defines(*key) else library().clauses(*key)
    return [one.body for one in clauses]


_GIVEN_GOALS: Final = frozenset({("phrase", 2), ("phrase", 3), ("with_output_to", 2)})
"""Builtins without clauses that call an argument in another form."""


def _calls_unknown(goal: Term) -> bool:
    """Return whether a body calls a goal that is unknown before it runs."""
    goal = deref(goal)
    called = indicator(goal)
    if called is None:
        return True
    if not isinstance(goal, Struct):
        return False
    if called in _GOALS or called == IN:
        return any(_calls_unknown(goal.args[place]) for place in _GOALS.get(called, (1,)))
    return goal.name == "call" and _calls_unknown(goal.args[0])


def _shallow(goal: Term) -> Iterator[Indicator]:
    """Yield the goals of a goal, `in` among them."""
    goal = deref(goal)
    called = indicator(goal)
    if called is not None:
        yield called
    if isinstance(goal, Struct):
        for place in _GOALS.get(called or ("", 0), (0,) if called == ("call", 1) else ()):
            yield from _shallow(goal.args[place])


def _with_body(clause: Clause, body: Term) -> Clause:
    return Clause(clause.head, body, clause.span, clause.names, clause.source, clause.origin)


class _Copies:
    """The predicates of a program as copied for one image."""

    def __init__(self, engine: Engine, image: str) -> None:
        self._engine = engine
        self._image = image
        self._facts = self._declared()
        self._affected = affected(engine, self._facts)
        self._made: set[Indicator] = set()

    def _declared(self) -> dict[Indicator, list[tuple[Term, Term]]]:
        """Return the facts of the image: heads with their bodies."""
        facts: dict[Indicator, list[tuple[Term, Term]]] = {}
        for clause in self._engine.clauses("image", 3):
            name, fact, goal = map(deref, clause.args)
            key = indicator(fact)
            if isinstance(name, Atom) and name.name == self._image and key is not None:
                facts.setdefault(key, []).append((fact, goal))
        if not facts:
            raise UserError(f"in({self._image}, ...): no clause image({self._image}, Fact, Goal) defines it")
        return facts

    def change(self, goal: Term) -> Term | None:
        """Return the copy's goal for a goal that depends on the image; None for others."""
        key = indicator(goal)
        if key is None:
            raise UserError(f"a goal that is unknown before the rules run cannot be asked in {self._image}")
        if key == IN:
            raise UserError(f"an image of an image: in/2 inside in({self._image}, ...)")
        if key[0] == "call" and key[1] > 1:
            assert isinstance(goal, Struct)
            return self.change(_applied(goal, self._image))
        if key not in self._affected or key in _GOALS:
            return None
        self._copy(key)
        return self._renamed(goal)

    def _renamed(self, term: Term) -> Term:
        name = f"{self._image}:{term.name}" if isinstance(term, Atom | Struct) else ""
        return Struct(name, term.args) if isinstance(term, Struct) else Atom(name)

    def _copy(self, key: Indicator) -> None:
        if key in self._made:
            return
        self._made.add(key)
        name = f"{self._image}:{key[0]}"
        if key in self._facts:
            given = [Clause(self._renamed(fact), goal) for fact, goal in self._facts[key]]
            self._engine.define(name, key[1], given)
            return
        copies = []
        for clause in self._engine.clauses(*key):
            body = rewritten(clause.body, self.change)
            copies.append(Clause(self._renamed(clause.head), body, clause.span, clause.names, clause.source))
        self._engine.define(name, key[1], copies)


def _applied(goal: Struct, image: str) -> Term:
    """Return the goal that ``call(Closure, Argument, ...)`` calls."""
    closure = deref(goal.args[0])
    if isinstance(closure, Struct):
        return Struct(closure.name, (*closure.args, *goal.args[1:]))
    if isinstance(closure, Atom):
        return Struct(closure.name, goal.args[1:])
    raise UserError(f"a goal that is unknown before the rules run cannot be asked in {image}")


def affected(engine: Engine, facts: Iterable[Indicator]) -> set[Indicator]:
    """Return `facts` and the predicates that call one of them, also indirectly."""
    callers: dict[Indicator, set[Indicator]] = {}
    for key in engine.predicates():
        for clause in engine.clauses(*key):
            for called in calls(clause.body):
                callers.setdefault(called, set()).add(key)
    found: set[Indicator] = set()
    open_ = list(facts)
    while open_:
        key = open_.pop()
        if key not in found:
            found.add(key)
            open_.extend(callers.get(key, ()))
    return found


def undefined_calls(
    engine: Engine, start: Iterable[Term], is_known: Callable[[str, int], bool]
) -> list[Indicator]:
    """Return the predicates that goals call, also indirectly, but that are not defined anywhere."""
    missing: dict[Indicator, None] = {}
    seen: set[Indicator] = set()
    open_ = [key for goal in start for key in calls(goal)]
    while open_:
        key = open_.pop()
        if key in seen:
            continue
        seen.add(key)
        if engine.defines(*key):
            open_.extend(called for clause in engine.clauses(*key) for called in calls(clause.body))
        elif not is_known(*key):
            missing[key] = None
    return list(missing)
