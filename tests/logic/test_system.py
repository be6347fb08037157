"""Tests of must_be/2, clocks, numbervars/3 and messages."""

from __future__ import annotations

import io

import pytest

from drlsl.logic import Engine, PrologError


def _engine() -> Engine:
    return Engine(output=io.StringIO())


@pytest.mark.parametrize(
    "goal",
    [
        "must_be(integer, 1)",
        "must_be(nonneg, 0)",
        "must_be(positive_integer, 1)",
        "must_be(boolean, true)",
        "must_be(list, [a|[b]])",
        "must_be(list(integer), [1, 2])",
        "must_be(oneof([a, b]), b)",
        "must_be(between(0, 1.5), 1)",
        "must_be(any, _)",
        "must_be(callable, f(_))",
        "must_be(list_or_partial, [a|_])",
    ],
)
def test_terms_of_the_type_pass(goal: str) -> None:
    assert _engine().holds(goal)


@pytest.mark.parametrize(
    ("goal", "message"),
    [
        ("must_be(integer, a)", "expected integer, found a"),
        ("must_be(integer, _)", "instantiation"),
        ("must_be(_, a)", "instantiation"),
        ("must_be(nonneg, -1)", "expected nonneg, found -1"),
        ("must_be(positive_integer, 0)", "expected positive_integer, found 0"),
        ("must_be(boolean, 1)", "expected boolean, found 1"),
        ("must_be(list, [a|b])", "expected list, found [a|b]"),
        ("must_be(list(integer), [1, x])", "expected integer, found x"),
        ("must_be(oneof([a, b]), c)", "expected oneof([a,b]), found c"),
        ("must_be(between(0, 2), 3)", "expected between(0,2), found 3"),
        ("must_be(between(0, 2), a)", "expected integer, found a"),
        ("must_be(ground, f(_))", "expected ground"),
        ("must_be(wheel, 1)", "type wheel does not exist"),
        ("must_be(f(x), 1)", "type f(x) does not exist"),
        ("statistics(colour, X)", "statistics_key"),
    ],
)
def test_errors_name_what_is_wrong(goal: str, message: str) -> None:
    with pytest.raises(PrologError) as raised:
        _engine().holds(goal)
    assert message in raised.value.message()


def test_numbervars() -> None:
    engine = _engine()
    assert engine.holds("T = f(X, g(Y, X)), numbervars(T, 0, E), E == 2, print(T)")
    assert isinstance(engine.output, io.StringIO)
    assert engine.output.getvalue() == "f(A,g(B,A))"


def test_clocks() -> None:
    assert _engine().holds("get_time(T), T > 1.0e9, statistics(runtime, [A, 0]), integer(A)")
    assert _engine().holds("statistics(cputime, T), float(T), statistics(walltime, [_, _])")


def test_messages_go_to_standard_error(capsys: pytest.CaptureFixture[str]) -> None:
    engine = _engine()
    assert engine.holds('print_message(error, format("gap ~w m", [4.2])), print_message(silent, x)')
    assert engine.holds("print_message(warning, error(type_error(integer, a), _)), print_message(help, f(X))")
    written = capsys.readouterr().err.splitlines()
    assert written[:2] == ["ERROR: gap 4.2 m", "Warning: type error: expected integer, found a"]
    assert isinstance(engine.output, io.StringIO)
    assert engine.output.getvalue() == ""


def test_text_concat_keeps_the_kind() -> None:
    engine = Engine(flags={"double_quotes": "string"})
    assert engine.holds("text_concat(abc, def, X), X == abcdef, text_concat(abc, Y, abcdef), Y == def")
    assert engine.holds('text_concat("abc", def, X), string(X)')
