"""Asking from Python: queries, values, errors, and what a program shows of itself."""

from __future__ import annotations

import io
import itertools
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drlsl.logic import (
    Compound,
    Engine,
    ExistenceError,
    PrologError,
    PrologSyntaxError,
    PrologTypeError,
    Solution,
    String,
    Variable,
)
from drlsl.logic.conversion import Value, to_term, to_value
from drlsl.logic.terms import Atom, Struct, Term, Var
from tests.logic.engines import values


def test_a_prepared_query_follows_the_program(engine: Engine) -> None:
    query = engine.prepare("p(X)")
    with pytest.raises(ExistenceError):
        query.once()
    engine.consult_text("p(1). p(2).")
    assert [solution["X"] for solution in query.solutions()] == [1, 2]
    engine.replace_facts("p", 1, [(3,)])
    assert query.once() == Solution({"X": 3})
    engine.consult_text("p(4).")
    assert [solution["X"] for solution in query.solutions()] == [3, 4], "facts replaced are dynamic"
    assert query.holds()


def test_a_prepared_query_can_be_open_more_than_once(engine: Engine) -> None:
    engine.consult_text("p(1). p(2).")
    query = engine.prepare("p(X)")
    first, second = query.solutions(), query.solutions()
    assert [next(first)["X"], next(second)["X"], next(second)["X"], next(first)["X"]] == [1, 1, 2, 2]


def test_an_abandoned_query_runs_its_cleanup_and_undoes_its_bindings(engine: Engine) -> None:
    shared = Var("X")
    query = engine.query(Struct("member", (shared, to_term([1, 2]))))
    next(query)
    query.close()
    assert shared.ref is None
    query = engine.query("setup_call_cleanup(true, member(X, [1, 2]), nb_setval(cleaned, yes))")
    next(query)
    query.close()
    assert values(engine, "nb_getval(cleaned, X)") == ["yes"]


def test_solutions_outlive_backtracking(engine: Engine) -> None:
    found = list(engine.query("member(X, [f(A), g(B, B)]), Y = [X]"))
    assert found[0]["Y"] == [found[0]["X"]]
    assert found[1]["X"] == Compound("g", (Variable("B"), Variable("B")))


def test_variables_that_begin_with_an_underscore_are_left_out(engine: Engine) -> None:
    assert engine.once("X = 1, _Y = 2, _ = 3") == Solution({"X": 1})
    assert engine.once("true") == Solution({})
    assert engine.once("fail") is None


def test_solutions_are_sought_when_they_are_asked_for() -> None:
    output = io.StringIO()
    engine = Engine(output=output)
    query = engine.query("member(X, [1, 2, 3]), write(X)")
    assert output.getvalue() == ""
    assert len(list(itertools.islice(query, 2))) == 2
    assert output.getvalue() == "12"


@pytest.mark.parametrize("text", ["", "p(", "p. q.", "foo bar", "p :- q"])
def test_text_that_is_no_goal(engine: Engine, text: str) -> None:
    with pytest.raises(PrologError):
        engine.once(text)


def test_goals_may_be_values(engine: Engine) -> None:
    goal = Compound("member", (Variable("X"), [1, "a", String("s")]))
    assert [solution["X"] for solution in engine.query(goal)] == [1, "a", "s"]
    assert engine.holds(Atom("true"))
    assert engine.holds(Struct("=", (1, 1)))
    with pytest.raises(PrologTypeError, match="callable"):
        engine.once(3)  # type: ignore[arg-type]  # what is tested
    with pytest.raises(TypeError):
        engine.once(None)  # type: ignore[arg-type]  # what is tested


_KINDS = [
    ("a", "a"),
    ("'A b'", "A b"),
    ("[]", []),
    ("42", 42),
    ("-170141183460469231731687303715884105728", -(2**127)),
    ("1.5", 1.5),
    ("[1, [a, b], []]", [1, ["a", "b"], []]),
    ("f(x, 1)", Compound("f", ("x", 1))),
    ("[a|b]", Compound(".", ("a", "b"))),
    ("{x}", Compound("{}", ("x",))),
    ("-(1)", Compound("-", (1,))),
    ("a + b", Compound("+", ("a", "b"))),
    ("f(Y)", Compound("f", (Variable("Y"),))),
]


@pytest.mark.parametrize(("text", "value"), _KINDS, ids=[text for text, _ in _KINDS])
def test_values_of_every_kind(engine: Engine, text: str, value: Value) -> None:
    solution = engine.once(f"X = {text}")
    assert solution is not None
    found = solution["X"]
    assert (found, type(found)) == (value, type(value))
    again = engine.once(f"X = {engine.format(found)}")
    assert again is not None
    assert again["X"] == value


def test_strings_are_no_atoms() -> None:
    engine = Engine(flags={"double_quotes": "string"})
    solution = engine.once("X = \"a\\nb\", Y = 'a\\nb'")
    assert solution is not None
    assert (type(solution["X"]), type(solution["Y"])) == (String, str)
    assert (engine.format(solution["X"]), engine.format(solution["Y"])) == ('"a\\nb"', "'a\\nb'")


@given(
    st.recursive(
        st.text(max_size=3)
        | st.integers()
        | st.floats(allow_nan=False)
        | st.text(max_size=2).map(String)
        | st.builds(Variable, st.sampled_from(["X", "Y"])),
        lambda inner: (
            st.lists(inner, max_size=3)
            | st.builds(Compound, st.text(max_size=2), st.lists(inner, min_size=1, max_size=3).map(tuple))
        ),
        max_leaves=8,
    )
)
def test_values_come_back_as_they_went_in(value: Value) -> None:
    variables: dict[str, Var] = {}
    term = to_term(value, variables)
    names: dict[Term, str] = {variable: name for name, variable in variables.items()}
    # An empty list is the atom [], and a cell is a list: the only two ways to say one thing.
    expected = to_value(to_term(to_value(term, names), variables), names)
    assert to_value(term, names) == expected
    if "[]" not in repr(value) and "'.'" not in repr(value):
        assert to_value(term, names) == value


@pytest.mark.parametrize("value", [None, True, b"a", {1}, [None], Compound("f", (False,))])
def test_what_is_no_value_is_refused(engine: Engine, value: object) -> None:
    with pytest.raises(TypeError):
        engine.format(value)  # type: ignore[arg-type]  # what is tested


def test_deep_values_need_no_python_stack(engine: Engine) -> None:
    engine.consult_text("deep(0, z) :- !. deep(N, s(T)) :- M is N - 1, deep(M, T).")
    solution = engine.once("deep(50000, X)")
    assert solution is not None
    assert engine.format(solution["X"]) == "s(" * 50_000 + "z" + ")" * 50_000


def test_long_and_nested_goals_are_answered(engine: Engine) -> None:
    assert engine.holds(", ".join(["true"] * 20_000))
    assert engine.holds("(" * 20_000 + "true" + ", true)" * 20_000)
    assert engine.holds("numlist(1, 20000, L), foldl([_, G, (G, true)]>>true, L, true, G), call(G)")
    for nested in (
        "\\+ " * 20_001 + "fail",
        "(true -> " * 20_000 + "true" + ")" * 20_000,
        "(" * 20_000 + "true" + " -> true)" * 20_000,
        "(fail ; " * 5_000 + "true" + ")" * 5_000,
        "catch(" * 5_000 + "true" + ", _, true)" * 5_000,
        "findall(x, " * 5_000 + "true" + ", _)" * 5_000,
    ):
        assert engine.holds(nested)
        engine.consult_text(f":- {nested}.\nnested :- {nested}.", name="nested")
        assert engine.warnings == []
        assert engine.holds("nested, nested")
    for name in ("\\+", "call", "ignore"):
        goal = f"numlist(1, 20000, L), foldl([_, G, F]>>(F =.. [({name}), G]), L, true, G), call(G)"
        assert engine.holds(goal)


@pytest.mark.parametrize(
    ("goal", "hint"),
    [
        ("apend([1], [2], X)", "apend/3 does not exist; did you mean append/3?"),
        ("append([1])", "append/1 does not exist; there is append/2, append/3"),
        ("collison(a)", "collison/1 does not exist; did you mean collision/2?"),
        ("zzz(a)", "zzz/1 does not exist"),
    ],
)
def test_an_unknown_predicate_says_what_was_meant(engine: Engine, goal: str, hint: str) -> None:
    engine.consult_text("collision(_, _).")
    with pytest.raises(ExistenceError) as raised:
        engine.once(goal)
    assert raised.value.message() == f"existence error: procedure {hint}"


def test_the_flag_unknown() -> None:
    assert not Engine(flags={"unknown": "fail"}).holds("nobody(1)")
    engine = Engine(flags={"unknown": "warning"})
    assert not engine.holds("nobody(1)")
    assert [warning.message for warning in engine.warnings] == ["unknown procedure nobody/1"]


def test_errors_carry_their_goal_and_the_place_of_the_clause(engine: Engine) -> None:
    text = "top(X) :- middle(X).\nmiddle(X) :-\n    true,\n    Y is X + a,\n    Y > 0.\n"
    engine.consult_text(text, name="e.pl")
    for _ in range(2):
        with pytest.raises(PrologTypeError) as raised:
            engine.once("top(3)")
        assert raised.value.clause == "e.pl:2"
        assert isinstance(raised.value.goal, Struct)
        assert raised.value.goal.name == "is"
        assert "3+a" in str(raised.value)
        assert "(e.pl:2)" in str(raised.value)


def test_a_ball_of_any_kind_comes_out(engine: Engine) -> None:
    with pytest.raises(PrologError) as raised:
        engine.once("throw(my(ball, X, [1]))")
    assert type(raised.value) is PrologError
    assert "my(ball,X,[1])" in str(raised.value)


def test_defines(engine: Engine) -> None:
    engine.consult_text(":- dynamic(empty/2). p(1).")
    assert engine.defines("p", 1)
    assert engine.defines("empty", 2)
    assert not engine.defines("p", 2)
    assert not engine.defines("append", 3), "the library's, not the program's"
    with pytest.raises(ExistenceError):
        engine.once("caller")
    assert not engine.defines("caller", 0)


def test_unknown_flags_are_refused() -> None:
    with pytest.raises(PrologError, match="prolog_flag"):
        Engine(flags={"speed": "ludicrous"})


def test_the_clauses_of_a_program_can_be_read_and_replaced() -> None:
    engine = Engine()
    engine.consult_text("near(X) :- gap(X, G), G < 10.\nnear(nobody).\n:- dynamic(seen/1).")
    engine.replace_facts("gap", 2, [("v1", 4.0), ("v2", 40.0)])
    assert engine.predicates() == [("near", 1), ("seen", 1), ("gap", 2)]
    assert [str(clause.span) for clause in engine.clauses("near", 1)] == ["text:1", "text:2"]
    assert [clause.args[0] for clause in engine.clauses("gap", 2)] == [Atom("v1"), Atom("v2")]
    assert engine.clauses("seen", 1) == engine.clauses("nobody_defined_this", 3) == []
    engine.define("near", 1, engine.clauses("near", 1)[:1])
    assert [solution["X"] for solution in engine.query("near(X)")] == ["v1"]
    engine.define("near", 1, [])
    assert engine.defines("near", 1)
    assert not engine.holds("near(_)")


def test_reading_clauses_leaves_facts_told_as_rows_as_they_are() -> None:
    engine = Engine()
    engine.replace_facts("gap", 2, [("v1", 4.0)])
    before = engine.program.predicates["gap", 2].rows
    assert len(engine.clauses("gap", 2)) == 1
    assert engine.program.predicates["gap", 2].rows is before


def test_a_goal_is_read_with_the_operators_of_the_program() -> None:
    engine = Engine()
    engine.consult_text(":- op(700, xfx, nearer).")
    read = engine.read_goal("A nearer B")
    goal: Any = read.term
    assert (goal.name, len(goal.args), list(read.variables)) == ("nearer", 2, ["A", "B"])
    with pytest.raises(PrologSyntaxError):
        Engine().read_goal("A nearer B")


def test_answers_of_tabled_predicates_can_be_forgotten() -> None:
    engine = Engine()
    engine.consult_text(":- table p/1.\np(X) :- nb_getval(now, X).")
    for value in (1, 2):
        assert engine.holds(f"nb_setval(now, {value})")
        assert engine.once("p(X)") == {"X": 1}
    engine.forget_answers()
    assert engine.once("p(X)") == {"X": 2}
