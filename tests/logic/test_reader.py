"""Tests of the reader: terms, spans, errors that say where and what, recovery, depth."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drlsl.logic import PrologSyntaxError
from drlsl.logic.syntax import Flags, ReadTerm, is_complete, parse_number, read_term, read_terms
from drlsl.logic.terms import NIL, Atom, Operators, Struct, Term, Var, format_term, make_list

_CORPUS = Path(__file__).parent / "corpus"


def _term(text: str, **flags: str) -> Term:
    return _read(text, **flags).term


def _read(text: str, **values: str) -> ReadTerm:
    flags = Flags()
    for name, value in values.items():
        flags.set(Atom(name), Atom(value))
    return read_term(text, Operators(), flags)


def _canonical(term: Term) -> str:
    return format_term(term, Operators(), quoted=True, ignore_ops=True)


def _error(text: str) -> PrologSyntaxError:
    with pytest.raises(PrologSyntaxError) as raised:
        _term(text)
    return raised.value


# Text that is right.


@pytest.mark.parametrize("path", sorted((_CORPUS / "valid").glob("*.pl")), ids=lambda path: path.stem)
def test_valid_corpus(path: Path) -> None:
    """Each clause is followed by ``%= its canonical form`` in a comment line."""
    text = path.read_text(encoding="utf-8")
    expected = [line[3:] for line in text.splitlines() if line.startswith("%= ")]
    found = []
    for read in read_terms(text, Operators(), Flags(), path.name):
        names = {id(variable): name for name, variable in read.variables.items()}
        found.append(format_term(read.term, Operators(), quoted=True, ignore_ops=True, variable_names=names))
    assert found == expected


@pytest.mark.parametrize("path", sorted((_CORPUS / "invalid").glob("*.pl")), ids=lambda path: path.stem)
def test_invalid_corpus(path: Path) -> None:
    """The first line is ``%= LINE:COLUMN: message``; the reader must also find the clause ``end_of_case``."""
    text = path.read_text(encoding="utf-8")
    reader = read_terms(text, Operators(), Flags(), path.name)
    errors, terms = [], []
    while True:
        try:
            terms.append(next(reader).term)
        except StopIteration:
            break
        except PrologSyntaxError as error:
            errors.append(str(error).splitlines()[0])
    expected = [line[3:] for line in text.splitlines() if line.startswith("%= ")]
    assert errors == [f"{path.name}:{line}" for line in expected]
    assert Atom("end_of_case") in terms


def test_variables_singletons_and_anonymous() -> None:
    read = _read("f(X, _, Y, _Z, X, _)")
    assert list(read.variables) == ["X", "Y", "_Z"]
    assert read.singletons == ["Y"]
    assert isinstance(read.term, Struct)
    assert read.term.args[1] is not read.term.args[5]
    assert read.term.args[0] is read.term.args[4] is read.variables["X"]


def test_spans_and_places_of_goals() -> None:
    text = "% first\na.\n\nb :-\n    c,\n    (   d\n    ->  \\+ e\n    ;   f\n    ).\n"
    first, second = read_terms(text, Operators(), Flags(), "rules.pl")
    assert (first.span.line, first.span.column, str(first.span)) == (2, 1, "rules.pl:2")
    assert (second.span.line, second.span.end_line, second.span.end_column) == (4, 9, 6)
    clause: Any = second.term
    body = clause.args[1]
    places = [second.place(clause, 1), second.place(body, 1)]
    inner = body.args[1]
    condition = inner.args[0]
    places += [second.place(inner, 1), second.place(condition, 0), second.place(condition.args[1], 0)]
    assert [(place.line, place.column) for place in places if place] == [
        (5, 5),
        (6, 5),
        (8, 9),
        (6, 9),
        (7, 12),
    ]
    assert second.place(Struct("f", (NIL,)), 0) is None


def test_meta_arguments_have_places() -> None:
    read = _read("p :- findall(X, q(X), L)")
    assert isinstance(read.term, Struct)
    goal = read.term.args[1]
    assert isinstance(goal, Struct)
    place = read.place(goal, 1)
    assert place is not None
    assert place.column == 17


def test_operators_and_flags_may_change_between_terms() -> None:
    operators, flags = Operators(), Flags()
    reader = read_terms('a. b ==> c. "x". X = 1_000.', operators, flags)
    assert next(reader).term is Atom("a")
    operators.add(700, "xfx", "==>")
    assert _canonical(next(reader).term) == "==>(b,c)"
    flags.set(Atom("double_quotes"), Atom("atom"))
    assert next(reader).term is Atom("x")
    flags.set(Atom("iso"), Atom("false"))
    assert _canonical(next(reader).term).endswith(",1000)")


def test_double_quotes() -> None:
    assert (
        _term('"ab"') == _term('"ab"', double_quotes="string")
        or _canonical(_term('"ab"')) == "'.'(97,'.'(98,[]))"
    )
    assert _term('"ab"', double_quotes="string") == "ab"
    assert _canonical(_term('"ab"', double_quotes="chars")) == "'.'(a,'.'(b,[]))"
    assert _term('"ab"', double_quotes="atom") is Atom("ab")


def test_extensions_of_swi_need_the_flag() -> None:
    for text in ("1_000_000", "1e10", "16'FF", "X = *", "`abc`", "'\\e'", "X = \\+ a"):
        with pytest.raises(PrologSyntaxError):
            _term(text)
        _term(text, iso="false")


def test_a_goal_may_end_with_a_full_stop_or_not() -> None:
    assert _term("a") is _term("a.") is _term("  a . % comment\n")
    assert "after the end" in str(_error("a. b."))
    assert "expected a term" in str(_error("  % nothing"))


def test_a_script_may_begin_with_a_hash_bang() -> None:
    (read,) = read_terms("#!/usr/bin/env prolog\nmain.\n", Operators(), Flags())
    assert read.term is Atom("main")
    assert read.span.line == 2


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("12", 12),
        (" 12", 12),
        ("- 1", -1),
        ("-1.5", -1.5),
        ("0xff", 255),
        ("0'a", 97),
        ("\n3", 3),
        ("/**/3", 3),
    ],
)
def test_numbers(text: str, value: float) -> None:
    assert parse_number(text, Flags()) == value


@pytest.mark.parametrize(
    "text", ["", "3 ", "3.", "a", "1 2", "+1", "-/**/1", "1e1", "1.0e", "0x", "--1", "1.0e999"]
)
def test_text_that_is_no_number(text: str) -> None:
    with pytest.raises(PrologSyntaxError):
        parse_number(text, Flags())


def test_integers_longer_than_python_converts() -> None:
    assert _term("9" * 20_001) == 10**20_001 - 1


# Errors.


def test_an_error_prints_its_place_and_line() -> None:
    assert str(_error("foo(a b)")) == (
        "user:1:7: syntax error: unexpected 'b': expected an operator, ',' or ')'\nfoo(a b)\n      ^"
    )


def test_an_error_carries_the_iso_term() -> None:
    error = _error("a b")
    assert (error.file, error.line, error.column, error.source) == ("user", 1, 3, "a b")
    assert isinstance(error.formal, Struct)
    assert error.formal.name == "syntax_error"
    assert error.message().startswith("syntax error: unexpected 'b'")


def test_an_open_bracket_is_named() -> None:
    assert "'[' is open since line 2, column 1" in str(_error("\n[1,\n2"))
    assert "'(' is open since line 1, column 3" in str(_error("X (")) or "unexpected '('" in str(
        _error("X (")
    )


def test_the_mark_spans_the_token() -> None:
    assert str(_error("aaa bbb")).splitlines()[2] == "    ~~^"


def test_an_operator_as_operand_is_explained() -> None:
    assert "expected (*)" in str(_error("X = *"))


# Depth and size.


@pytest.mark.parametrize(
    "text",
    [
        "[" + ",".join(["a"] * 100_000) + "]",
        ",".join(["p(x)"] * 50_000),
        "f(" * 100_000 + "x" + ")" * 100_000,
        "(" * 100_000 + "x" + ")" * 100_000,
        "- " * 100_000 + "x",
        "+".join(["a"] * 100_000),
        "[" * 100_000 + "]" * 100_000,
        "{" * 100_000 + "x" + "}" * 100_000,
        "[a|" * 100_000 + "x" + "]" * 100_000,
    ],
    ids=["list", "conjunction", "nested", "brackets", "prefix", "left", "lists", "curly", "tails"],
)
def test_no_term_is_too_deep(text: str) -> None:
    """The text, without its layout and its superfluous brackets, is what comes back."""
    term = _term(text)
    again = _term(format_term(term, Operators(), quoted=True))
    assert format_term(again, Operators()) == format_term(term, Operators())


def test_an_error_deep_inside_is_found() -> None:
    assert _error("f(" * 50_000 + "]").column == 100_001


@given(st.text(alphabet="ab XY_01'\"`.,|()[]{}-+*\\:;!%/\n\t=0xe", max_size=40))
def test_any_text_is_a_term_or_a_syntax_error(text: str) -> None:
    reader = read_terms(text, Operators(), Flags())
    lines: list[int] = []
    for _ in range(len(text) + 2):
        try:
            next(reader)
        except StopIteration:
            assert all(1 <= line <= text.count("\n") + 1 for line in lines)
            return
        except PrologSyntaxError as error:
            lines.append(error.line)
    pytest.fail("the reader does not come to an end")


@given(st.lists(st.sampled_from(["a.", "b(X) :- c.", "a b.", "'x.", "f(.", "]. ", "/* c */ d."]), max_size=8))
def test_good_clauses_are_found_between_bad_ones(clauses: list[str]) -> None:
    text = "\n".join(clauses)
    reader = read_terms(text, Operators(), Flags())
    found = []
    while True:
        try:
            found.append(_canonical(next(reader).term).split("(")[0])
        except StopIteration:
            break
        except PrologSyntaxError:
            continue
    assert found.count("a") == clauses.count("a.")
    assert found.count("d") == clauses.count("/* c */ d.")


@pytest.mark.parametrize(
    ("text", "complete"),
    [
        ("a.", True),
        ("a", False),
        ("a :-\n b.", True),
        ("X = 'a. ", True),
        ("/* a. ", False),
        ("", False),
        ("f(", False),
    ],
)
def test_whether_a_typed_text_is_complete(text: str, complete: bool) -> None:
    assert is_complete(text, Flags()) is complete


def test_make_list_and_read_agree() -> None:
    assert _canonical(_term("[1, 2|T]")).startswith("'.'(1,'.'(2,_G")
    assert _canonical(make_list([1, Atom("a")])) == _canonical(_term("[1,a]"))
    assert isinstance(_term("X"), Var)
