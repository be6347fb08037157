"""Unification, the trail, and the functions that compare, copy or walk terms.

Every function here is iterative, so a term's depth is bounded by memory and never by Python's stack. A long
walk remembers where it was: shared parts are then walked only once, so that a term of 30 cells which would be
2**30 as a tree is no problem, and a cyclic term, which unification without the occurs check may create, comes
to an end. It also reports its steps to the meter of the query, if it is given one.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cmp_to_key
from sys import getrefcount
from typing import Any, Final

from drlsl.logic.limits import Meter
from drlsl.logic.terms import Atom, Struct, Term, Var, deref

# From this many steps on, a walk is long. It then remembers every eighth place, which bounds repeated steps
# as well as all places would, for an eighth of the memory.
_SHORT: Final = 500
_EIGHTH: Final = 8
_REPORT: Final = 1024
# Bits of an integer, and characters of a text, that are compared in the time of a step.
_LARGE_BITS: Final = 1 << 14
_LARGE_TEXT: Final = 1 << 11
_WEIGHED: Final = frozenset({int, str})


Trail = list[Any]
"""What was done, the latest last: setting `ref` of an entry to None undoes it."""


class UndoCall:
    """A trail entry that calls a function when it is undone."""

    __slots__ = ("undo",)

    def __init__(self, undo: Callable[[], None]) -> None:
        self.undo = undo

    @property
    def ref(self) -> None:
        return None

    @ref.setter
    def ref(self, _: None) -> None:
        self.undo()


def undo(trail: Trail, mark: int) -> None:
    """Undo every binding made since the trail was `mark` entries long, the latest first."""
    if len(trail) > mark:
        for entry in reversed(trail[mark:]):
            entry.ref = None
        del trail[mark:]


def compact(trail: Trail, start: int, marks: Iterable[int]) -> int:
    """Drop the entries from `start` on whose variable is unreachable elsewhere, so undoing is invisible.

    `marks` are positions not before `start` that must stay valid, ascending. Only the entries after the last
    of them are dropped. Returns the number of dropped entries.
    """
    keep_from = start
    for mark in marks:
        keep_from = max(keep_from, mark)
    before = len(trail)
    tail = trail[keep_from:]
    del trail[keep_from:]
    tail.reverse()
    while tail:
        entry = tail.pop()
        # References by `entry` and by the call's own argument: the variable has no other.
        if type(entry) is not Var or getrefcount(entry) > 2:
            trail.append(entry)
    return before - len(trail)


def unify(left: Term, right: Term, trail: Trail) -> bool:
    """Make two terms equal by binding variables; on failure the caller undoes the bindings."""
    while type(left) is Var:
        ref = left.ref
        if ref is None:
            break
        left = ref
    while type(right) is Var:
        ref = right.ref
        if ref is None:
            break
        right = ref
    if left is right:
        return True
    if type(left) is Var:
        left.ref = right
        trail.append(left)
        return True
    if type(right) is Var:
        right.ref = left
        trail.append(right)
        return True
    if type(left) is Struct:
        return type(right) is Struct and _unify_compounds(left, right, trail)
    if type(left) is not type(right) or type(left) is Atom:
        return False
    if type(left) in _WEIGHED and is_large(left):
        return _unify_long([left, right], trail)
    return left == right


def _unify_compounds(left: Struct, right: Struct, trail: Trail) -> bool:
    """Unify compound terms: only pairs of compound terms wait, all others are unified at once."""
    todo: list[Struct] = []
    steps = _SHORT
    while True:
        left_args: tuple[Any, ...] = left.args
        right_args: tuple[Any, ...] = right.args
        if left.name != right.name or len(left_args) != len(right_args):
            return False
        steps -= len(left_args)
        if steps < 0:
            return _unify_long([*todo, left, right], trail)
        for one, other in zip(left_args, right_args):  # noqa: B905  (the lengths are equal)
            if one is other:
                continue
            while type(one) is Var:
                ref = one.ref
                if ref is None:
                    break
                one = ref
            while type(other) is Var:
                ref = other.ref
                if ref is None:
                    break
                other = ref
            if one is other:
                continue
            kind = type(one)
            if kind is Var:
                one.ref = other
                trail.append(one)
            elif type(other) is Var:
                other.ref = one
                trail.append(other)
            elif kind is not type(other) or kind is Atom:
                return False
            elif kind is Struct:
                todo.append(one)
                todo.append(other)
            elif kind in _WEIGHED and is_large(one):
                return _unify_long([*todo, left, right], trail)
            elif one != other:
                return False
        if not todo:
            return True
        right = todo.pop()
        left = todo.pop()


def _unify_long(todo: list[Term], trail: Trail) -> bool:
    """Continue a unification that takes long: a repeated pair of terms is taken as equal."""
    met = _Pairs(_meter_of(trail))
    while todo:
        right = deref(todo.pop())
        left = deref(todo.pop())
        if left is right:
            continue
        if type(left) is Var:
            left.ref = right
            trail.append(left)
        elif type(right) is Var:
            right.ref = left
            trail.append(right)
        elif type(left) is Struct:
            if type(right) is not Struct or left.name != right.name or len(left.args) != len(right.args):
                return False
            if not met.before(left, right):
                push_pairs(todo, left, right)
        elif type(left) is not type(right):
            return False
        else:
            met.weigh(left)
            if left != right:
                return False
    return True


def is_large(value: Term) -> bool:
    """Return whether a number or a text is so large that comparisons take long."""
    kind = type(value)
    if kind is int:
        return value.bit_length() > _LARGE_BITS  # type: ignore[union-attr]  # kind says so
    return kind is str and len(value) > _LARGE_TEXT  # type: ignore[arg-type]  # kind says so


def weight(value: Term) -> int:
    """Return the largest number of steps for comparing a number or a text."""
    if type(value) is int:
        return value.bit_length() // _LARGE_BITS
    return len(value) // _LARGE_TEXT if type(value) is str else 0


def _meter_of(trail: Trail) -> Meter | None:
    """Return the meter of the search that a trail belongs to."""
    first = trail[0] if trail else None
    return first if type(first) is Meter else None


def push_pairs(todo: list[Term], left: Struct, right: Struct) -> None:
    """Push the arguments of two terms as the next pairs, from left to right."""
    for index in range(len(left.args) - 1, -1, -1):
        todo.append(left.args[index])
        todo.append(right.args[index])


class _Places:
    """The compound terms that a long walk has visited."""

    __slots__ = ("_at", "_met", "_meter")

    def __init__(self, meter: Meter | None) -> None:
        self._met: set[int] = set()
        self._meter = meter
        self._at = 0

    def before(self, term: Struct) -> bool:
        """Return whether the walk has visited a term before, and record the visit.

        Raises:
            LimitExceeded: The query went beyond its limits.
        """
        return self._before(id(term), len(term.args))

    def weigh(self, value: Term) -> None:
        """Account for comparing a number or a text."""
        if self._meter is not None and is_large(value):
            self._meter.spend(weight(value))

    def _before(self, key: int, size: int) -> bool:
        if key in self._met:
            return True
        at = self._at = self._at + 1
        if not at % _EIGHTH:
            self._met.add(key)
            if self._meter is not None and not at % _REPORT:
                self._meter.spend(_REPORT)
        if size > _REPORT and self._meter is not None:
            self._meter.spend(size)
        return False


class _Pairs(_Places):
    """The pairs of compound terms that a long walk has visited."""

    __slots__ = ()

    def before(self, left: Struct, right: Struct) -> bool:  # type: ignore[override]  # a pair is a place
        return self._before(id(left) << 64 | id(right), len(left.args))


def occurs(variable: Var, term: Term, meter: Meter | None = None) -> bool:
    """Return whether an unbound variable occurs in a term."""
    return any(found is variable for found in _variables(term, meter))


def _variables(term: Term, meter: Meter | None) -> Iterator[Var]:
    """Yield the unbound variables of a term from left to right, some more than once."""
    todo = [term]
    steps = _SHORT
    met: _Places | None = None
    while todo:
        term = todo.pop()
        if type(term) is Var:
            term = deref(term)
            if type(term) is Var:
                yield term
        if type(term) is Struct:
            steps -= len(term.args)
            if steps < 0 and (met := met or _Places(meter)).before(term):
                continue
            todo.extend(reversed(term.args))


def unify_occurs(left: Term, right: Term, trail: Trail) -> bool:
    """Unify with the occurs check, so that no cyclic term is created. Source: ISO 13211-1, 8.2.2."""
    meter = _meter_of(trail)
    met: _Pairs | None = None
    steps = _SHORT
    todo: list[Term] = [left, right]
    while todo:
        right = deref(todo.pop())
        left = deref(todo.pop())
        if left is right:
            continue
        if type(right) is Var and type(left) is not Var:
            left, right = right, left
        if type(left) is Var:
            if type(right) is Struct and occurs(left, right, meter):
                return False
            left.ref = right
            trail.append(left)
        elif type(left) is Struct:
            if type(right) is not Struct or left.name != right.name or len(left.args) != len(right.args):
                return False
            steps -= len(left.args)
            if steps < 0 and (met := met or _Pairs(meter)).before(left, right):
                continue
            push_pairs(todo, left, right)
        elif type(left) is not type(right) or left != right:
            return False
    return True


def is_ground(term: Term, meter: Meter | None = None) -> bool:
    """Return whether no unbound variable occurs in a term."""
    return next(_variables(term, meter), None) is None


def copy_term(term: Term, renaming: dict[Var, Term] | None = None, meter: Meter | None = None) -> Term:
    """Return a copy with fresh variables and no bound ones; `renaming` maps old variables to new ones.

    Large terms keep the parts that they share.
    """
    term = deref(term)
    if renaming is None:
        renaming = {}
    if type(term) is Var:
        return renaming.setdefault(term, Var(term.name))
    if type(term) is not Struct:
        return term
    root = Struct(term.name, ())
    todo = [(root, term.args)]
    steps = _SHORT
    copies: dict[int, Struct] | None = None
    while todo:
        steps -= 1
        if not steps:
            steps = _REPORT
            if copies is None:
                copies = {}
            if meter is not None:
                meter.spend(_REPORT)
        shell, args = todo.pop()
        if meter is not None and len(args) > _REPORT:
            meter.make(len(args))
        copied: list[Term] = []
        for arg in args:
            if type(arg) is Var:
                arg = deref(arg)
            if type(arg) is Struct:
                inner = None if copies is None else copies.get(id(arg))
                if inner is None:
                    inner = Struct(arg.name, ())
                    todo.append((inner, arg.args))
                    if copies is not None and not steps % _EIGHTH:
                        copies[id(arg)] = inner
                arg = inner
            elif type(arg) is Var:
                fresh = renaming.get(arg)
                if fresh is None:
                    fresh = renaming[arg] = Var(arg.name)
                arg = fresh
            copied.append(arg)
        shell.args = tuple(copied)
    return root


def excerpt(term: Term, most: int, renaming: Mapping[Var, Term] | None = None) -> Term:
    """Return a copy of the outer `most` arguments of a term; deeper parts are shared.

    In the copy no variable is bound, so that backtracking does not change it; those in `renaming` are
    replaced.
    """
    term = deref(term)
    renaming = renaming or {}
    if type(term) is Var:
        return renaming.get(term, term)
    if type(term) is not Struct:
        return term
    root = Struct(term.name, ())
    todo = deque([(root, term.args)])
    while todo:
        shell, args = todo.popleft()
        most -= len(args)
        if most < 0:
            shell.args = args
            continue
        copied: list[Term] = []
        for arg in map(deref, args):
            if type(arg) is Struct:
                inner = Struct(arg.name, ())
                todo.append((inner, arg.args))
                copied.append(inner)
            else:
                copied.append(renaming.get(arg, arg) if type(arg) is Var else arg)
        shell.args = tuple(copied)
    return root


def term_variables(term: Term, meter: Meter | None = None) -> list[Var]:
    """Return the distinct unbound variables of a term, from left to right. Source: ISO 13211-1, 8.5.5."""
    return list(dict.fromkeys(_variables(term, meter)))


_RANK = {Var: 0, float: 1, int: 1, Atom: 3, str: 4, Struct: 5}


def compare(left: Term, right: Term, *, iso: bool = True, meter: Meter | None = None) -> int:
    """Return the standard order of terms: -1, 0 or 1.

    Variables precede numbers, then atoms, strings, and compound terms by arity, name and arguments. With
    `iso` every float precedes every integer; without, numbers compare by value and a float precedes the
    equal integer. Source: ISO 13211-1, 7.2.
    """
    todo: list[Term] = []
    steps = _SHORT
    met: _Pairs | None = None
    while True:
        left = deref(left)
        right = deref(right)
        if left is not right:
            if meter is not None and type(left) in _WEIGHED and is_large(left):
                meter.spend(weight(left))
            order = _compare_shallow(left, right, iso)
            if order:
                return order
            if type(left) is Struct and type(right) is Struct:
                steps -= len(left.args)
                if steps >= 0 or not (met := met or _Pairs(meter)).before(left, right):
                    push_pairs(todo, left, right)
        if not todo:
            return 0
        right = todo.pop()
        left = todo.pop()


def _compare_shallow(left: Term, right: Term, iso: bool) -> int:
    """Return the order of two distinct dereferenced terms, as far as it does not depend on arguments."""
    kind = type(left)
    if kind is not type(right):
        order = _RANK[kind] - _RANK[type(right)]
        if order:
            return 1 if order > 0 else -1
        if not iso and left != right:
            return -1 if left < right else 1  # type: ignore[operator]  # equal ranks of unlike types: numbers
        return -1 if kind is float else 1
    if kind is Struct:
        first: Any = (len(left.args), left.name)  # type: ignore[union-attr]  # kind says so
        second: Any = (len(right.args), right.name)  # type: ignore[union-attr]  # kind says so
    elif kind is Atom:
        first, second = left.name, right.name  # type: ignore[union-attr]  # kind says so
    elif kind is Var:
        # Addresses do not change while a variable lives; the standard demands nothing more of their order.
        first, second = id(left), id(right)
    else:
        first, second = left, right
    if first == second:
        return 0
    return -1 if first < second else 1


def sort_key(*, iso: bool = True, meter: Meter | None = None) -> Callable[[Term], Any]:
    """Return a key that sorts by the standard order of terms."""
    if meter is None:
        return cmp_to_key(lambda left, right: compare(left, right, iso=iso))

    def order(left: Term, right: Term) -> int:
        meter.spend(_STEPS_OF_COMPARISON)
        return compare(left, right, iso=iso, meter=meter)

    return cmp_to_key(order)


_STEPS_OF_COMPARISON: Final = 8


def variant(left: Term, right: Term, meter: Meter | None = None) -> bool:
    """Return whether two terms are equal up to a renaming of variables."""
    forward: dict[Var, Var] = {}
    backward: dict[Var, Var] = {}
    steps = _SHORT
    met: _Pairs | None = None
    todo = [left, right]
    while todo:
        right = deref(todo.pop())
        left = deref(todo.pop())
        if type(left) is not type(right):
            return False
        if type(left) is Var and type(right) is Var:
            if forward.setdefault(left, right) is not right or backward.setdefault(right, left) is not left:
                return False
        elif type(left) is Struct and type(right) is Struct:
            if left.name != right.name or len(left.args) != len(right.args):
                return False
            steps -= len(left.args)
            if steps < 0 and (met := met or _Pairs(meter)).before(left, right):
                continue
            push_pairs(todo, left, right)
        elif type(left) in _WEIGHED:
            if meter is not None:
                meter.spend(weight(left))
            if left != right:
                return False
        elif left != right:
            return False
    return True


def subsumes(general: Term, specific: Term, meter: Meter | None = None) -> bool:
    """Return whether `specific` is an instance of `general`; binds nothing. Source: ISO 13211-1, 8.2.4."""
    trail: Trail = [meter]
    before = term_variables(specific, meter)
    try:
        if not unify(general, specific, trail):
            return False
        after = [deref(variable) for variable in before]
        return all(type(term) is Var for term in after) and len(set(map(id, after))) == len(before)
    finally:
        undo(trail, 1)
