"""The public API: loading, asking, facts in bulk, values and errors."""

from __future__ import annotations

from pathlib import Path

import pytest

from drlsl.logic import (
    Compound,
    ConsultError,
    Engine,
    ExistenceError,
    PrologError,
    PrologPermissionError,
    PrologSyntaxError,
    String,
    Variable,
)


@pytest.fixture
def engine() -> Engine:
    return Engine()


@pytest.mark.parametrize(
    ("term", "value"),
    [
        ("atom", "atom"),
        ("'Quoted atom'", "Quoted atom"),
        ("42", 42),
        ("-1.5", -1.5),
        ("[]", []),
        ("[1, [a], f(X)]", [1, ["a"], Compound("f", (Variable("X"),))]),
        ("f(Y, g(Y))", Compound("f", (Variable("Y"), Compound("g", (Variable("Y"),))))),
        ("[a|T]", Compound(".", ("a", Variable("T")))),
    ],
)
def test_values(engine: Engine, term: str, value: object) -> None:
    solution = engine.once(f"V = {term}")
    assert solution is not None
    assert solution["V"] == value


def test_strings_are_no_atoms() -> None:
    solution = Engine(flags={"double_quotes": "string"}).once('X = "text"')
    assert solution is not None
    assert isinstance(solution["X"], String)


def test_solution_leaves_out_anonymous_variables(engine: Engine) -> None:
    solution = engine.once("f(X, _Y, _) = f(1, 2, 3)")
    assert solution is not None
    assert dict(solution) == {"X": 1}


def test_deep_value(engine: Engine) -> None:
    engine.consult_text("deep(0, z) :- !. deep(N, s(T)) :- M is N - 1, deep(M, T).")
    solution = engine.once("deep(20000, T)")
    assert solution is not None
    depth, value = 0, solution["T"]
    while isinstance(value, Compound):
        value, depth = value.args[0], depth + 1
    assert (depth, value) == (20000, "z")


def test_cyclic_term_is_an_error(engine: Engine) -> None:
    with pytest.raises(PrologError, match="acyclic"):
        engine.once("X = f(X)")


def test_replace_facts(engine: Engine) -> None:
    engine.consult_text("near(C) :- at(ego, X), at(C, Y), C \\== ego, abs(X - Y) < 5.")
    engine.replace_facts("at", 2, [("ego", 1.0), ("a", 2), ("b", 9.5)])
    assert [solution["C"] for solution in engine.query("near(C)")] == ["a"]
    engine.replace_facts("at", 2, [("ego", 9.0), ("b", 9.5)])
    assert [solution["C"] for solution in engine.query("near(C)")] == ["b"]
    engine.replace_facts("at", 2, [])
    assert not engine.holds("near(_)")


def test_facts_tell_integers_from_floats(engine: Engine) -> None:
    engine.replace_facts("n", 2, [(1, "int"), (1.0, "float")])
    assert [solution["X"] for solution in engine.query("n(1, X)")] == ["int"]
    assert [solution["X"] for solution in engine.query("n(1.0, X)")] == ["float"]


def test_facts_with_a_repeated_variable(engine: Engine) -> None:
    engine.replace_facts("edge", 2, [("a", "b"), ("c", "c")])
    assert [solution["X"] for solution in engine.query("edge(X, X)")] == ["c"]


def test_running_query_keeps_the_facts_it_began_with(engine: Engine) -> None:
    engine.replace_facts("n", 1, [(1,), (2,), (3,)])
    query = engine.query("n(X)")
    seen = [next(query)["X"]]
    engine.replace_facts("n", 1, [(7,)])
    seen += [solution["X"] for solution in query]
    assert seen == [1, 2, 3]


def test_facts_can_be_asserted_to_and_retracted_from(engine: Engine) -> None:
    engine.replace_facts("n", 1, [(1,), (2,)])
    assert engine.holds("assertz(n(3)), retract(n(1))")
    assert [solution["X"] for solution in engine.query("n(X)")] == [2, 3]
    assert engine.holds("clause(n(2), true)")


@pytest.mark.parametrize("value", [True, None, object(), ("a",)])
def test_facts_of_other_types_are_refused(engine: Engine, value: object) -> None:
    with pytest.raises(TypeError):
        engine.replace_facts("n", 1, [(value,)])  # type: ignore[list-item]  # what the test is about


def test_facts_of_another_length_are_refused(engine: Engine) -> None:
    with pytest.raises(ValueError, match="n/2"):
        engine.replace_facts("n", 2, [("a",)])


def test_every_syntax_error_is_reported_and_nothing_loaded(engine: Engine) -> None:
    engine.consult_text("kept(1).")
    with pytest.raises(ConsultError) as raised:
        engine.consult_text("ok(1).\nbad(.\nok(2).\nworse(]).\n", name="rules.pl")
    lines = [error.line for error in raised.value.errors if isinstance(error, PrologSyntaxError)]
    assert lines == [2, 4]
    assert not engine.program.find("ok", 1)
    assert engine.holds("kept(1)")


def test_failed_consult_restores_facts_operators_and_flags(engine: Engine) -> None:
    engine.consult_text(":- dynamic(n/1). n(1).")
    with pytest.raises(PrologSyntaxError):
        engine.consult_text(
            ":- op(700, xfx, ===>).\n:- set_prolog_flag(double_quotes, atom).\n:- retract(n(1)).\nbad(."
        )
    assert engine.holds("n(1)")
    assert engine.flags.double_quotes == "codes"
    with pytest.raises(PrologSyntaxError):
        engine.once("X = (a ===> b)")


def test_directive_error_is_an_error_and_failure_a_warning(engine: Engine) -> None:
    with pytest.raises(ExistenceError, match="dynamc"):
        engine.consult_text(":- dynamc(foo/1).")
    engine.consult_text(":- fail.\nok.", name="rules.pl")
    assert [str(warning) for warning in engine.warnings] == ["rules.pl:1: the directive failed"]


def test_warnings(engine: Engine) -> None:
    engine.consult_text("a(X) :- b(Y).\nb(1).\na(2).\n", name="rules.pl")
    messages = [str(warning) for warning in engine.warnings]
    assert any(message.startswith("rules.pl:1: singleton") for message in messages)
    assert any("rules.pl:3" in message and "a/1" in message for message in messages)


def test_standard_predicates_are_protected_and_others_may_be_defined_anew(engine: Engine) -> None:
    with pytest.raises(PrologPermissionError):
        engine.consult_text("append([], L, L). atom_length(X, X).")
    engine.consult_text("p(X) :- last([1, 2], X).")
    assert engine.once("p(X)") == {"X": 2}
    engine.consult_text("last([X|_], first(X)). succ(a, b).", name="own")
    assert engine.once("p(X)") == {"X": Compound("first", (1,))}
    assert engine.once("succ(a, X)") == {"X": "b"}
    assert Engine().once("succ(1, X)") == {"X": 2}


def test_reconsulting_a_file_replaces_it(engine: Engine, tmp_path: Path) -> None:
    path = tmp_path / "rules.pl"
    path.write_text(":- dynamic(fact/1). fact(1). rule(1). gone(1).")
    engine.consult(path)
    path.write_text("fact(2). rule(2).")
    engine.consult(path)
    assert [solution["X"] for solution in engine.query("rule(X)")] == [2]
    assert [solution["X"] for solution in engine.query("fact(X)")] == [2]
    assert not engine.holds("catch(gone(_), _, fail)")


def test_include_ensure_loaded_and_initialization(engine: Engine, tmp_path: Path) -> None:
    (tmp_path / "part.pl").write_text("part(1).")
    (tmp_path / "lib.pl").write_text("lib(1).")
    main = tmp_path / "main.pl"
    main.write_text(
        ":- initialization(assertz(started(X))) .\n:- dynamic(started/1).\n:- include(part).\n"
        ":- ensure_loaded('lib.pl').\n:- ensure_loaded(lib).\n:- use_module(library(lists)).\n"
    )
    engine.consult(main)
    assert engine.holds("part(1), lib(1), started(_)")


def test_unknown_library_is_an_error(engine: Engine) -> None:
    with pytest.raises(ExistenceError, match="clpfd"):
        engine.consult_text(":- use_module(library(clpfd)).")


def test_grammar_rules(engine: Engine) -> None:
    engine.consult_text(
        "digits([D|T]) --> digit(D), digits(T).\ndigits([D]) --> digit(D).\n"
        "digit(D) --> [D], { D >= 0'0, D =< 0'9 }.\n"
        "word(W), [end] --> [W], \\+ [no], !.\n"
    )
    assert engine.holds("atom_codes('42', Cs), phrase(digits(Ds), Cs), atom_codes(A, Ds), A == '42'")
    assert engine.once("phrase(word(W), [a, b], R)") == {"W": "a", "R": ["end", "b"]}
    assert not engine.holds("phrase(word(_), [a, no], _)")


def test_unknown_procedure_says_what_may_be_meant(engine: Engine) -> None:
    engine.consult_text("safe_actions(keep).")
    with pytest.raises(ExistenceError, match="did you mean safe_actions/1"):
        engine.once("safe_action(X)")
    with pytest.raises(ExistenceError, match="there is safe_actions/1"):
        engine.once("safe_actions(X, Y)")
    with pytest.raises(ExistenceError, match="did you mean append/3"):
        engine.once("apend(X, Y, Z)")


def test_unknown_flag_set_to_fail() -> None:
    assert not Engine(flags={"unknown": "fail"}).holds("nobody_knows")


def test_prepared_query_sees_changes(engine: Engine) -> None:
    query = engine.prepare("total(T)")
    engine.consult_text(":- dynamic(n/1). total(T) :- findall(X, n(X), L), sum_list(L, T).")
    assert query.once() == {"T": 0}
    engine.replace_facts("n", 1, [(2,), (3,)])
    assert query.once() == {"T": 5}
    engine.consult_text("total(none).", name="other")
    assert query.once() == {"T": "none"}


def test_query_takes_a_term(engine: Engine) -> None:
    from drlsl.logic.syntax import read_term

    goal = read_term("member(X, [a, b])", engine.operators, engine.flags).term
    assert [solution["X"] for solution in engine.query(goal)] == ["a", "b"]  # type: ignore[arg-type]  # a goal


def test_engines_share_nothing() -> None:
    one, other = Engine(), Engine()
    one.consult_text(":- op(700, xfx, ~>). :- dynamic(n/1). n(1). p :- nb_setval(k, 1).")
    one.once("p")
    assert not other.program.find("n", 1)
    with pytest.raises(ExistenceError):
        other.once("nb_getval(k, _)")
    with pytest.raises(PrologSyntaxError):
        other.once("X = (a ~> b)")


def test_clauses_carry_where_they_stand(engine: Engine) -> None:
    engine.consult_text("a(1).\n\nb(X) :-\n  a(X).\n", name="rules.pl")
    (clause,) = engine.program.predicates["b", 1].clauses
    assert (clause.span.name, clause.span.line, clause.span.end_line) == ("rules.pl", 3, 4)
