"""Builtins and library predicates: what they answer, in both kinds of engine."""

from __future__ import annotations

import pytest

from drlsl.logic import Compound, Engine, PrologError, Variable
from drlsl.logic.jit import tiering as tiers

PROGRAM = """
:- dynamic(counter/1).
age(peter, 7). age(ann, 11). age(pat, 8). age(tom, 5). age(mike, 11).
counter(0).
next(N) :- retract(counter(N)), M is N + 1, assertz(counter(M)).
twice(X, Y) :- Y is X * 2.
longer(N, X) :- X > N.
"""


@pytest.fixture(params=["plain", "compiled"])
def engine(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Engine:
    monkeypatch.setattr(tiers, "PATIENCE", 0)
    engine = Engine(compiled=request.param == "compiled")
    engine.consult_text(PROGRAM)
    return engine


def pair(key: object, value: object) -> Compound:
    return Compound("-", (key, value))  # type: ignore[arg-type]  # any value


@pytest.mark.parametrize(
    ("goal", "expected"),
    [
        # lists
        ("append(X, [c], [a, b, c])", [["a", "b"]]),
        ("append([[a], [b, c], []], X)", [["a", "b", "c"]]),
        ("member(X, [a, b])", ["a", "b"]),
        ("memberchk(f(X), [g(1), f(2), f(3)])", [2]),
        ("reverse([a, b, c], X)", [["c", "b", "a"]]),
        ("nth0(1, [a, b], X)", ["b"]),
        ("nth1(X, [a, b, a], a)", [1, 3]),
        ("nth0(1, [a, b, c], b, X)", [["a", "c"]]),
        ("last([a, b], X)", ["b"]),
        ("sum_list([1, 2, 3.5], X)", [6.5]),
        ("max_list([1, 5, 3], X)", [5]),
        ("min_list([4, 2, 3], X)", [2]),
        ("max_member(X, [a, f(1), 3])", [Compound("f", (1,))]),
        ("numlist(2, 4, X)", [[2, 3, 4]]),
        ("select(b, [a, b, c], X)", [["a", "c"]]),
        ("selectchk(a, [a, b, a], X)", [["b", "a"]]),
        ("select(b, [a, b], z, X)", [["a", "z"]]),
        ("subtract([a, b, c], [b], X)", [["a", "c"]]),
        ("intersection([a, b, c], [c, a], X)", [["a", "c"]]),
        ("union([a, b], [b, c], X)", [["a", "b", "c"]]),
        ("delete([a, b, a], a, X)", [["b"]]),
        ("exclude(longer(2), [1, 2, 3, 4], X)", [[1, 2]]),
        ("include(longer(2), [1, 2, 3, 4], X)", [[3, 4]]),
        ("partition(longer(2), [1, 3], X, _)", [[3]]),
        ("permutation([a, b, c], X), X = [c|_]", [["c", "a", "b"], ["c", "b", "a"]]),
        ("flatten([a, [b, [c]], []], X)", [["a", "b", "c"]]),
        ("list_to_set([a, B, a, B, 1, 1.0], X)", [["a", Variable("B"), 1, 1.0]]),
        ("length(X, 2), X = [a|_], last(X, b)", [["a", "b"]]),
        ("length([a|T], 2), T = [X]", [Variable("X")]),
        ("maplist(twice, [1, 2], X)", [[2, 4]]),
        ("maplist([A, B]>>(B is A + 1), [1, 2], X)", [[2, 3]]),
        ("foldl([E, A, B]>>(B is A + E), [1, 2, 3], 0, X)", [6]),
        ("sort([c, a, b, a], X)", [["a", "b", "c"]]),
        ("msort([c, a, b, a], X)", [["a", "a", "b", "c"]]),
        ("sort(0, @>=, [1, 3, 2, 3], X)", [[3, 3, 2, 1]]),
        ("sort(1, @<, [f(2), f(1), g(1)], X)", [[Compound("f", (1,)), Compound("f", (2,))]]),
        ("keysort([b-1, a-2, b-0], X)", [[pair("a", 2), pair("b", 1), pair("b", 0)]]),
        ("predsort([O, A, B]>>compare(O, A, B), [c, a, c], X)", [["a", "c"]]),
        ("pairs_keys_values(X, [a, b], [1, 2])", [[pair("a", 1), pair("b", 2)]]),
        # solutions
        ("findall(A, age(_, A), X)", [[7, 11, 8, 5, 11]]),
        ("findall(N, age(N, 11), X, [end])", [["ann", "mike", "end"]]),
        ("bagof(N, age(N, A), X)", [["tom"], ["peter"], ["pat"], ["ann", "mike"]]),
        ("bagof(A, N^age(N, A), X)", [[7, 11, 8, 5, 11]]),
        ("setof(A, N^age(N, A), X)", [[5, 7, 8, 11]]),
        ("setof(A-N, age(N, A), [X|_])", [pair(5, "tom")]),
        ("bagof(N, age(N, 99), X)", []),
        ("aggregate_all(count, age(_, _), X)", [5]),
        ("aggregate_all(sum(A), age(_, A), X)", [42]),
        ("aggregate_all(max(A), age(_, A), X)", [11]),
        ("aggregate_all(max(A, N), age(N, A), X)", [Compound("max", (11, "ann"))]),
        ("aggregate_all(min(A, N), age(N, A), X)", [Compound("min", (5, "tom"))]),
        ("aggregate_all(set(A), age(_, A), X)", [[5, 7, 8, 11]]),
        ("aggregate_all(max(A), age(nobody, A), X)", []),
        # terms
        ("functor(f(a, b), X, 2)", ["f"]),
        ("functor(T, f, 2), T = f(a, X), X = b", ["b"]),
        ("arg(2, f(a, b), X)", ["b"]),
        ("f(a, b) =.. X", [["f", "a", "b"]]),
        ("X =.. [f, a]", [Compound("f", ("a",))]),
        ("copy_term(f(A, B, A), f(1, 2, X))", [1]),
        ("term_variables(f(X, g(Y), X), L), length(L, N), X = N", [2]),
        ("compare(X, 1, a)", ["<"]),
        ("compare(X, f(b), g(a))", ["<"]),
        ("compare(X, f(a, a), g(b))", [">"]),
        ("(subsumes_term(f(_), f(a)) -> X = yes ; X = no)", ["yes"]),
        ("(subsumes_term(f(a), f(_)) -> X = yes ; X = no)", ["no"]),
        ("(unify_with_occurs_check(A, f(A)) -> X = yes ; X = no)", ["no"]),
        ("(f(A, B) =@= f(B, A) -> X = yes ; X = no)", ["yes"]),
        ("(f(A, A) =@= f(B, C) -> X = yes ; X = no)", ["no"]),
        # numbers
        ("between(1, 3, X)", [1, 2, 3]),
        ("between(1, inf, X), X > 1, !", [2]),
        ("succ(X, 4)", [3]),
        ("succ(3, X)", [4]),
        ("plus(1, X, 3)", [2]),
        # state
        ("next(_), next(X)", [1]),
        ("nb_setval(k, f(Y)), Y = 1, nb_getval(k, f(X))", [Variable("X")]),
        ("(b_setval(k, 1), fail ; nb_setval(k, 2), (b_setval(k, 3), fail ; b_getval(k, X)))", [2]),
        ("list_to_assoc([b-2, a-1], A), put_assoc(c, A, 3, B), assoc_to_list(B, X)",
         [[pair("a", 1), pair("b", 2), pair("c", 3)]]),
        ("catch(number_codes(X, \"1x\"), error(syntax_error(_), _), X = wrong)", ["wrong"]),
    ],
)  # fmt: skip
def test_answers(engine: Engine, goal: str, expected: list[object]) -> None:
    assert [solution["X"] for solution in engine.query(goal)] == expected


@pytest.mark.parametrize(
    ("goal", "error"),
    [
        ("call(_)", "instantiation_error"),
        ("call(1)", "type_error(callable,1)"),
        ("call((fail, 1))", "type_error(callable,(fail,1))"),
        ("findall(X, _, L)", "instantiation_error"),
        ("findall(X, true, [a|b])", "type_error(list,[a|b])"),
        ("functor(T, N, 2)", "instantiation_error"),
        ("functor(T, foo(a), 1)", "type_error(atomic,foo(a))"),
        ("functor(T, f, -1)", "domain_error(not_less_than_zero,-1)"),
        ("X =.. []", "domain_error(non_empty_list,[])"),
        ("X =.. [f|_]", "instantiation_error"),
        ("arg(a, f(a), X)", "type_error(integer,a)"),
        ("length(L, -1)", "domain_error(not_less_than_zero,-1)"),
        ("length(a, N)", "type_error(list,a)"),
        ("msort([a|_], X)", "instantiation_error"),
        ("keysort([a], X)", "type_error(pair,a)"),
        ("succ(X, Y)", "instantiation_error"),
        ("succ(X, -1)", "type_error(not_less_than_zero,-1)"),
        ("assertz((foo :- 4))", "type_error(callable,4)"),
        ("assertz((_ :- true))", "instantiation_error"),
        ("assertz((4 :- true))", "type_error(callable,4)"),
        ("assertz(atom(_))", "permission_error(modify,static_procedure,atom/1)"),
        ("assertz(age(x, 1))", "permission_error(modify,static_procedure,age/2)"),
        ("retract(age(x, 1))", "permission_error(modify,static_procedure,age/2)"),
        ("abolish(foo/a)", "type_error(integer,a)"),
        ("clause(atom(_), B)", "permission_error(access,private_procedure,atom/1)"),
        ("nb_getval(no_such_key, V)", "existence_error(variable,no_such_key)"),
        ("throw(_)", "instantiation_error"),
        ("nobody_knows(1)", "existence_error(procedure,nobody_knows/1)"),
        ("between(1, a, X)", "type_error(integer,a)"),
        ("nth0(a, [b], X)", "type_error(integer,a)"),
        ("aggregate_all(avg(X), member(X, [1]), A)", "domain_error(aggregate_template,avg(_))"),
    ],
)
def test_errors(engine: Engine, goal: str, error: str) -> None:
    from drlsl.logic.terms import format_term

    with pytest.raises(PrologError) as raised:
        engine.once(goal)
    text = format_term(raised.value.formal, engine.operators, quoted=True)
    assert text.split("_G")[0].rstrip("_)") == error.split("_)")[0].rstrip("_)")


@pytest.mark.parametrize(
    ("setup", "goal", "expected"),
    [
        # The logical update view: a call sees its predicate as it was when it began.
        ("", "p(X), assertz(p(9))", [1, 2, 3]),
        ("", "p(X), retract(p(3))", [1]),
        ("", "(p(X), retractall(p(_)) ; p(X))", [1, 2, 3]),
        ("", "p(X), asserta(p(0))", [1, 2, 3]),
        ("", "retract(p(X)), assertz(p(X))", [1, 2, 3]),
        ("retract(p(2))", "p(X)", [1, 3]),
        ("asserta(p(0)), assertz(p(4))", "p(X)", [0, 1, 2, 3, 4]),
        ("assertz((p(X) :- X = 7))", "p(7), X = yes", ["yes"]),
        ("retractall(p(_))", "p(X)", []),
        ("abolish(p/1)", "catch(p(X), _, X = gone)", ["gone"]),
        ("assertz((p(X) :- q, !)), assertz(q)", "clause(p(_), (q, !)), X = found", ["found"]),
    ],
)
def test_database(engine: Engine, setup: str, goal: str, expected: list[object]) -> None:
    engine.consult_text(":- dynamic(p/1). :- dynamic(q/0). p(1). p(2). p(3).", name="facts")
    if setup:
        assert engine.holds(setup)
    found = [solution["X"] for solution in engine.query(goal)]
    assert found == expected


def test_queue_of_facts_is_not_quadratic(engine: Engine) -> None:
    engine.consult_text(
        ":- dynamic(job/1). drain(N) :- retract(job(N)), fail. drain(_). pop(X) :- retract(job(X)), !."
    )
    engine.replace_facts("job", 1, [(number,) for number in range(20_000)])
    for expected in range(50):
        assert engine.once("pop(X)") == {"X": expected}
    assert engine.holds("drain(_)")
    assert not engine.holds("job(_)")


def test_determinism_of_indexed_calls(engine: Engine) -> None:
    from drlsl.logic import Limits
    from drlsl.logic.core import FOUND, Machine
    from drlsl.logic.syntax import read_term

    engine.consult_text(
        "kind(1, one). kind(a, letter). kind(f(_), compound). kind([], nil). kind([_|_], list).", name="k"
    )
    for first in ("1", "a", "f(x)", "[]", "[b]"):
        machine = Machine(engine, Limits())
        goal = read_term(f"kind({first}, K)", engine.operators, engine.flags).term
        assert machine.solve(machine.call(goal, FOUND))
        assert len(machine.choices) == 1, first
