"""Arithmetic: values, types and errors by the standard."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drlsl.logic import (
    Engine,
    EvaluationError,
    InstantiationError,
    LimitExceeded,
    Limits,
    PrologError,
    PrologTypeError,
    ResourceError,
)
from drlsl.logic.jit import tiering as tiers


@pytest.fixture(scope="module")
def engine() -> Engine:
    return Engine()


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("1 + 2", 3),
        ("1 + 2.0", 3.0),
        ("7 / 2", 3.5),
        ("4 / 2", 2.0),
        ("7 // 2", 3),
        ("-7 // 2", -3),
        ("-7 div 2", -4),
        ("-7 mod 3", 2),
        ("-7 rem 3", -1),
        ("7 mod -3", -2),
        ("2 ** 3", 8.0),
        ("2 ^ 3", 8),
        ("2 ^ 100", 2**100),
        ("2.0 ^ 3", 8.0),
        ("1 ^ -5", 1),
        ("-1 ^ -5", -1),
        ("(-1) ^ -5", -1),
        ("0 ^ 0", 1),
        ("0.0 ** 0", 1.0),
        ("max(1, 2.0)", 2.0),
        ("min(1, 2.0)", 1),
        ("abs(-3)", 3),
        ("sign(-2.5)", -1.0),
        ("gcd(12, 18)", 6),
        ("msb(1000)", 9),
        ("truncate(-2.5)", -2),
        ("round(2.5)", 3),
        ("round(-2.5)", -3),
        ("round(0.49999999999999994)", 0),
        ("round(-0.49999999999999994)", 0),
        ("ceiling(2.1)", 3),
        ("floor(-2.1)", -3),
        ("integer(2.5)", 3),
        ("float_integer_part(-2.5)", -2.0),
        ("float_fractional_part(-2.5)", -0.5),
        ("sqrt(4)", 2.0),
        ("atan2(1, 0)", math.pi / 2),
        ("copysign(2, -0.0)", -2.0),
        ("5 /\\ 3", 1),
        ("5 \\/ 3", 7),
        ("5 xor 3", 6),
        ("\\ 5", -6),
        ("1 << 4", 16),
        ("-1 >> 1", -1),
        ("pi", math.pi),
        ("0'a", 97),
        ("[5]", 5),
        ("- (- (1))", 1),
        ("cot(1.0)", 1 / math.tan(1.0)),
        ("e", math.e),
    ],
)
def test_values(engine: Engine, expression: str, value: float) -> None:
    solution = engine.once(f"X is {expression}")
    assert solution is not None
    assert (solution["X"], type(solution["X"])) == (value, type(value))


@pytest.mark.parametrize(
    ("expression", "error", "message"),
    [
        ("_ + 1", InstantiationError, "instantiated"),
        ("foo + 1", PrologTypeError, "foo/0"),
        ("foo(1, 2)", PrologTypeError, "foo/2"),
        ("1 / 0", EvaluationError, "zero_divisor"),
        ("1 / 0.0", EvaluationError, "zero_divisor"),
        ("0 / 0.0", EvaluationError, "undefined"),
        ("1 // 0", EvaluationError, "zero_divisor"),
        ("1 mod 0", EvaluationError, "zero_divisor"),
        ("1.0 // 2", PrologTypeError, "integer"),
        ("1 << 1.0", PrologTypeError, "integer"),
        ("2 ^ -1", PrologTypeError, "float"),
        ("sqrt(-1)", EvaluationError, "undefined"),
        ("log(0)", EvaluationError, "undefined"),
        ("acos(2)", EvaluationError, "undefined"),
        ("atan2(0, 0)", EvaluationError, "undefined"),
        ("exp(1000)", EvaluationError, "float_overflow"),
        ("1.0e300 * 1.0e300", EvaluationError, "float_overflow"),
        ("float(10 ^ 400)", EvaluationError, "float_overflow"),
        ("10 ^ 400 + 1.0", EvaluationError, "float_overflow"),
        ("10 ^ 400 / 3", EvaluationError, "float_overflow"),
        ("inf", PrologTypeError, "inf/0"),
        ("2 ** 4000000.5", EvaluationError, "float_overflow"),
        ("7 ^ (7 ^ 12)", ResourceError, "memory"),
        ("1 << (1 << 40)", ResourceError, "memory"),
    ],
)
def test_errors(engine: Engine, expression: str, error: type[PrologError], message: str) -> None:
    with pytest.raises(error, match=message):
        engine.once(f"X is {expression}")


def test_flag_iso_off() -> None:
    engine = Engine(flags={"iso": "false"})
    for expression, value in (
        ("4 / 2", 2),
        ("7 / 2", 3.5),
        ("2 ** 3", 8),
        ("2 ^ -1", 0.5),
        ("inf", math.inf),
    ):
        solution = engine.once(f"X is {expression}")
        assert solution is not None
        assert (solution["X"], type(solution["X"])) == (value, type(value))


def test_deep_expression(engine: Engine) -> None:
    engine.consult_text("sum(0, 0) :- !. sum(N, 1 + E) :- M is N - 1, sum(M, E).")
    assert engine.holds("sum(20000, E), X is E, X =:= 20000")


@pytest.mark.parametrize("goal", ["X = X + 1, Y is X", "X = - X, Y is X", "X = max(1, X), X > 2"])
def test_an_expression_without_end_is_an_error(engine: Engine, goal: str) -> None:
    with pytest.raises(PrologError, match="acyclic_term"):
        engine.once(goal, limits=Limits(seconds=5.0))


def test_limits_bind_the_evaluation_of_shared_parts(engine: Engine) -> None:
    engine.consult_text("twice(0, T, T) :- !. twice(N, T, R) :- M is N - 1, twice(M, T + T, R).")
    for depth in (40, 400):
        with pytest.raises(LimitExceeded):
            engine.once(f"twice({depth}, 1, T), X is T", limits=Limits(inferences=50_000))


@given(st.integers(), st.integers().filter(bool))
def test_division_laws(left: int, right: int) -> None:
    engine = Engine()
    assert engine.holds(f"X is ({left}) // ({right}) * ({right}) + ({left}) rem ({right}), X =:= {left}")
    assert engine.holds(f"X is ({left}) div ({right}) * ({right}) + ({left}) mod ({right}), X =:= {left}")


def test_operations_in_a_compiled_body_are_those_of_the_evaluator() -> None:
    """Compiled code does the common cases itself: each with operands of every sign, size and type."""
    operators = ["+", "-", "*", "/", "//", "div", "mod", "rem", "<<", "/\\\\", "min", "^"]
    operands = ["0", "1", "2", "(-1)", "(-3)", "7", "(-7)", str(2**61), str(-(2**61)), "2.5", "(-0.0)"]
    forms = [f"'{name}'({{}}, {{}})" for name in operators]
    clauses = [
        (form.format("A", operand), form.format(operand, "A")) for form in forms for operand in operands
    ]
    program = "".join(
        f"of{at}(A, X) :- X is {of}.\nby{at}(A, X) :- X is {by}.\n" for at, (of, by) in enumerate(clauses)
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tiers, "PATIENCE", 0)
        fast, plain = Engine(), Engine(compiled=False)
        for engine in (fast, plain):
            engine.consult_text(program + "told(G, X) :- catch(G, error(X, _), true).\n")
        values = f"member(A, [{', '.join(operands)}])"
        for at, pair in enumerate(clauses):
            goal = f"findall(X-Y, ({values}, told(of{at}(A, X), X), told(by{at}(A, Y), Y)), L)"
            found, expected = (repr(engine.once(goal)) for engine in (fast, plain))
            assert found == expected, pair


@given(st.floats(allow_nan=False, allow_infinity=False), st.integers(-(2**70), 2**70))
def test_comparison_is_exact(left: float, right: int) -> None:
    engine = Engine()
    engine.replace_facts("pair", 2, [(left, right)])
    assert engine.holds("pair(X, Y), X < Y") == (left < right)
    assert engine.holds("pair(X, Y), X =:= Y") == (left == right)


def test_random_numbers_belong_to_the_engine() -> None:
    one, other = Engine(), Engine()
    for engine in (one, other):
        engine.once("set_random(seed(7))")
    other.once("X is random(5)")
    draws = [[engine.once("X is random(1000000)") for _ in range(3)] for engine in (one, other)]
    assert draws[0][1:] == draws[1][:2]
