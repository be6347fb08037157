"""The public face of the engine: loading, warnings, facts replaced, queries, values, errors."""

from __future__ import annotations

import io
import itertools
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drlsl.logic import (
    Compound,
    ConsultError,
    Engine,
    ExistenceError,
    Halt,
    PrologError,
    PrologSyntaxError,
    PrologTypeError,
    Solution,
    String,
    Variable,
)
from drlsl.logic.conversion import Value, to_term, to_value
from drlsl.logic.jit import tiering as tiers
from drlsl.logic.terms import Atom, Struct, Term, Var


@pytest.fixture(params=["plain", "compiled"])
def engine(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Engine:
    """An engine of each kind; the compiled one compiles at the first call."""
    monkeypatch.setattr(tiers, "PATIENCE", 0)
    return Engine(compiled=request.param == "compiled")


def values(engine: Engine, goal: str, name: str = "X") -> list[object]:
    return [solution[name] for solution in engine.query(goal)]


# ---------------------------------------------------------------------- loading

BROKEN = {
    "syntax": "p(new). q(",
    "clause": "p(new). 1 :- p(_).",
    "builtin": "p(new). atom(_).",
    "body": "p(new). q :- 3.",
    "directive": "p(new). :- atom_length(_, _).",
    "initialization": "p(new). :- initialization(throw(oops)).",
    "include": "p(new). :- include(no_such_file).",
    "operators": ":- op(700, xfx, ===>). p(a ===> b). q(",
    "flags": ":- set_prolog_flag(double_quotes, atom). p(new). q(",
    "database": ":- assertz(p(9)), retract(p(1)), assertz(fresh(1)). q(",
    "dynamic": ":- dynamic(fresh/1). fresh(2). q(",
}


@pytest.mark.parametrize("text", BROKEN.values(), ids=BROKEN)
def test_a_text_with_errors_leaves_the_program_as_it_was(engine: Engine, text: str) -> None:
    engine.consult_text("p(1). p(2). :- dynamic(counter/1). counter(0).", name="kept.pl")
    engine.warnings.clear()
    with pytest.raises(PrologError):
        engine.consult_text(text)
    assert values(engine, "p(X)") == [1, 2]
    assert values(engine, "counter(X)") == [0]
    assert engine.defines("q", 0) is engine.defines("fresh", 1) is engine.defines("q", 1) is False
    assert values(engine, "current_prolog_flag(double_quotes, X)") == ["codes"]
    assert engine.warnings == []
    with pytest.raises(PrologSyntaxError):
        engine.prepare("X = (a ===> b)")


def test_a_program_that_halts_while_loading_is_not_loaded(engine: Engine) -> None:
    engine.consult_text("p(1).")
    with pytest.raises(Halt):
        engine.consult_text("p(2). :- halt.")
    assert values(engine, "p(X)") == [1]


def test_an_interrupted_load_leaves_the_program_as_it_was(
    engine: Engine, monkeypatch: pytest.MonkeyPatch
) -> None:
    engine.consult_text("p(1).")

    def interrupted(*_: object, **__: object) -> bool:
        raise KeyboardInterrupt

    monkeypatch.setattr(engine, "run_directive", interrupted)
    with pytest.raises(KeyboardInterrupt):
        engine.consult_text("p(2). :- true.")
    monkeypatch.undo()
    assert values(engine, "p(X)") == [1]


def test_loading_a_file_again_replaces_what_it_said(engine: Engine, tmp_path: Path) -> None:
    path = tmp_path / "rules.pl"
    path.write_text(":- dynamic(seen/1).\np(1).\np(2).\nold(1).\nseen(a).\n", encoding="utf-8")
    engine.consult(path)
    engine.consult_text("seen(b). other(1).", name="other.pl")
    path.write_text(":- dynamic(seen/1).\np(3).\nseen(c).\n", encoding="utf-8")
    engine.consult(path)
    assert values(engine, "p(X)") == [3]
    assert not engine.holds("old(_)")
    assert sorted(map(str, values(engine, "seen(X)"))) == ["b", "c"]
    assert engine.holds("other(1)")


def test_a_file_that_failed_loads_once_it_is_mended(engine: Engine, tmp_path: Path) -> None:
    """What the failed load had loaded by ensure_loaded/1 is loaded again."""
    (tmp_path / "base.pl").write_text("base(1).\n", encoding="utf-8")
    main = tmp_path / "main.pl"
    main.write_text(":- ensure_loaded(base).\np(\n", encoding="utf-8")
    with pytest.raises(PrologSyntaxError):
        engine.consult(main)
    assert not engine.defines("base", 1)
    main.write_text(":- ensure_loaded(base).\np(X) :- base(X).\n", encoding="utf-8")
    engine.consult(main)
    assert values(engine, "p(X)") == [1]


def test_files_may_name_each_other(engine: Engine, tmp_path: Path) -> None:
    (tmp_path / "one.pl").write_text(":- ensure_loaded(two). one(X) :- two(X).", encoding="utf-8")
    (tmp_path / "two.pl").write_text(":- ensure_loaded('one.pl'). two(2).", encoding="utf-8")
    engine.consult(tmp_path / "one.pl")
    assert values(engine, "one(X)") == [2]


def test_included_text_belongs_to_the_file(engine: Engine, tmp_path: Path) -> None:
    (tmp_path / "part.pl").write_text("p(2).\n", encoding="utf-8")
    (tmp_path / "main.pl").write_text("p(1).\n:- include(part).\np(3).\n", encoding="utf-8")
    engine.consult(tmp_path / "main.pl")
    assert values(engine, "p(X)") == [1, 2, 3]
    assert engine.warnings == []
    (tmp_path / "part.pl").write_text("p(2).\nq(.\n", encoding="utf-8")
    with pytest.raises(PrologSyntaxError) as raised:
        engine.consult(tmp_path / "main.pl")
    assert str(raised.value).startswith(f"{tmp_path / 'part.pl'}:2:3: ")
    assert values(engine, "p(X)") == [1, 2, 3]


@pytest.mark.parametrize("included", [False, True])
def test_a_file_that_is_no_utf_8_is_a_syntax_error_with_its_place(
    engine: Engine, tmp_path: Path, included: bool
) -> None:
    (tmp_path / "latin.pl").write_bytes("p(1).\np('é').\n".encode("latin-1"))
    (tmp_path / "main.pl").write_text("q(1).\n:- include(latin).\n", encoding="utf-8")
    with pytest.raises(PrologSyntaxError) as raised:
        engine.consult(tmp_path / ("main.pl" if included else "latin.pl"))
    assert (raised.value.file, raised.value.line) == (str(tmp_path / "latin.pl"), 2)
    assert "UTF-8" in str(raised.value)
    assert not engine.defines("q", 1)


def test_a_missing_file_is_an_os_error(engine: Engine, tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        engine.consult(tmp_path / "missing.pl")
    assert not engine.loaded


def test_every_error_of_a_text_is_reported_with_its_place(engine: Engine) -> None:
    text = "a :- .\nb(1).\n  c(.\n:- no_such_goal.\n'd.\n"
    with pytest.raises(ConsultError) as raised:
        engine.consult_text(text, name="bad.pl")
    assert len(raised.value.errors) == 4
    report = str(raised.value)
    for place in ("bad.pl:1:6: syntax error", "bad.pl:3:5: syntax error", "bad.pl:5:1: syntax error"):
        assert place in report
    assert "no_such_goal/0 does not exist" in report
    assert "bad.pl:4" in report
    assert report.endswith("4 errors; nothing was loaded")
    assert (raised.value.file, raised.value.line, raised.value.column) == ("bad.pl", 1, 6)


def test_a_comma_for_a_full_stop(engine: Engine) -> None:
    with pytest.raises(PrologError) as raised:
        engine.consult_text("p(1),\np(2) :- q.\n", name="c.pl")
    assert "no permission to modify static_procedure (',')/2; the first goal here" in str(raised.value)
    assert "should that be a full stop? (c.pl:1)" in str(raised.value)


def test_warnings_say_what_and_where(engine: Engine) -> None:
    engine.consult_text("p(X, Y) :- q(X).\nq(1).\nr(1).\nq(2).\n:- fail.\n", name="w.pl")
    assert [str(warning) for warning in engine.warnings] == [
        "w.pl:1: singleton variable: Y",
        "w.pl:4: the clauses of q/1 are not together",
        "w.pl:5: the directive failed",
    ]
    assert values(engine, "q(X)") == [1, 2]


@pytest.fixture
def base(tmp_path: Path) -> Path:
    path = tmp_path / "base" / "base.pl"
    path.parent.mkdir()
    path.write_text("p(1).\np(2).\nq(X) :- p(X).\nr(1).\n", encoding="utf-8")
    return path


def test_a_file_on_top_of_another_replaces_and_adds(engine: Engine, tmp_path: Path, base: Path) -> None:
    top = tmp_path / "top.pl"
    text = ":- ensure_loaded('base/base').\n:- abolish(p/1).\n:- multifile(r/1).\np(3).\nr(2).\n"
    top.write_text(text, encoding="utf-8")
    engine.consult(top)
    assert (values(engine, "q(X)"), values(engine, "r(X)")) == ([3], [1, 2])
    assert engine.warnings == []
    top.write_text(text.replace("p(3)", "p(4)"), encoding="utf-8")
    engine.consult(top)
    assert (values(engine, "q(X)"), values(engine, "r(X)")) == ([4], [1, 2])
    top.write_text(text + "p(.\n", encoding="utf-8")
    with pytest.raises(PrologSyntaxError):
        engine.consult(top)
    assert (values(engine, "q(X)"), values(engine, "r(X)")) == ([4], [1, 2])


def test_replacing_without_a_word_is_a_warning(engine: Engine, tmp_path: Path, base: Path) -> None:
    (tmp_path / "top.pl").write_text(":- ensure_loaded('base/base').\np(3).\n", encoding="utf-8")
    engine.consult(tmp_path / "top.pl")
    assert values(engine, "q(X)") == [3]
    (warning,) = engine.warnings
    assert f"top.pl:2: p/1 is defined anew; before, in {base}; if that is meant" in str(warning)
    assert str(warning).endswith("say so before: :- abolish(p/1).")


def test_what_is_included_can_be_replaced_too(engine: Engine, tmp_path: Path, base: Path) -> None:
    text = ":- include('base/base').\n:- abolish([p/1, r/1]).\np(3).\n"
    (tmp_path / "top.pl").write_text(text, encoding="utf-8")
    engine.consult(tmp_path / "top.pl")
    assert values(engine, "q(X)") == [3]
    assert not engine.defines("r", 1)
    assert engine.warnings == []


@pytest.mark.parametrize(
    ("directive", "message"),
    [
        ("abolish(pp/1)", "pp/1 does not exist"),
        ("abolish(atom/1)", "no permission to modify static_procedure atom/1"),
        ("abolish(p)", "type error"),
    ],
)
def test_what_cannot_be_replaced(
    engine: Engine, tmp_path: Path, base: Path, directive: str, message: str
) -> None:
    (tmp_path / "top.pl").write_text(f":- ensure_loaded('base/base').\n:- {directive}.\n", encoding="utf-8")
    with pytest.raises(PrologError, match=message) as raised:
        engine.consult(tmp_path / "top.pl")
    assert "top.pl:2" in str(raised.value)


def test_as_a_goal_abolish_leaves_static_predicates_alone(engine: Engine) -> None:
    engine.consult_text("p(1).\n:- dynamic(q/1).\nq(1).\n:- abolish(q/1).\n")
    assert not engine.defines("q", 1)
    with pytest.raises(PrologError, match="permission error"):
        engine.holds("abolish(p/1)")


def test_files_are_looked_for_beside_the_one_that_names_them_then_on_the_search_path(
    engine: Engine, tmp_path: Path, base: Path
) -> None:
    (tmp_path / "top.pl").write_text(":- ensure_loaded(base).\n:- include('more.pl').\n", encoding="utf-8")
    (base.parent / "more.pl").write_text("more.\n", encoding="utf-8")
    with pytest.raises(PrologError, match="base"):
        engine.consult(tmp_path / "top.pl")
    engine.consult(tmp_path / "top.pl", [tmp_path / "nowhere", base.parent])
    assert engine.holds("more, p(2)")
    (tmp_path / "more.pl").write_text("nearer.\n", encoding="utf-8")
    engine.consult(tmp_path / "top.pl", [base.parent])
    assert engine.holds("nearer")
    assert not engine.holds("catch(more, _, fail)")


def test_declarations_silence_the_warnings(engine: Engine) -> None:
    engine.consult_text(":- discontiguous q/1.\np(X, _Y) :- q(X).\nq(1).\nr(1).\nq(2).\n")
    assert engine.warnings == []


def test_a_predicate_of_another_text_is_defined_anew_with_a_warning(engine: Engine) -> None:
    engine.consult_text("p(1).", name="one.pl")
    engine.consult_text("p(2).", name="two.pl")
    assert values(engine, "p(X)") == [2]
    assert "one.pl" in engine.warnings[0].message


def test_initialization_runs_after_the_text_is_loaded() -> None:
    output = io.StringIO()
    engine = Engine(output=output)
    engine.consult_text(":- initialization((p(X), write(X))).\n:- write(first).\np(second).\n")
    assert output.getvalue() == "firstsecond"


def test_libraries_known_and_unknown(engine: Engine) -> None:
    engine.consult_text(":- use_module(library(lists)). :- use_module(library(apply), [maplist/3]).")
    with pytest.raises(ExistenceError, match="clpfd"):
        engine.consult_text(":- use_module(library(clpfd)).")


def test_a_program_may_hide_a_library_predicate_and_no_standard_one(engine: Engine) -> None:
    engine.consult_text("uses(X) :- last([1, 2], X).")
    assert values(engine, "uses(X)") == [2]
    engine.consult_text("last(_, mine).", name="mine.pl")
    assert values(engine, "uses(X)") == ["mine"]
    with pytest.raises(PrologError, match="atom_length/2"):
        engine.consult_text("atom_length(_, 3).")


# ---------------------------------------------------------------------- facts replaced


def test_replaced_facts_keep_their_order_and_duplicates(engine: Engine) -> None:
    engine.consult_text("fast(C) :- speed(C, V), V > 20.0.")
    engine.replace_facts("speed", 2, [("b", 30.0), ("a", 10), ("c", 25.5), ("b", 30.0)])
    assert values(engine, "speed(X, _)") == ["b", "a", "c", "b"]
    assert values(engine, "fast(X)") == ["b", "c", "b"]
    engine.replace_facts("speed", 2, iter([("a", 21.0)]))
    assert values(engine, "fast(X)") == ["a"]
    engine.replace_facts("speed", 2, [])
    assert values(engine, "fast(X)") == []
    assert engine.defines("speed", 2)


def test_replaced_facts_are_found_by_any_argument(engine: Engine) -> None:
    rows = [(f"car{number}", number % 7, float(number)) for number in range(200)]
    engine.replace_facts("car", 3, rows)
    assert values(engine, "car(car150, _, X)") == [150.0]
    assert len(values(engine, "car(X, 3, _)")) == len([row for row in rows if row[1] == 3])
    assert values(engine, "car(X, _, 199.0)") == ["car199"]
    assert not engine.holds("car(car150, _, 150)"), "an int is no float"
    assert not engine.holds('car("car150", _, _)')
    assert values(engine, "car(X, 3, _), car(X, N, _), N > 3") == []
    assert len(values(engine, "X = same, car(A, _, V), car(A, _, V)")) == 200


def test_facts_with_numbers_first_tell_kinds_apart(engine: Engine) -> None:
    engine.replace_facts("n", 2, [(1, "int"), (1.0, "float"), ("1", "atom"), (0.0, "zero")])
    assert values(engine, "n(1, X)") == ["int"]
    assert values(engine, "n(1.0, X)") == ["float"]
    assert values(engine, "n('1', X)") == ["atom"]
    assert values(engine, "n(f(_), X)") == []
    assert values(engine, "n(A, X), A == 0.0") == ["zero"]


def test_facts_without_arguments(engine: Engine) -> None:
    engine.replace_facts("night", 0, [()])
    assert engine.holds("night")
    assert len(list(engine.query("night"))) == 1
    engine.replace_facts("night", 0, [])
    assert not engine.holds("night")


@pytest.mark.parametrize(
    ("value", "error"),
    [
        (True, TypeError),
        (None, TypeError),
        ([1], TypeError),
        (1j, TypeError),
        (b"a", TypeError),
        (Compound("f", (1,)), TypeError),
        (float("nan"), ValueError),
    ],
)
def test_values_that_are_no_facts_are_refused(engine: Engine, value: object, error: type[Exception]) -> None:
    engine.replace_facts("p", 2, [("kept", 1)])
    with pytest.raises(error):
        engine.replace_facts("p", 2, [("a", 1), ("b", value)])  # type: ignore[list-item]  # what is tested
    assert values(engine, "p(X, _)") == ["kept"]


@pytest.mark.parametrize("row", [(), ("a",), ("a", 1, 2)])
def test_rows_of_another_length_are_refused(engine: Engine, row: tuple[str, ...]) -> None:
    engine.replace_facts("p", 2, [("kept", 1)])
    with pytest.raises(ValueError, match="p/2"):
        engine.replace_facts("p", 2, [("a", 1), row])
    assert values(engine, "p(X, _)") == ["kept"]


def test_an_open_query_sees_the_facts_that_it_began_with(engine: Engine) -> None:
    engine.consult_text("through(X) :- p(X).")
    for goal in ("p(X)", "through(X)", "p(Y), p(X)"):
        engine.replace_facts("p", 1, [(1,), (2,), (3,)])
        query = engine.query(goal)
        assert next(query)["X"] == 1
        engine.replace_facts("p", 1, [(7,), (8,)])
        assert [solution["X"] for solution in query][:2] == [2, 3]
        assert values(engine, goal)[:2] == [7, 8]


def test_replaced_facts_can_be_asserted_to_and_retracted(engine: Engine) -> None:
    engine.replace_facts("p", 1, [(1,), (2,), (3,)])
    query = engine.query("p(X)")
    next(query)
    assert engine.holds("retract(p(2)), assertz(p(4)), asserta(p(0))")
    assert [solution["X"] for solution in query] == [2, 3], "the logical update view"
    assert values(engine, "p(X)") == [0, 1, 3, 4]
    engine.replace_facts("p", 1, [(9,)])
    assert values(engine, "p(X)") == [9]
    assert values(engine, "clause(p(X), true)") == [9]


def test_rules_become_facts_and_a_failed_load_keeps_them(engine: Engine) -> None:
    engine.consult_text("p(X) :- q(X). q(1).")
    engine.replace_facts("p", 1, [(5,)])
    with pytest.raises(PrologSyntaxError):
        engine.consult_text("p(6). r(")
    assert values(engine, "p(X)") == [5]


@given(st.lists(st.tuples(st.sampled_from(["a", "b", 1, 1.0, 2]), st.integers(0, 3)), max_size=8))
def test_facts_answer_as_clauses_do(rows: list[tuple[str | float, int]]) -> None:
    bulk, clauses = Engine(), Engine()
    bulk.replace_facts("p", 2, rows)
    clauses.consult_text(":- dynamic(p/2). " + "".join(f"p({first}, {second}). " for first, second in rows))
    for goal in ("p(X, Y)", "p(a, Y)", "p(1, Y)", "p(1.0, Y)", "p(X, 2)", "p(X, Y), p(X, Z)", "p(X, Y), !"):
        assert list(bulk.query(goal)) == list(clauses.query(goal))


# ---------------------------------------------------------------------- queries


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


# ---------------------------------------------------------------------- values


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


# ---------------------------------------------------------------------- errors


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
