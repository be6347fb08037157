"""Facts that Python tells an engine as rows: `replace_facts`."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drlsl.logic import (
    Compound,
    Engine,
    PrologSyntaxError,
)
from tests.logic.engines import values


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
        (np.True_, TypeError),
        (np.array(1), TypeError),
        (np.array([1]), TypeError),
        (np.complex128(1), TypeError),
        (Fraction(1, 3), TypeError),
        (Decimal(1), TypeError),
        (np.float32("nan"), ValueError),
        (Compound("f", (1,)), TypeError),
        (float("nan"), ValueError),
    ],
)
def test_values_that_are_no_facts_are_refused(engine: Engine, value: object, error: type[Exception]) -> None:
    engine.replace_facts("p", 2, [("kept", 1)])
    with pytest.raises(error):
        engine.replace_facts("p", 2, [("a", 1), ("b", value)])  # type: ignore[list-item]  # what is tested
    assert values(engine, "p(X, _)") == ["kept"]


@pytest.mark.parametrize(
    ("given_value", "made"),
    [
        (np.int64(3), 3),
        (np.int8(-3), -3),
        (np.uint64(2**64 - 1), 2**64 - 1),
        (np.float64(0.5), 0.5),
        (np.float32(0.5), 0.5),
        (np.float16("inf"), float("inf")),
        (np.str_("a"), "a"),
    ],
)
def test_numbers_of_numpy_are_numbers(engine: Engine, given_value: Any, made: object) -> None:
    engine.replace_facts("p", 1, [(given_value,)])
    (found,) = values(engine, "p(X)")
    assert found == made
    assert type(found) is type(made)


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
