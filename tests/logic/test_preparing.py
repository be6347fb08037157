"""Clauses are made ready when they are loaded, and that changes no answer."""

from __future__ import annotations

import pytest

from drlsl.logic import Engine, Limits, PrologError
from drlsl.logic.core import compile_clause
from drlsl.logic.limits import Meter
from drlsl.logic.terms import Atom, Struct


@pytest.mark.parametrize("compiled", [True, False])
def test_a_loaded_clause_is_ready_before_the_first_call(compiled: bool) -> None:
    engine = Engine(compiled=compiled)
    engine.consult_text("p(X) :- q(X, Y), Y > 1.\nq(a, 1).\nq(b, 2).\n")
    predicate = engine.program.get("p", 1)
    assert all(clause.code is not None for clause in predicate.clauses)
    assert [solution["X"] for solution in engine.query("p(X)")] == ["b"]


@pytest.mark.parametrize("compiled", [True, False])
def test_a_predicate_asserted_after_loading_hides_the_library(compiled: bool) -> None:
    engine = Engine(compiled=compiled)
    engine.consult_text("define :- assertz(last(x, y)).\nask(A, B) :- last(A, B).\n")
    assert engine.holds("define")
    assert engine.holds("ask(x, y)")


@pytest.mark.parametrize("compiled", [True, False])
def test_a_predicate_abolished_while_loading_hides_the_library_no_longer(compiled: bool) -> None:
    engine = Engine(compiled=compiled)
    engine.consult_text("last(x, y).\nask(A, B) :- last(A, B).\n", "first")
    assert engine.holds("ask(x, y)")
    engine.consult_text(":- abolish(last/2).\n", "second")
    assert engine.holds("ask([1, 2], 2)")


@pytest.mark.parametrize("compiled", [True, False])
def test_a_dynamic_predicate_abolished_before_the_first_call_hides_nothing(compiled: bool) -> None:
    engine = Engine(compiled=compiled)
    engine.consult_text(":- dynamic last/2.\nlast(x, y).\nask(A, B) :- last(A, B).\n")
    assert engine.holds("abolish(last/2)")
    assert engine.holds("ask([1, 2], 2)")


@pytest.mark.parametrize("compiled", [True, False])
def test_what_is_wrong_with_a_clause_is_an_error_once_it_is_reached(compiled: bool) -> None:
    engine = Engine(compiled=compiled)
    engine.consult_text("p(a).\np(b) :- fail.\np(c).\n")
    predicate = engine.program.get("p", 1)
    wrong = predicate.clauses[1]
    wrong.body = Struct(",", (Atom("fail"), 1))
    wrong.code = None
    with pytest.raises(PrologError, match="callable"):
        compile_clause(wrong, engine.program.link)
    engine.linker.prepare([predicate], Meter(Limits()))
    assert [clause.code is not None for clause in predicate.clauses] == [True, False, True]
    assert engine.holds("p(a)")
    assert engine.holds("p(c)")
    with pytest.raises(PrologError, match="callable"):
        engine.holds("p(b)")


@pytest.mark.parametrize("compiled", [True, False])
def test_a_goal_that_is_wrong_is_an_error_once_it_is_asked(compiled: bool) -> None:
    query = Engine(compiled=compiled).prepare(Struct(",", (Atom("fail"), 1)))
    with pytest.raises(PrologError, match="callable"):
        query.holds()


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("goal", ["last([1, 2], X)", "plus(1, 1, X)"])
def test_a_query_follows_a_definition_that_hides_what_it_called(goal: str, compiled: bool) -> None:
    engine = Engine(compiled=compiled, flags={"iso": "false"})
    query = engine.prepare(goal)
    assert [solution["X"] for solution in query.solutions()] == [2]
    engine.consult_text("last(_, mine).\nplus(_, _, mine).\n")
    assert [solution["X"] for solution in query.solutions()] == ["mine"]
