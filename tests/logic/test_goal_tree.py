"""A body is read once, into goals whose meaning every tier takes from the same tree."""

from __future__ import annotations

import pytest

from drlsl.logic.core import (
    CLAUSE,
    CONSTRUCTS,
    GOAL_ARGUMENTS,
    Call,
    Conjunction,
    Cut,
    Derived,
    Disjunction,
    Findall,
    Goal,
    IfThenElse,
    Negation,
    NotCallable,
    Opaque,
    Truth,
    conjuncts,
    cuts,
    joined,
    read_body,
)
from drlsl.logic.limits import LimitExceeded, Limits, Meter
from drlsl.logic.syntax import Flags, ReadTerm, read_term
from drlsl.logic.terms import CyclicTerm, Operators, Struct, Term, Var


def read(text: str) -> ReadTerm:
    return read_term(text, Operators(), Flags(), "here")


def tree(text: str) -> Goal:
    return read_body(read(text).term)


def shape(goal: Goal) -> str:
    """The tree in short: a letter for each kind of goal, what it is made of in brackets."""
    match goal:
        case Call(name, args):
            return f"{name}/{len(args)}"
        case Truth(holds):
            return "true" if holds else "fail"
        case Cut(barrier):
            return "!" if barrier is CLAUSE else "!local"
        case Conjunction(goals):
            return f"[{' '.join(map(shape, goals))}]"
        case Disjunction(first, second):
            return f"either({shape(first)} {shape(second)})"
        case IfThenElse(condition, then, otherwise, soft):
            parts = " ".join(map(shape, (condition, then, otherwise)))
            return f"{'soft' if soft else 'if'}({parts})"
        case Negation(inner):
            return f"not({shape(inner)})"
        case Opaque(inner):
            return f"call({shape(inner)})"
        case Findall(_, inner):
            return f"all({shape(inner)})"
        case Derived(_, meaning, term):
            return f"{term.name}={shape(meaning)}"
        case NotCallable():
            return "error"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a", "a/0"),
        ("X", "call/1"),
        ("1", "error"),
        ("true", "true"),
        ("false", "fail"),
        ("(a, b), !, (c, d)", "[a/0 b/0 ! c/0 d/0]"),
        ("a, 1", "error"),
        ("a ; b ; c", "either(a/0 either(b/0 c/0))"),
        ("!, a -> ! ; !", "if([!local a/0] ! !)"),
        ("a *-> b", "soft(a/0 b/0 fail)"),
        ("a *-> b ; c", "soft(a/0 b/0 c/0)"),
        ("(a -> b ; c) ; d", "either(if(a/0 b/0 c/0) d/0)"),
        ("(a -> b ; fail) ; d", "either(if(a/0 b/0 fail) d/0)"),
        ("once(a) ; b", "either(once=if(a/0 true fail) b/0)"),
        ("ignore(!)", "ignore=if(!local true true)"),
        ("\\+ (a, !)", "not([a/0 !local])"),
        ("not(a)", "not(a/0)"),
        ("\\+ (X, !)", "not(call/1)"),
        ("\\+ \\+ (X, !)", "not(not(call/1))"),
        ("call((a, !))", "call([a/0 !local])"),
        ("call((X, !))", "call/1"),
        ("call(a, X)", "call/2"),
        ("a ; call((b, 1))", "either(a/0 error)"),
        ("findall(X, (a ; b), L)", "all(either(a/0 b/0))"),
        ("findall(X, (Y, b), L)", "all(call/1)"),
        ("forall((a, b), c)", "forall=not([a/0 b/0 not(c/0)])"),
        ("forall(a, 1)", "error"),
        ("catch(a, _, b)", "catch/3"),
    ],
)
def test_a_body_is_read_into_goals(text: str, expected: str) -> None:
    assert shape(tree(text)) == expected


def test_every_construct_is_read_and_has_its_goals_in_places() -> None:
    for (name, arity), construct in CONSTRUCTS.items():
        args: tuple[Term, ...] = tuple(Struct(f"goal{n}", (n,)) for n in range(arity))
        term = Struct(name, args)
        goal = read_body(term)
        assert not isinstance(goal, Call | NotCallable)
        assert goal.term is term
        assert GOAL_ARGUMENTS[name, arity] == construct.places
        assert all(f"goal{n}/1" in shape(goal) for n in construct.places)


def test_a_cut_is_found_where_it_cuts_the_clause() -> None:
    assert cuts(tree("a, ( b -> c, ! ; d )"))
    assert not cuts(tree("( ! -> a ; b ), \\+ !, once(!), findall(X, !, L), call(!), forall(!, !)"))


def test_goals_know_where_they_stand() -> None:
    term = read("p :-\n  a,\n  ( b\n  -> \\+ c\n  ;  once(\n    d)).")
    assert isinstance(term.term, Struct)
    body = read_body(term.term.args[1], term.place(term.term, 1), term)
    first, second = conjuncts(body)
    assert isinstance(second, IfThenElse)
    assert isinstance(second.then, Negation)
    assert isinstance(second.otherwise, Derived)
    goals = (first, second.condition, second.then.goal, *second.otherwise.goals)
    places = [(goal.place.line, goal.place.column) for goal in goals if goal.place is not None]
    assert places == [(2, 3), (3, 5), (4, 9), (6, 5)]


@pytest.mark.parametrize("name", [",", ";", "->", "\\+"])
def test_a_body_without_end_is_refused(name: str) -> None:
    hole = Var()
    hole.ref = body = Struct(name, (hole,) if name == "\\+" else (Struct("a", (1,)), hole))
    with pytest.raises(CyclicTerm):
        read_body(body)


@pytest.mark.parametrize("name", [",", ";", "->", "\\+"])
def test_a_body_may_be_as_deep_as_it_will(name: str) -> None:
    end = body = read("a").term
    for _ in range(50_000):
        body = Struct(name, (body,) if name == "\\+" else (body, end))
    assert not isinstance(read_body(body), NotCallable)


def test_reading_counts_what_it_does() -> None:
    body: Term = read("a").term
    for _ in range(60):
        body = Struct(",", (body, body))
    with pytest.raises(LimitExceeded):
        read_body(body, meter=Meter(Limits(inferences=1000)))
    with pytest.raises(LimitExceeded):
        joined(body, Meter(Limits(inferences=1000)))
