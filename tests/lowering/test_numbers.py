"""Arithmetic at the edges of numbers, and facts of another kind than their column: alike in all tiers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from drlsl.logic import Engine
from drlsl.lowering.backends import Rows, compile_scalar
from drlsl.lowering.frontend import Query, lower
from drlsl.lowering.ir import Relation, Schema, Undecided
from drlsl.lowering.ir.schema import Kind
from tests.lowering.tiers import ARRAY_TIERS, Facts, Tiers, ask, same

LIMIT = ("limit", 1)
OPERATIONS = ("+", "-", "*", "/", "**", "^", "//", "mod", "min", "max")
CONSTANTS = (
    *("0.0", "-0.0", "1.0e-31", "-1.0e-31", "1.0e-300", "1.0e15", "1.0e17", "1.0e300", "0.5", "-0.5", "2.0"),
    *("-2.0", "3.0", "0", "1", "-1", "2", "7"),
)
NUMBERS = (0.0, -0.0, 1e-31, -1e-300, 5e-324, 0.5, 1.0, -1.0, -3.7, 25.0, 1e15, -1e15, 1e16)


def schema_of(kind: Kind) -> Schema:
    return Schema([Relation("limit", (kind,), single=True)])


def tiers(text: str, kind: Kind = "float") -> Tiers:
    engine = Engine()
    engine.consult_text(text)
    return Tiers(engine, schema_of(kind), Query("p", 1, "first"))


def scenes(*limits: object) -> Sequence[Facts]:
    return [{LIMIT: [(limit,)]} for limit in limits]


@settings(deadline=None, max_examples=150)
@given(st.sampled_from(OPERATIONS), st.sampled_from(CONSTANTS), st.booleans(), st.booleans())
@example("/", "1.0e-31", False, False)
@example("^", "0.5", False, False)
def test_operations_with_extreme_constants(name: str, constant: str, first: bool, twice: bool) -> None:
    left, right = (f"({constant})", "X") if first else ("X", f"({constant})")
    expression = f"{name}({left}, {right})"
    if twice:
        expression = f"({expression} + X) / {constant if constant not in ('0', '0.0', '-0.0') else 'X'}"
    tiers(f"p(Y) :- limit(X), Y is {expression}.").check(scenes(*NUMBERS))


@pytest.mark.parametrize(
    ("expression", "limit"),
    [
        ("X / 1.0e-31", 1.0),
        ("X / -1.0e-31 + X", 3.5),
        ("X ** 0.5", 0.0),
        ("X ^ 0.5", 0.0),
        ("(X ^ 2 + (X - 1.0) ^ 2) ^ 0.5", 1.0),
        ("(X - X) ** 1.5", 7.0),
        ("X ** -2.0", -4.0),
        ("X ** X", 0.0),
        ("0.0 ** X", 2.5),
    ],
)
def test_decided_by_every_tier(expression: str, limit: float) -> None:
    assert tiers(f"p(Y) :- limit(X), Y is {expression}.").check(scenes(limit)) == 1


@pytest.mark.parametrize("expression", ["X ** 0.5", "X ** -1.5", "X ^ (X - 1.0)", "X ^ -0.5"])
def test_a_power_without_a_value_is_an_error(expression: str) -> None:
    both = tiers(f"p(Y) :- limit(X), Y is {expression}.")
    for limit in (-1.5, 0.0) if expression != "X ** 0.5" else (-1.5,):
        (scene,) = scenes(limit)
        assert isinstance(ask(both.engine, both.query, scene), Exception)
        assert both.check([scene]) == 0


@settings(deadline=None, max_examples=60)
@given(st.sampled_from(["X", "X + 1", "X / 2", "X // 2.0", "integer(X)", "max(X, 2)"]), st.integers(-9, 9))
def test_an_integer_in_a_column_of_floats_is_that_float(expression: str, limit: int) -> None:
    text = f"p(Y) :- limit(X), ( X == {limit}.0 -> Y is {expression} ; Y = 77 )."
    engine = Engine()
    engine.consult_text(text)
    schema, query = schema_of("float"), Query("p", 1, "first")
    facts = {LIMIT: schema.relations[LIMIT].conform([(limit,)])}
    expected = ask(engine, query, facts)
    lowered = lower(engine, schema, [query])
    try:
        (given,) = compile_scalar(lowered)({LIMIT: [(limit,)]})
    except Undecided:
        assert isinstance(expected, Exception)
    else:
        assert same(given, expected)
    for make in ARRAY_TIERS.values():
        result: Any = make(lowered)({LIMIT: Rows([np.array([limit])])})
        if not result.undecided[0]:
            assert result.answers[0].value.tolist()[0] == expected


def test_large_floats_that_a_column_may_hold_are_decided_one_by_one() -> None:
    engine = Engine()
    engine.consult_text("p(Y) :- findall(X, seen(X), Xs), sum_list(Xs, Y).")
    schema = Schema([Relation("seen", ("float",))])
    both = Tiers(engine, schema, Query("p", 1, "first"))
    rows = [(9e14,), (9e14,), (-9e14,)]  # each within the bound, their magnitudes together beyond it
    assert both.check([{("seen", 1): rows}]) == 1
    assert both.check([{("seen", 1): [*rows, (1.1e15,)]}]) == 0


@pytest.mark.parametrize(
    ("kind", "value", "made"),
    [
        ("float", 3, 3.0),
        ("float", np.float32(0.5), 0.5),
        ("float", np.int64(4), 4.0),
        ("float", np.float16(0.5), 0.5),
        ("int", np.int64(3), 3),
        ("int", np.uint8(3), 3),
        ("atom", np.str_("left"), "left"),
    ],
)
def test_what_conforms(kind: Kind, value: object, made: object) -> None:
    ((given,),) = Relation("limit", (kind,)).conform([(value,)])
    assert given == made
    assert type(given) is type(made)


@pytest.mark.parametrize(
    ("kind", "value", "problem"),
    [
        ("float", True, TypeError),
        ("float", "3.5", TypeError),
        ("float", b"3.5", TypeError),
        ("float", np.True_, TypeError),
        ("float", np.array([3.5]), TypeError),
        ("int", np.True_, TypeError),
        ("int", np.float64(3.0), TypeError),
        ("float", None, TypeError),
        ("float", 10**400, ValueError),
        ("int", 3.0, TypeError),
        ("int", True, TypeError),
        ("atom", 3, TypeError),
    ],
)
def test_what_does_not_conform(kind: Kind, value: object, problem: type[Exception]) -> None:
    relation = Relation("limit", (kind,), fields=("speed",))
    with pytest.raises(problem, match="speed of limit/1 is"):
        relation.conform([(value,)])
    with pytest.raises(ValueError, match="has 2 values"):
        relation.conform([(value, value)])
