"""Tests of the builtins on atoms, strings, output, input and the listing of clauses."""

from __future__ import annotations

import io
from itertools import combinations_with_replacement
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drlsl.logic import Engine, PrologError, PrologSyntaxError
from drlsl.logic.builtins.termio import Input
from tests.logic.strategies import characters

_TEXTS = st.text(characters, max_size=6)


def _engine(**flags: str) -> Engine:
    return Engine(flags=flags, output=io.StringIO())


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace("'", "\\'")
    return "'" + "".join(f"\\x{ord(char):x}\\" if not char.isprintable() else char for char in escaped) + "'"


def _written(goal: str, **flags: str) -> str:
    engine = _engine(**flags)
    assert engine.holds(goal), goal
    assert isinstance(engine.output, io.StringIO)
    return engine.output.getvalue()


def _first(goal: str, **flags: str) -> object:
    """The value of X in the first solution."""
    found = _engine(**flags).once(goal)
    return None if found is None else found["X"]


def _formal(goal: str, **flags: str) -> str:
    engine = _engine(**flags)
    with pytest.raises(PrologError) as raised:
        engine.holds(goal)
    return str(raised.value.message())


# Atoms against Python's own strings.


@given(_TEXTS)
def test_sub_atom_finds_every_part(text: str) -> None:
    engine = _engine()
    found = [(s["B"], s["L"], s["A"], s["S"]) for s in engine.query(f"sub_atom({_quoted(text)}, B, L, A, S)")]
    cuts = combinations_with_replacement(range(len(text) + 1), 2)
    assert found == [(start, end - start, len(text) - end, text[start:end]) for start, end in cuts]


@given(st.text("ab", max_size=6), st.text("ab", min_size=1, max_size=3))
def test_sub_atom_finds_every_place_of_a_part(text: str, part: str) -> None:
    found = [s["B"] for s in _engine().query(f"sub_atom({_quoted(text)}, B, _, _, {_quoted(part)})")]
    assert found == [place for place in range(len(text)) if text.startswith(part, place)]


@given(_TEXTS, _TEXTS)
def test_atom_concat_joins_and_splits(left: str, right: str) -> None:
    engine = _engine()
    joined = engine.once(f"atom_concat({_quoted(left)}, {_quoted(right)}, W)")
    assert joined is not None
    assert joined["W"] == left + right
    split = {(s["A"], s["B"]) for s in engine.query(f"atom_concat(A, B, {_quoted(left + right)})")}
    assert (left, right) in split
    assert len(split) == len(left + right) + 1


@given(_TEXTS)
def test_conversions_of_text_are_inverse(text: str) -> None:
    atom = _quoted(text)
    for name in ("atom_codes", "atom_chars", "atom_string"):
        assert _engine().holds(f"{name}({atom}, L), {name}(A, L), A == ({atom})"), name


@given(st.integers() | st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_and_their_text_are_inverse(value: float) -> None:
    engine = _engine()
    engine.replace_facts("value", 1, [(value,)])
    assert engine.holds("value(V), number_codes(V, L), number_codes(W, L), V == W")
    assert engine.holds("value(V), atom_number(A, V), atom_number(A, W), V == W")


@given(st.lists(st.text("abc", max_size=3), min_size=1, max_size=4), st.sampled_from(["-", ", ", "ab"]))
def test_atomic_list_concat_is_pythons_join_and_split(parts: list[str], between: str) -> None:
    listed = "[" + ",".join(map(_quoted, parts)) + "]"
    whole = between.join(parts)
    assert _first(f"atomic_list_concat({listed}, {_quoted(between)}, X)") == whole
    assert _first(f"atomic_list_concat(X, {_quoted(between)}, {_quoted(whole)})") == whole.split(between)


@pytest.mark.parametrize(
    ("goal", "value"),
    [
        ('split_string("a.b.c", ".", "", X)', ["a", "b", "c"]),
        ('split_string("/home//jan///nice", "/", "", X)', ["", "home", "", "jan", "", "", "nice"]),
        ('split_string("//a//b//", "/", "/", X)', ["a", "b"]),
        ('split_string("  a word ", "", " ", X)', ["a word"]),
        ('split_string("SWI-Prolog, 7.0", ",", " ", X)', ["SWI-Prolog", "7.0"]),
        ('split_string("", "", "", X)', [""]),
        ('split_string("  ", " ", " ", X)', [""]),
        ('string_concat(abc, X, "abcdef")', "def"),
        ('sub_string("hello world", 6, 5, _, X)', "world"),
        ('string_code(1, "abc", X)', 97),
        ("string_length(42, X)", 2),
        ("upcase_atom('hello world', X)", "HELLO WORLD"),
        ('string_lower("ABC", X)', "abc"),
        ("atom_number('0x1A', X)", 26),
        ("atom_number('+5', X)", 5),
        ("atom_number('1e5', X)", 100000.0),
        ('term_to_atom(f(a, "b", \'C\'), X)', "f(a,\"b\",'C')"),
        ("term_to_atom(g(X, 1), 'g(7, 1)')", 7),
        ('term_string(X, "1 + 2"), X = _', None),
        ("atomic_list_concat([a, 1, \"s\", 2.5], X)", "a1s2.5"),
        ("char_type(X, digit(5))", "5"),
        ("name(abc, X)", [97, 98, 99]),
        ("name(-42, X)", [45, 52, 50]),
        ("name(1.5, X)", [49, 46, 53]),
        ('name("ab", X)', [97, 98]),
        ("name('', X)", []),
        ("name(ab, [0'a|X])", [98]),
        ("name(X, [0'4, 0'2])", 42),
        ("name(X, [0'-, 0'3])", -3),
        ("name(X, [0'+, 0'3])", 3),
        ("name(X, [0'1, 0'e, 0'1, 0'0])", 1e10),
        ("name(X, [0'0, 0'x, 0'1, 0'F])", 31),
        ("name(X, [0'3, 0'a])", "3a"),
        ("name(X, [0' , 0'3])", " 3"),
        ("name(X, [0'3, 0' ])", "3 "),
        ("name(X, [0'-, 0' , 0'3])", "- 3"),
        ("name(X, [])", ""),
        ("name(X, [a, b])", "ab"),
        ('name(X, "12")', 12),
        ("name(42, [0'4, 0'2]), name('42', [0'4, 0'2]), X = yes", "yes"),
        ('name(abc, "abc"), name(abc, [a, b, c]), \\+ name(abc, [a]), \\+ name(7, [a]), X = yes', "yes"),
        ("upcase_atom(é, X)", "É"),
    ],
)  # fmt: skip
def test_strings_as_swi_prolog_has_them(goal: str, value: object) -> None:
    found = _first(goal, double_quotes="string", iso="false")
    if value is not None:
        assert found == value


@pytest.mark.parametrize(
    "goal", ["atom_number(a, X)", "atom_number('5 ', X)", "atom_number('- 5', X)", 'number_string(X, " 42")']
)
def test_text_that_is_no_number_fails(goal: str) -> None:
    assert not _engine(double_quotes="string", iso="false").holds(goal)


@pytest.mark.parametrize(
    ("goal", "message"),
    [
        ("atomic_list_concat([a, _], X)", "instantiation"),
        ("atomic_list_concat([a, f(x)], X)", "found f(x)"),
        ("atomic_list_concat(X, '', abc)", "non_empty_atom"),
        ("atomic_list_concat(X, '-', Y)", "instantiation"),
        ("atom_number(_, _)", "instantiation"),
        ("name(_, _)", "instantiation"),
        ("name(_, [0'a|_])", "instantiation"),
        ("name(_, [_])", "instantiation"),
        ("name(f(x), _)", "found f(x)"),
        ("name(_, [f(x)])", "found f(x)"),
        ("name(_, [-1])", "found -1"),
        ("name(_, foo)", "found foo"),
        ("name(abc, [0'a|foo])", "list"),
        ("string_length(f(x), X)", "found f(x)"),
        ("split_string(_, a, b, X)", "instantiation"),
        ("char_type(a, foo)", "char_type"),
        ("read_term_from_atom('a b', X, [])", "unexpected 'b'"),
    ],
)
def test_errors_of_strings(goal: str, message: str) -> None:
    assert message in _formal(goal)


# format/2: what SWI-Prolog prints.


@pytest.mark.parametrize(
    ("template", "arguments", "text"),
    [
        ("~w ~q ~p ~a", "[f('A b'), f('A b'), 'x y', 'x y']", "f(A b) f('A b') 'x y' x y"),
        ("~d ~D ~2d ~2D", "[1234567, 1234567, 1234567, 1234567]", "1234567 1,234,567 12345.67 12,345.67"),
        ("~0d ~3d ~1d ~2d", "[5, 5, -5, -12345]", "5 0.005 -0.5 -123.45"),
        ("~e ~3e ~f", "[1.5, 1.5, 2.0]", "1.500000e+00 1.500e+00 2.000000"),
        ("~2f ~0f ~g", "[2.345, 2.5, 3.14]", "2.35 2 3.14"),
        ("~4f ~2f", "[2, 100000000000000000000]", "2.0000 100000000000000000000.00"),
        ("~s and ~s", '["abc", [0\'d, 0\'e]]', "abc and de"),
        ("~c~3c", "[65, 66]", "ABBB"),
        ("~8|abc~20|def", "[]", "        abc         def"),
        ("~`-t~30|", "[]", "-" * 30),
        ("abc~t~10|def", "[]", "abc       def"),
        ("~tabc~10|def", "[]", "       abcdef"),
        ("~tabc~t~11|def", "[]", "    abc    def"),
        ("~w~t~10+~w~t~10+~w", "[a, b, c]", "a         b         c"),
        ("~8r ~16r ~8R ~16R", "[100, 255, 100, 255]", "144 ff 144 FF"),
        ("~i~w", "[a, b]", "b"),
        ("~*c", "[3, 0'x]", "xxx"),
        ("~~", "[]", "~"),
        ("~w", "a", "a"),
        ("~t~w~10||~w", "[right, next]", "     right|next"),
        ("~t~d~6|~t~d~12|", "[123, 4567]", "   123  4567"),
        ("a~tb~tc~20|", "[]", "a        b         c"),
        ("abcdef~3|x", "[]", "abcdefx"),
        ("~ncol~t~10|x", "[]", "\ncol       x"),
        ("~d ~D", "[12345678901234567890123, -1234567]", "12345678901234567890123 -1,234,567"),
        ("~a~n~*c~n", "[title, 5, 0'=]", "title\n=====\n"),
    ],
)  # fmt: skip
def test_format(template: str, arguments: str, text: str) -> None:
    assert _written(f'format("{template}", {arguments})') == text


@pytest.mark.parametrize(
    ("goal", "message"),
    [
        ('format("~w", [])', "not enough arguments"),
        ('format("~w", [a, b])', "too many arguments"),
        ('format("~z", [a])', "format_character"),
        ('format("~a", [f(x)])', "format_argument_type(a,f(x))"),
        ('format("~c", [a])', "format_argument_type(c,a)"),
        ('format("~d", [1.0])', "format_argument_type(d,1.0)"),
        ('format("~r", [10])', "radix"),
        ("format(_, [])", "instantiation"),
        ('format(nowhere, "a", [])', "nowhere"),
    ],
)
def test_errors_of_format(goal: str, message: str) -> None:
    assert message in _formal(goal, iso="false")


def test_columns_count_from_the_start_of_the_line() -> None:
    assert _written('write(abc), format("~t~w~10|~n", [x])') == "abc      x\n"


def test_format_into_a_term() -> None:
    assert _first('format(atom(X), "~w-~w", [a, 1])') == "a-1"
    assert _first('format(codes(X), "ab", [])') == [97, 98]


# Output, input, listing.


def test_output_can_be_caught_and_is_given_back() -> None:
    engine = _engine()
    found = engine.once("with_output_to(atom(X), (write(a), write(b))), write(c)")
    assert found is not None
    assert found["X"] == "ab"
    assert not engine.holds("with_output_to(atom(_), (write(lost), fail))")
    assert engine.holds("catch(with_output_to(atom(_), (write(lost), throw(ball))), ball, write(d))")
    assert engine.holds("with_output_to(atom(X), with_output_to(atom(Y), write(e))), X == '', Y == e")
    assert isinstance(engine.output, io.StringIO)
    assert engine.output.getvalue() == "cd"


def test_with_output_to_is_deterministic() -> None:
    found = list(_engine().query("with_output_to(atom(A), (member(X, [1, 2]), write(X)))"))
    assert [solution["A"] for solution in found] == ["1"]


def test_terms_and_characters_are_read_from_the_input() -> None:
    engine = _engine()
    engine.state["input"] = Input(io.StringIO("foo(X, Y, X).\n% comment\nbar. rest\n'a b'."))
    found: Any = engine.once("read_term(T, [variable_names(N), singletons(S), variables(V)])")
    assert found is not None
    assert [str(pair) for pair in found["S"]] == ["=(Y, Y)"] or len(found["S"]) == 1
    assert len(found["V"]) == len(found["N"]) == 2
    assert engine.holds("read(bar)")
    assert engine.holds("peek_char(' '), get_char(' '), get_char(r), get_code(101)")
    with pytest.raises(PrologSyntaxError):
        engine.holds("read(_)")
    assert engine.holds("read(X), X == end_of_file, get_char(Y), Y == end_of_file, peek_code(-1)")


def test_a_term_may_go_over_lines_of_the_input() -> None:
    engine = _engine()
    engine.state["input"] = Input(io.StringIO("f(a,\n/* . \n */ b)\n.\nnext."))
    assert engine.holds("read(f(a, b)), read(next), read(end_of_file)")


def test_a_listing_reads_back() -> None:
    program = """
    safe(V) :-
        gap(V, G), ( G > 10 -> true ; G > 5, \\+ ( fast(V), near(V) ) -> slow ; fail ), X = [1|T], p(X, T).
    safe(_).
    'Odd name'("s", 'A b', 1.5) :- a, b.
    """
    engine = _engine(double_quotes="atom")
    engine.consult_text(program)
    assert engine.holds("listing(safe/1), listing('Odd name')")
    assert isinstance(engine.output, io.StringIO)
    text = engine.output.getvalue()
    assert "    (   A>10\n" not in text
    assert "    (   B>10\n    ->  true\n    ;   B>5,\n        \\+ ( fast(A),\n" in text
    again = _engine(double_quotes="atom")
    again.consult_text(text)
    again.holds("listing(safe/1), listing('Odd name')")
    assert isinstance(again.output, io.StringIO)
    assert again.output.getvalue() == text


def test_a_dynamic_predicate_is_listed_with_its_declaration() -> None:
    engine = _engine()
    engine.replace_facts("vehicle", 2, [("ego", 1.5)])
    assert engine.holds("listing(vehicle)")
    assert isinstance(engine.output, io.StringIO)
    assert engine.output.getvalue() == ":- dynamic vehicle/2.\n\nvehicle(ego, 1.5).\n\n"


def test_portray_clause_names_variables() -> None:
    assert _written("portray_clause(f(X, Y, X, 'A'))") == "f(A, _, A, 'A').\n"
