"""Tests of the writer: what it writes reads back as the same term."""

from __future__ import annotations

from random import Random

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from drlsl.logic.core import variant
from drlsl.logic.syntax import Flags, read_term
from drlsl.logic.terms import (
    NIL,
    Atom,
    Operators,
    Struct,
    Term,
    Var,
    decimal_digits,
    format_atom,
    format_float,
    format_term,
    make_list,
)
from tests.logic.strategies import characters, operator_tables, terms

_VARIABLES = [Var("X"), Var("Y")]


def _read(text: str, operators: Operators) -> Term:
    flags = Flags()
    flags.set(Atom("double_quotes"), Atom("string"))
    return read_term(text, operators, flags).term


@settings(max_examples=120, deadline=None)
@given(terms(_VARIABLES), operator_tables())
@example(Atom("a\u00b7"), Operators())  # Unicode has it in identifiers, though it is no letter
def test_quoted_text_reads_back_as_a_variant(term: Term, operators: Operators) -> None:
    text = format_term(term, operators, quoted=True)
    assert variant(_read(text, operators), term), text


@settings(max_examples=60, deadline=None)
@given(terms(_VARIABLES), operator_tables())
def test_canonical_text_reads_back_with_any_operators(term: Term, operators: Operators) -> None:
    text = format_term(term, operators, quoted=True, ignore_ops=True)
    assert variant(_read(text, operators), term), text


@settings(max_examples=60, deadline=None)
@given(terms(_VARIABLES), operator_tables())
def test_spaced_text_reads_back_as_a_variant(term: Term, operators: Operators) -> None:
    text = format_term(term, operators, quoted=True, spacing=True)
    assert variant(_read(text, operators), term), text


def _crowded_operators() -> Operators:
    """Operators of every class at the priorities where terms become ambiguous."""
    operators = Operators()
    for priority, specifier, name in (
        (9, "fy", "fy"), (9, "fx", "fx"), (9, "yf", "yf"), (9, "xf", "xf"), (9, "yfx", "yfx"),
        (9, "xfy", "xfy"), (9, "fy", "p"), (9, "yfx", "p"), (200, "xfx", "--"), (200, "fy", "--"),
        (700, "fx", "#"), (999, "yf", "!!"), (1000, "fx", "q"), (1200, "xf", "<-"),
    ):  # fmt: skip
        operators.add(priority, specifier, name)
    return operators


_CROWDED = _crowded_operators()
_UNARY = [*_CROWDED.prefix, *_CROWDED.postfix, "{}", "foo"]
_BINARY = [*_CROWDED.infix, "foo", "."]
_LEAVES: list[Term] = [1, -1, 1.5, Atom("a"), Atom("-"), Atom("fy"), Atom(":-"), NIL, _VARIABLES[0]]


def _random_term(random: Random, depth: int) -> Term:
    shape = random.random()
    if depth == 0 or shape < 0.1:
        return random.choice(_LEAVES)
    if shape < 0.5:
        return Struct(random.choice(_UNARY), (_random_term(random, depth - 1),))
    return Struct(random.choice(_BINARY), (_random_term(random, depth - 1), _random_term(random, depth - 1)))


@pytest.mark.parametrize("seed", range(12))
def test_operators_of_every_class_read_back(seed: int) -> None:
    random = Random(seed)
    for depth in (1, 2, 2, 3, 3, 4) * 60:
        term = _random_term(random, depth)
        text = format_term(term, _CROWDED, quoted=True)
        assert variant(_read(text, _CROWDED), term), text


@given(st.text(characters))
def test_strings_read_back(text: str) -> None:
    assert _read(format_term(text, Operators(), quoted=True), Operators()) == text


@given(st.floats(allow_nan=False))
def test_floats_hold_a_dot_and_keep_their_value(value: float) -> None:
    text = format_float(value)
    assert "." in text
    assert repr(_read(text, Operators())) == repr(value)


@given(st.integers() | st.integers(3990, 4010).map(lambda size: 10**size - 1) | st.just(-(7**20000)))
def test_integers_of_any_size_read_back(value: int) -> None:
    assert _read(decimal_digits(value), Operators()) == value


def test_long_integers_have_their_digits() -> None:
    assert decimal_digits(10**9000) == "1" + "0" * 9000
    assert decimal_digits(-(10**9000) + 1) == "-" + "9" * 9000


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a", "a"),
        ("[]", "[]"),
        ("{}", "{}"),
        (";", ";"),
        ("!", "!"),
        (",", "','"),
        ("|", "'|'"),
        ("", "''"),
        ("+", "+"),
    ],
)
def test_atoms(name: str, text: str) -> None:
    assert format_atom(name) == text


def test_unquoted_text_is_raw() -> None:
    assert format_term(Struct("f", (Atom("a b"), "c d")), Operators()) == "f(a b,c d)"


def test_depth_limit_bounds_terms_and_lists() -> None:
    deep: Term = Atom("a")
    for _ in range(9):
        deep = Struct("f", (deep,))
    assert format_term(deep, Operators(), max_depth=3) == "f(f(f(...)))"
    assert format_term(make_list(range(9)), Operators(), max_depth=3) == "[0,1,2|...]"


def test_variable_names_are_used_and_distinct_otherwise() -> None:
    first, second = Var("X"), Var("X")
    named = format_term(Struct("f", (first, second)), Operators(), variable_names={id(first): "Speed"})
    assert named.startswith("f(Speed,_G")
    text = format_term(Struct("f", (first, second, first)), Operators())
    left, middle, right = text[2:-1].split(",")
    assert left == right != middle


def test_numbervars() -> None:
    term = make_list([Struct("$VAR", (number,)) for number in (0, 25, 26, 53, -1)])
    assert format_term(term, Operators(), quoted=True, numbervars=True) == "[A,Z,A1,B2,'$VAR'(-1)]"


def test_deep_terms_need_no_recursion() -> None:
    term: Term = Atom("x")
    for _ in range(100_000):
        term = Struct("-", (Struct("f", (term,)),))
    assert format_term(term, Operators()).count("-f(") == 100_000
    left: Term = Atom("x")
    for _ in range(100_000):
        left = Struct("-", (left, 1))
    assert len(format_term(left, Operators())) == 200_001
    assert format_term(make_list([NIL] * 100_000), Operators()).count("[]") == 100_000
