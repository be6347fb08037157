"""Consulting texts and files: what a failed one leaves, what one may replace, warnings and errors."""

from __future__ import annotations

import io
from pathlib import Path

import pytest

from drlsl.logic import (
    ConsultError,
    Engine,
    ExistenceError,
    Halt,
    PrologError,
    PrologSyntaxError,
)
from tests.logic.engines import values

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
    assert f"top.pl:2: p/1 is defined anew; before, in {base}; if that is intended" in str(warning)
    assert str(warning).endswith("declare it before: :- abolish(p/1).")


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
