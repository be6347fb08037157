"""Unification, the trail, and what compares, copies or walks terms.

Every function here is iterative, so a term's depth is bounded by memory and never by Python's stack.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cmp_to_key
from sys import getrefcount
from typing import Any, Final, Protocol

from drlsl.logic.errors import representation_error
from drlsl.logic.terms import Atom, Struct, Term, Var, deref

# After so many steps a walk through a term looks whether the term is cyclic.
_LONG_WALK: Final = 1_500_000


class Undoable(Protocol):
    """A trail entry: setting `ref` to None undoes what was done."""

    ref: Any


Trail = list[Any]


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
    """Take back every binding made since the trail was `mark` entries long, the latest first."""
    if len(trail) > mark:
        for entry in reversed(trail[mark:]):
            entry.ref = None
        del trail[mark:]


def compact(trail: Trail, start: int, marks: Iterable[int]) -> int:
    """Drop the entries from `start` on whose variable nobody else can reach; undoing those would be unseen.

    `marks` are positions not before `start` that must survive as positions, ascending. Only the entries
    behind the last of them are dropped, since the others' places are taken. Returns how many entries went.
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
        # Referred to by `entry` and by the call's own argument: nobody else holds the variable.
        if type(entry) is not Var or getrefcount(entry) > 2:
            trail.append(entry)
    return before - len(trail)


class _Patience:
    """Makes sure, once a walk has taken long, that it is not of a cyclic term, which would never end."""

    __slots__ = ("left",)

    def __init__(self) -> None:
        self.left = _LONG_WALK

    def check(self, *terms: Term) -> int:
        """The next number of steps before it is time to check again.

        Raises:
            RepresentationError: One of the terms is cyclic.
        """
        if not all(map(is_acyclic, terms)):
            raise representation_error("acyclic_term")
        self.left *= 4
        return self.left


def is_acyclic(root: Term) -> bool:
    """Whether a term is finite: no part of it contains itself."""
    done: set[int] = set()
    open_terms: set[int] = set()
    todo: list[tuple[Term, bool]] = [(root, False)]
    while todo:
        term, is_left = todo.pop()
        term = deref(term)
        if type(term) is not Struct or id(term) in done:
            continue
        if is_left:
            open_terms.discard(id(term))
            done.add(id(term))
        elif id(term) in open_terms:
            return False
        else:
            open_terms.add(id(term))
            todo.append((term, True))
            todo.extend((arg, False) for arg in term.args)
    return True


def unify(left: Term, right: Term, trail: Trail) -> bool:
    """Make two terms equal by binding variables; on failure the caller undoes what was bound.

    Raises:
        RepresentationError: A cyclic term, which unification without the occurs check may have made, is met.
    """
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
    return type(left) is type(right) and left == right


def _unify_compounds(left: Struct, right: Struct, trail: Trail) -> bool:
    """Unify compound terms: what can be settled at once is, only pairs of compound terms wait."""
    todo: list[Struct] = []
    steps = _LONG_WALK
    patience = None
    while True:
        left_args = left.args
        right_args = right.args
        if left.name != right.name or len(left_args) != len(right_args):
            return False
        steps -= 1
        if not steps:
            patience = patience or _Patience()
            steps = patience.check(left, right)
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
            if type(one) is Var:
                one.ref = other
                trail.append(one)
            elif type(other) is Var:
                other.ref = one
                trail.append(other)
            elif type(one) is Struct:
                if type(other) is not Struct:
                    return False
                todo.append(one)
                todo.append(other)
            elif type(one) is not type(other) or one != other:
                return False
        if not todo:
            return True
        right = todo.pop()
        left = todo.pop()


def occurs(variable: Var, term: Term) -> bool:
    """Whether an unbound variable occurs in a term."""
    todo = [term]
    while todo:
        term = deref(todo.pop())
        if term is variable:
            return True
        if type(term) is Struct:
            todo.extend(term.args)
    return False


def unify_occurs(left: Term, right: Term, trail: Trail) -> bool:
    """Unify with the occurs check, so that no cyclic term arises. Source: ISO 13211-1, 8.2.2."""
    todo: list[tuple[Term, Term]] = [(left, right)]
    while todo:
        left, right = todo.pop()
        left = deref(left)
        right = deref(right)
        if left is right:
            continue
        if type(right) is Var and type(left) is not Var:
            left, right = right, left
        if type(left) is Var:
            if type(right) is Struct and occurs(left, right):
                return False
            left.ref = right
            trail.append(left)
        elif type(left) is Struct:
            if type(right) is not Struct or left.name != right.name or len(left.args) != len(right.args):
                return False
            todo.extend(zip(reversed(left.args), reversed(right.args), strict=True))
        elif type(left) is not type(right) or left != right:
            return False
    return True


def is_ground(term: Term) -> bool:
    """Whether no unbound variable occurs in a term."""
    root = term
    todo = [term]
    steps, patience = _LONG_WALK, _Patience()
    while todo:
        steps -= 1
        if not steps:
            steps = patience.check(root)
        term = todo.pop()
        if type(term) is Var:
            term = deref(term)
            if type(term) is Var:
                return False
        if type(term) is Struct:
            todo.extend(term.args)
    return True


def copy_term(term: Term, renaming: dict[Var, Term] | None = None) -> Term:
    """A copy with fresh variables and no bound ones; `renaming` holds, and receives, old variable -> new."""
    term = deref(term)
    if renaming is None:
        renaming = {}
    if type(term) is Var:
        return renaming.setdefault(term, Var(term.name))
    if type(term) is not Struct:
        return term
    root = Struct(term.name, ())
    todo = [(root, term.args)]
    steps, patience = _LONG_WALK, _Patience()
    while todo:
        steps -= 1
        if not steps:
            steps = patience.check(term)
        shell, args = todo.pop()
        copied: list[Term] = []
        for arg in args:
            if type(arg) is Var:
                arg = deref(arg)
            if type(arg) is Struct:
                inner = Struct(arg.name, ())
                todo.append((inner, arg.args))
                arg = inner
            elif type(arg) is Var:
                fresh = renaming.get(arg)
                if fresh is None:
                    fresh = renaming[arg] = Var(arg.name)
                arg = fresh
            copied.append(arg)
        shell.args = tuple(copied)
    return root


def term_variables(term: Term) -> list[Var]:
    """The distinct unbound variables of a term, from left to right. Source: ISO 13211-1, 8.5.5."""
    found: dict[Var, None] = {}
    root = term
    todo = [term]
    steps, patience = _LONG_WALK, _Patience()
    while todo:
        steps -= 1
        if not steps:
            steps = patience.check(root)
        term = todo.pop()
        if type(term) is Var:
            term = deref(term)
            if type(term) is Var:
                found[term] = None
        if type(term) is Struct:
            todo.extend(reversed(term.args))
    return list(found)


_RANK = {Var: 0, float: 1, int: 1, Atom: 3, str: 4, Struct: 5}


def compare(left: Term, right: Term, *, iso: bool = True) -> int:
    """The standard order of terms: -1, 0 or 1.

    Variables precede numbers, then atoms, strings, and compound terms by arity, name and arguments. With
    `iso` every float precedes every integer; without, numbers compare by value and a float precedes the
    equal integer. Source: ISO 13211-1, 7.2.
    """
    todo: list[Term] = []
    first, second = left, right
    steps, patience = _LONG_WALK, _Patience()
    while True:
        steps -= 1
        if not steps:
            steps = patience.check(first, second)
        left = deref(left)
        right = deref(right)
        if left is not right:
            order = _compare_shallow(left, right, iso)
            if order:
                return order
            if type(left) is Struct and type(right) is Struct:
                for index in range(len(left.args) - 1, -1, -1):
                    todo.append(left.args[index])
                    todo.append(right.args[index])
        if not todo:
            return 0
        right = todo.pop()
        left = todo.pop()


def _compare_shallow(left: Term, right: Term, iso: bool) -> int:
    """The order of two distinct dereferenced terms, as far as it does not lie in their arguments."""
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
        # Addresses do not change while a variable lives, and that is all the standard asks of their order.
        first, second = id(left), id(right)
    else:
        first, second = left, right
    if first == second:
        return 0
    return -1 if first < second else 1


def sort_key(*, iso: bool = True) -> Callable[[Term], Any]:
    """A key that sorts by the standard order of terms."""
    return cmp_to_key(lambda left, right: compare(left, right, iso=iso))


def variant(left: Term, right: Term) -> bool:
    """Whether two terms are equal up to a renaming of variables."""
    forward: dict[Var, Var] = {}
    backward: dict[Var, Var] = {}
    todo = [(left, right)]
    while todo:
        left, right = todo.pop()
        left = deref(left)
        right = deref(right)
        if type(left) is not type(right):
            return False
        if type(left) is Var and type(right) is Var:
            if forward.setdefault(left, right) is not right or backward.setdefault(right, left) is not left:
                return False
        elif type(left) is Struct and type(right) is Struct:
            if left.name != right.name or len(left.args) != len(right.args):
                return False
            todo.extend(zip(left.args, right.args, strict=True))
        elif left != right:
            return False
    return True


def subsumes(general: Term, specific: Term) -> bool:
    """Whether `specific` is an instance of `general`; binds nothing. Source: ISO 13211-1, 8.2.4."""
    trail: Trail = []
    before = term_variables(specific)
    try:
        if not unify(general, specific, trail):
            return False
        after = [deref(variable) for variable in before]
        return all(type(term) is Var for term in after) and len(set(map(id, after))) == len(before)
    finally:
        undo(trail, 0)
