"""Single rules, each with what makes it hard: order, cuts, ties, kinds of numbers, errors, refusals."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any

import numpy as np
import pytest

from drlsl.logic import Engine, EvaluationError
from drlsl.lowering.backends import (
    Rows,
    compile_numpy,
    compile_scalar,
    numpy_backend,
    scalar_source,
)
from drlsl.lowering.frontend import Mode, Query, lower
from drlsl.lowering.ir import INT_BOUND, NotLowerable, Relation, Schema, Undecided
from tests.installed import TORCH
from tests.lowering.tiers import Facts, Tiers, ask, to_rows

SCHEMA = Schema(
    [
        Relation("car", ("atom", "int", "float"), key=0, first="ego"),
        Relation("lane", ("int", "atom", "float"), key=0, capacity=8),
        Relation("spot", ("int", "float")),
        Relation("limit", ("float",), single=True),
        Relation("steps", ("int",), single=True),
    ]
)


def facts(
    *,
    cars: Sequence[tuple[str, int, float]] = (("ego", 1, 0.0),),
    lanes: Sequence[tuple[int, str, float]] = ((1, "left", 2.0), (2, "right", 5.5)),
    spots: Sequence[tuple[int, float]] = (),
    limit: float = 10.0,
    steps: int = 3,
) -> Facts:
    return {
        ("car", 3): cars,
        ("lane", 3): lanes,
        ("spot", 2): spots,
        ("limit", 1): [(limit,)],
        ("steps", 1): [(steps,)],
    }


def engine_of(text: str) -> Engine:
    engine = Engine()
    engine.consult_text(text, "rules.pl")
    return engine


def tiers(text: str, goal: str, mode: Mode) -> Tiers:
    name, _, arity = goal.partition("/")
    return Tiers(engine_of(text), SCHEMA, Query(name, int(arity), mode))


def answer(text: str, goal: str, mode: Mode, scene: Facts) -> Any:
    """The answer of all tiers, which have to agree and decide."""
    both = tiers(text, goal, mode)
    assert both.check([scene]) == 1
    return both.scalar(scene)[0]


CARS = [("ego", 1, 0.0), ("a", 1, 7.0), ("b", 2, 3.0), ("c", 1, 3.0)]


@pytest.mark.parametrize(
    ("text", "goal", "mode", "expected"),
    [
        # clause order and fact order
        ("p(2). p(1). p(2).", "p/1", "all", [2, 1, 2]),
        ("p(2). p(1). p(2).", "p/1", "set", [2, 1]),
        ("p(C) :- car(C, _, X), X > 1.0.", "p/1", "all", ["a", "b", "c"]),
        ("p(C) :- car(C, _, X), X > 1.0, X < 5.0.", "p/1", "first", "b"),
        ("p(C, x) :- car(C, 1, _). p(C, y) :- car(C, 2, _).", "p/2", "first", ("ego", "x")),
        # the first row of two loops is the first in the order of the outer one
        ("p(C) :- lane(L, _, _), car(C, L, X), X > 1.0.", "p/1", "first", "a"),
        ("p(L, C) :- car(C, L, X), X > 1.0, lane(L, _, _).", "p/2", "first", (1, "a")),
        # cuts
        ("p(C) :- car(C, _, X), X > 1.0, !. p(none).", "p/1", "all", ["a"]),
        ("p(C) :- car(C, _, X), X > 9.0, !. p(none).", "p/1", "all", ["none"]),
        ("p(1) :- !, fail. p(2).", "p/1", "all", []),
        ("p(X) :- q(X), !. q(1) :- car(_, _, X), X > 9.0. q(2). q(3).", "p/1", "all", [2]),
        ("p(X) :- ( car(X, 5, _), ! ; X = 1 ). p(2).", "p/1", "all", [1, 2]),
        ("p(X) :- ( X = 1, ! ; X = 2 ). p(3).", "p/1", "all", [1]),
        ("p(X) :- ( car(_, 2, _) -> !, X = 1 ; X = 2 ). p(3).", "p/1", "all", [1]),
        ("p(X) :- ( car(_, 5, _) -> !, X = 1 ; X = 2 ). p(3).", "p/1", "all", [2, 3]),
        ("p(X) :- call(!), X = 1. p(2).", "p/1", "all", [1, 2]),
        ("p :- \\+ ( car(_, _, X), X > 5.0, ! ).", "p/0", "holds", False),
        # if-then-else commits to the first solution of its condition, *-> to none
        ("p(C) :- ( car(C, _, X), X > 1.0 -> true ; C = none ).", "p/1", "all", ["a"]),
        ("p(C) :- ( car(C, _, X), X > 1.0 *-> true ; C = none ).", "p/1", "all", ["a", "b", "c"]),
        ("p(C) :- ( car(C, _, 1.0) *-> true ; C = none ).", "p/1", "all", ["none"]),
        ("p(C) :- ( car(C, _, X), X > 1.0 *-> true ).", "p/1", "all", ["a", "b", "c"]),
        ("p(C) :- once(car(C, 2, _)).", "p/1", "all", ["b"]),
        ("p(C) :- ignore(car(C, 2, _)), car(C, _, _).", "p/1", "all", ["b"]),
        # extremes: of equal values the first row, and no row no solution
        ("p(C) :- aggregate_all(min(X, D), ( car(D, _, X), X > 1.0 ), min(_, C)).", "p/1", "first", "b"),
        ("p(C) :- aggregate_all(max(X, D), ( car(D, _, X), X < 5.0 ), max(_, C)).", "p/1", "first", "b"),
        ("p(X) :- aggregate_all(min(X), ( car(_, _, X), X > 9.0 ), X).", "p/1", "first", None),
        (
            "p(C) :- aggregate_all(min(X, D), ( D = l, limit(X) ; D = m, limit(X) ), min(_, C)).",
            "p/1",
            "first",
            "l",
        ),
        ("p(X) :- aggregate_all(max(X), ( car(_, _, X) ; lane(_, _, X) ), X).", "p/1", "first", 7.0),
        ("p(N) :- aggregate_all(count, car(_, 1, _), N).", "p/1", "first", 3),
        ("p(N) :- aggregate_all(count, ( car(_, L, _), lane(L, _, _) ), N).", "p/1", "first", 4),
        ("p(N) :- aggregate_all(count, ( car(_, L, _), ( L > 0 ; L > 1 ) ), N).", "p/1", "first", 5),
        ("p(N) :- aggregate_all(count, car(_, 9, _), N).", "p/1", "first", 0),
        ("p(S) :- aggregate_all(sum(X), car(_, _, X), S).", "p/1", "first", 13.0),
        ("p(S) :- aggregate_all(sum(L), car(_, L, _), S).", "p/1", "first", 5),
        ("p(S) :- aggregate_all(sum(L), ( car(_, L, _), lane(L, _, _) ; L = 10 ), S).", "p/1", "first", 15),
        (
            "p(S) :- aggregate_all(sum(X), ( car(_, _, X) ; X = 0.1 ; car(_, 1, X) ), S).",
            "p/1",
            "first",
            23.1,
        ),
        ("p(S) :- aggregate_all(sum(X), car(_, 9, X), S).", "p/1", "first", 0),
        ("p(S) :- aggregate_all(sum(X), ( X = 0.5 ; car(_, 9, X), 1 mod 2.0 < X ), S).", "p/1", "first", 0.5),
        # lists
        ("p(Xs) :- findall(X, ( member(X, [a, b, c]), X \\== b ), Xs).", "p/1", "first", ["a", "c"]),
        ("p(N) :- findall(X, car(_, _, X), Xs), length(Xs, N).", "p/1", "first", 4),
        ("p(M) :- findall(X, car(_, _, X), Xs), max_list(Xs, M).", "p/1", "first", 7.0),
        ("p :- findall(X, car(_, 9, X), Xs), Xs == [].", "p/0", "holds", True),
        ("p(X) :- findall(C, car(C, 1, _), Cs), member(X, Cs), X \\== ego.", "p/1", "first", "a"),
        ("p([X, 1, Y]) :- limit(X), Y is X * 2.", "p/1", "first", [10.0, 1, 20.0]),
        # kinds of numbers
        ("p :- steps(N), N =:= 3.0.", "p/0", "holds", True),
        ("p :- steps(N), N == 3.0.", "p/0", "holds", False),
        ("p :- steps(3.0).", "p/0", "holds", False),
        ("p(X) :- steps(N), X is N / 2.", "p/1", "first", 1.5),
        ("p(X) :- steps(N), X is N / 3.", "p/1", "first", 1.0),
        ("p(X) :- steps(N), X is -7 // N.", "p/1", "first", -2),
        ("p(X) :- steps(N), X is -7 mod N.", "p/1", "first", 2),
        ("p(X) :- steps(N), X is -7 rem N.", "p/1", "first", -1),
        ("p(X) :- steps(N), X is -7 div N.", "p/1", "first", -3),
        ("p(X) :- steps(N), X is N ** 2.", "p/1", "first", 9.0),
        ("p(X) :- steps(N), X is N ^ 2.", "p/1", "first", 9),
        ("p(X) :- limit(L), X is max(3, L).", "p/1", "first", 10.0),
        ("p(X) :- limit(L), car(a, _, Y), X is min(L, Y) - 2 * max(Y, L).", "p/1", "first", -13.0),
        ("p(X) :- limit(L), X is max(10, L).", "p/1", "first", 10.0),
        ("p(X) :- limit(L), X is min(10, L).", "p/1", "first", 10.0),
        ("p(X) :- limit(L), X is max(30, L) + 1.", "p/1", "first", 31),
        ("p(X) :- limit(L), X is truncate(-L / 4.0).", "p/1", "first", -2),
        ("p(X) :- limit(L), X is round(L / 4.0).", "p/1", "first", 3),
        ("p(X) :- limit(L), X is sign(-L) * abs(-2) + sqrt(L * 10.0).", "p/1", "first", 8.0),
        # several aggregates in one
        (
            "p(X) :- aggregate_all(r(count, max(X), min(X)), car(_, _, X), r(N, A, I)), X is N + A - I.",
            "p/1",
            "first",
            11.0,
        ),
        (
            "p(C) :- aggregate_all(r(max(X, D), count), car(D, _, X), r(max(_, C), N)), N > 1.",
            "p/1",
            "first",
            "a",
        ),
        (
            "p(X) :- aggregate_all(s(count, sum(Y)), ( car(_, _, Y), Y > 9.0 ), s(N, S)), X is N + S.",
            "p/1",
            "first",
            0,
        ),
        ("p :- aggregate_all(r(count, max(X)), ( car(_, _, X), X > 9.0 ), _).", "p/0", "holds", False),
        ("p(X) :- lists:max_list([1, 2], Y), user:car(a, _, Z), X is Y + Z.", "p/1", "first", 9.0),
        # terms and tables
        ("t(a, 1.0). t(b, 2.0). p(X) :- member(K, [b, a]), t(K, X).", "p/1", "all", [2.0, 1.0]),
        ("p(D) :- car(b, L, _), lane(L, D, _).", "p/1", "first", "right"),
        ("p(f(C, X)) :- car(C, 2, X).", "p/1", "holds", True),
        ("p(N) :- between(1, 3, N), \\+ car(_, N, _).", "p/1", "all", [3]),
        ("p :- forall(car(_, L, _), lane(L, _, _)).", "p/0", "holds", True),
        ("p :- forall(car(_, L, _), L =:= 1).", "p/0", "holds", False),
        ("p :- G = car(_, 2, _), call(G).", "p/0", "holds", True),
        ("p :- call(car, _, 2, _).", "p/0", "holds", True),
        ("q(1, a). q(2, X) :- q(1, X). p(X) :- q(2, X).", "p/1", "first", "a"),
        ("q(_, 1). p(X, Y) :- q(A, X), q(B, Y), A = a, B = b.", "p/2", "first", (1, 1)),
    ],
)
def test_answers(text: str, goal: str, mode: Mode, expected: Any) -> None:
    got = answer(text, goal, mode, facts(cars=CARS))
    assert got == expected
    assert type(got) is type(expected)


@pytest.mark.parametrize(
    "text",
    [
        "p :- steps(N), N =:= 9007199254740992.0.",
        "p :- steps(N), limit(L), N > L.",
        "p :- steps(N), limit(L), X is max(N, L), X =< L.",
        "p :- steps(N), limit(L), X is min(N, L), X >= N.",
    ],
)
def test_an_integer_beside_a_float(text: str) -> None:
    """Tiers agree on those that a float is too, and leave the others to the interpreter."""
    both = tiers(text, "p/0", "holds")
    assert both.check([facts(steps=2**49 + extra, limit=2.0**49) for extra in (-1, 0, 1)]) == 3
    assert both.check([facts(steps=2**53 + 1, limit=2.0**53), facts(steps=2**60, limit=1.0)]) == 0


def test_no_rows_but_the_first() -> None:
    text = "p(N) :- aggregate_all(count, ( car(C, _, _), C \\== ego ), N). q(X) :- spot(_, X). r :- \\+ q(_)."
    alone = facts()
    assert answer(text, "p/1", "first", alone) == 0
    assert answer(text, "q/1", "first", alone) is None
    assert answer(text, "r/0", "holds", alone) is True


def test_a_row_that_no_key_finds() -> None:
    text = "p(W) :- car(ego, L, _), lane(L, _, W). q :- \\+ p(_)."
    nowhere = facts(cars=[("ego", 7, 0.0)])
    assert answer(text, "p/1", "first", nowhere) is None
    assert answer(text, "q/0", "holds", nowhere) is True


@pytest.mark.parametrize(
    ("text", "scene"),
    [
        ("p(X) :- limit(L), X is 1.0 / L.", facts(limit=0.0)),
        ("p(X) :- steps(N), X is 1 // N.", facts(steps=0)),
        ("p(X) :- limit(L), X is sqrt(L).", facts(limit=-1.0)),
        ("p(X) :- limit(L), X is log(L).", facts(limit=0.0)),
        ("p(X) :- limit(L), X is exp(L).", facts(limit=1000.0)),
        ("p(X) :- limit(L), X is L ** 0.5.", facts(limit=-2.0)),
        ("p(X) :- limit(L), X is L mod 2.", facts()),
        ("p(X) :- limit(_), X is foo + 1.", facts()),
        ("p(X) :- limit(L), X is L + sqrt(1.0 - 2.0).", facts()),
        ("p(X) :- limit(L), X is L * 1.0e300 * 1.0e300.", facts()),
        ("p(X) :- limit(_), X is Y + 1.", facts()),
        ("p(X) :- limit(X), nobody(X).", facts()),
        ("p(X) :- limit(X), \\+ '|'(X < 0.0, X > 1.0).", facts()),
        ("p(X) :- limit(X), ( X < 0.0 ; forall(true, (X > 1.0, 1)) ).", facts()),
        ("p(X) :- car(_, _, X), 1.0 / X > 2.0.", facts()),
        # the interpreter goes back into q, and meets the error there
        ("p(1) :- q, limit(0.0). q. q :- limit(L), 1.0 mod 2 > L. q.", facts()),
    ],
)
def test_an_error_is_left_to_the_interpreter(text: str, scene: Facts) -> None:
    both = tiers(text, "p/1", "first")
    assert isinstance(ask(both.engine, both.query, scene), Exception)
    with pytest.raises(Undecided):
        both.scalar(scene)
    assert both.check([scene]) == 0  # the arrays mark the scene too


@pytest.mark.parametrize(
    "text",
    [
        "p(X) :- limit(L), ( L =:= 0.0 -> X = none ; X is 1.0 / L ).",
        "p(X) :- limit(L), L > 0.0, !, X is 1.0 / L. p(none).",
        "p(none) :- limit(0.0), !. p(X) :- limit(L), X is 1.0 / L.",
        "p(none) :- \\+ ( limit(L), L > 0.0, 1.0 / L > 2.0 ).",
    ],
)
def test_an_error_off_the_path_does_not_count(text: str) -> None:
    assert answer(text, "p/1", "holds", facts(limit=0.0)) is True


@pytest.mark.parametrize(
    "cars",
    [
        [("ego", 1, 0.0), ("a", 1, 0.0, 9.0)],
        [("ego", 1, 0.0, 9.0), ("a", 1, 0.0)],
        [("ego", 1), ("a", 1, 0.0)],
        [("ego", 1, 0.0, 9.0), ("a", 1, 0.0, 9.0)],
    ],
)
def test_rows_of_another_length_are_left_to_the_interpreter(cars: list[tuple[Any, ...]]) -> None:
    both = tiers("p(X) :- limit(L), car(_, K, Y), X is L + K + Y.", "p/1", "first")
    assert both.scalar(facts(cars=[("ego", 1, 0.0), ("a", 1, 0.0)]))
    with pytest.raises(Undecided):
        both.scalar(facts(cars=cars))


@pytest.mark.parametrize(
    "scene",
    [
        facts(limit=float("nan")),
        facts(limit=float("inf")),
        facts(limit=-1e16),
        facts(steps=2 * INT_BOUND),
        facts(cars=[("a", 1, 0.0)]),
        facts(cars=[]),
        facts(cars=[("ego", 1, 0.0), ("a", 1, float("nan"))]),
        facts(lanes=[(1, "left", 2.0), (1, "left", 2.0)]),
        {**facts(), ("limit", 1): []},
    ],
)
def test_facts_that_are_not_as_the_schema_says(scene: Facts) -> None:
    text = "p(X) :- limit(L), steps(N), car(_, K, Y), lane(K, _, W), X is L + N + Y + W."
    both = tiers(text, "p/1", "first")
    with pytest.raises(Undecided):
        both.scalar(scene)
    assert both.check([scene, facts()]) == 1


@pytest.mark.parametrize(
    "scene",
    [
        facts(cars=[("ego", 1.0, 0.0)]),  # type: ignore[list-item]  # the mistake that is tested
        facts(lanes=[(1, 5, 2.0)]),  # type: ignore[list-item]  # the mistake that is tested
        {**facts(), ("limit", 1): [(1.0, 2.0)]},
        {**facts(), ("limit", 1): [(1.0,), (2.0,)]},
        {**facts(), ("limit", 1): []},
    ],
)
def test_values_of_another_kind_or_number(scene: Facts) -> None:
    text = "p(X) :- car(_, K, X), lane(K, left, _), limit(L), X < L."
    with pytest.raises(Undecided):
        compile_scalar(lower(engine_of(text), SCHEMA, [Query("p", 1, "first")]))(scene)


def test_a_recursion_with_constants_ends_where_a_test_fails() -> None:
    text = "p(X) :- q(3, X). q(0, 0.0). q(N, X) :- N > 0, M is N - 1, q(M, Y), limit(L), X is Y + L."
    assert tiers(text, "p/1", "first").check([facts(limit=2.0)]) == 1


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("p(X) :- q(X, 1). q(X, N) :- q(X, N).", "recursively"),
        ("p(X) :- q(X, 1). q(X, N) :- M is N + 1, q(X, M).", "recursively"),
        ("p(X) :- car(_, _, X), write(X).", "it calls write/1"),
        ("p(X) :- atom_length(abc, X).", "it calls atom_length/2"),
        ("p(X) :- X is random(3).", "random/1"),
        ("p(X) :- X is inf.", "inf"),
        (":- table p/1. p(X) :- p(X). p(1).", "it is tabled"),
        ("p(X) :- aggregate_all(r(set(Y)), car(_, _, Y), r([X|_])).", "not an aggregate, or set/1"),
        (":- dynamic(seen/1). p(X) :- seen(X).", "seen/1 is dynamic"),
        ("p(X) :- car(_, _, _), ( car(_, 1, X), ! ; X = 1 ).", "cut inside a disjunction"),
        ("p(X) :- ( car(_, 1, X) *-> ! ; X = 1 ).", "a cut inside \\*->"),
        ("p(X) :- ( car(_, 1, X) *-> ! ).", "a cut inside \\*->"),
        ("p(_).", "unbound variable"),
        ("q(1).", "does not define"),
        ("p(X) :- steps(N), between(0, N, X).", "between/3"),
    ],
)
def test_what_is_refused(text: str, reason: str) -> None:
    with pytest.raises(NotLowerable, match=reason) as refusal:
        lower(engine_of(text), SCHEMA, [Query("p", 1, "first")])
    assert refusal.value.predicate in ("p/1", "q/2")


def test_a_refusal_names_the_clause() -> None:
    with pytest.raises(NotLowerable) as refusal:
        lower(engine_of("p(1).\n\np(X) :-\n    q(X).\nq(X) :- read(X)."), SCHEMA, [Query("p", 1, "first")])
    assert refusal.value.predicate == "q/1"
    assert str(refusal.value).startswith("rules.pl:5: q/1 cannot be lowered: it calls read/1")


def test_a_goal_that_raises_is_no_reason_to_refuse() -> None:
    text = "p(X) :- limit(L), ( L > 100.0 -> X is 1 / 0 ; X = L )."
    assert answer(text, "p/1", "first", facts()) == 10.0
    both = tiers(text, "p/1", "first")
    assert isinstance(ask(both.engine, both.query, facts(limit=200.0)), EvaluationError)
    assert both.check([facts(limit=200.0)]) == 0


def test_many_rows() -> None:
    text = (
        "p(C) :- aggregate_all(min(X, D), ( car(D, _, X), X > 0.0 ), min(_, C)). "
        "q(N) :- aggregate_all(count, car(_, _, _), N)."
    )
    cars = [("ego", 1, 0.0), *((f"c{n}", 1, float(60 - n % 30)) for n in range(60))]
    assert answer(text, "p/1", "first", facts(cars=cars)) == "c29"
    assert answer(text, "q/1", "first", facts(cars=cars)) == 61


def test_more_rows_than_the_capacity() -> None:
    text = "p(N) :- aggregate_all(count, ( car(_, L, _), lane(L, left, _) ), N)."
    lanes = [(n, "left" if n % 2 else "right", float(n)) for n in range(1, 30)]
    cars = [("ego", 1, 0.0), *((f"c{n}", n, 0.0) for n in range(1, 40))]
    assert answer(text, "p/1", "first", facts(cars=cars, lanes=lanes)) == 16


def test_several_rows_picked_out_inside_a_loop() -> None:
    """Two lanes pass the condition of their own that is taken out of the loop over cars."""
    text = "p(C, L) :- car(C, _, X), C \\== ego, lane(L, left, W), X < W."
    lanes = [(1, "left", 1.0), (2, "right", 9.0), (3, "left", 4.0), (4, "left", 8.0)]
    scene = facts(cars=CARS, lanes=lanes)
    assert answer(text, "p/2", "first", scene) == ("a", 4)
    assert answer(text, "p/2", "all", scene) == [("a", 4), ("b", 3), ("b", 4), ("c", 3), ("c", 4)]
    assert tiers(text, "p/2", "first").check([scene, facts(cars=CARS), facts()]) == 3


def test_scenes_in_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    text = (
        "p(C, S) :- limit(L), aggregate_all(min(X, D), ( car(D, _, X), X > L ), min(_, C)), lane(1, S, _). "
        "q :- car(_, N, X), lane(N, left, W), X > W."
    )
    scenes = [facts(cars=CARS[: 1 + n % 4], limit=n / 3) for n in range(11)]
    chunked = [numpy_backend, *([import_module("drlsl.lowering.backends.torch_backend")] if TORCH else [])]
    for chunk in (1, 2, 4, 11, 2048):
        for module in chunked:
            monkeypatch.setattr(module, "CHUNK", chunk)
        assert tiers(text, "p/2", "first").check(scenes) == 11
        assert tiers(text, "q/0", "holds").check(scenes) == 11


def test_shared_rows_and_ready_tables() -> None:
    lowered = lower(
        engine_of("p(C) :- car(C, N, X), C \\== ego, lane(N, left, W), X > W."),
        SCHEMA,
        [Query("p", 1, "first")],
    )
    program = compile_numpy(lowered)
    scenes = [facts(cars=CARS[:count]) for count in (1, 2, 3, 4)]
    rows = to_rows(program, SCHEMA, scenes)
    lanes = Rows([column[:1] for column in rows["lane", 3].columns if column is not None])
    apart = program(rows)
    assert np.array_equal(program({**rows, ("lane", 3): lanes}).answers[0].value, apart.answers[0].value)
    ready = program.table("lane", 3, lanes)
    cars = rows["car", 3]
    given = Rows([np.asfortranarray(column) for column in cars.columns if column is not None], cars.valid)
    result = program({**rows, ("lane", 3): ready, ("car", 3): given})
    assert np.array_equal(result.answers[0].fails, [True, False, False, False])
    assert program.atom(int(result.answers[0].value[1])) == "a"
    assert not result.undecided.any()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({("lane", 3): None}, "no facts of lane/3"),
        ({("lane", 3): Rows([np.ones((2, 1))] * 2)}, "lane/3: 2 columns"),
        ({("lane", 3): Rows([np.ones(2, np.int64)] * 3)}, "lane/3: a column of shape"),
        ({("lane", 3): Rows([np.ones((2, 1))] * 3)}, "column 0 of lane/3 holds .* int, .* given as float64"),
        ({("lane", 3): Rows([np.ones((2, 1), np.uint64)] * 3)}, "is given as uint64"),
        (
            {("lane", 3): Rows([np.ones((2, k), np.int64) for k in (3, 3, 2)])},
            "lane/3: arrays for 2 and 3 rows",
        ),
        (
            {("lane", 3): Rows([np.ones((n, 1), np.int64) for n in (2, 3, 1)])},
            "lane/3: arrays for 2 and 3 scenes",
        ),
        ({("lane", 3): Rows([None, np.ones((2, 1)), np.ones((2, 1))])}, "column 0 of lane/3"),
        ({("lane", 3): Rows([np.ones((3, 1), np.int64)] * 3)}, "scenes where others have"),
    ],
)
def test_arrays_that_do_not_fit(change: dict[tuple[str, int], Rows | None], message: str) -> None:
    lowered = lower(
        engine_of("p :- car(_, N, X), lane(N, left, W), X > W."), SCHEMA, [Query("p", 0, "holds")]
    )
    program = compile_numpy(lowered)
    given = {**to_rows(program, SCHEMA, [facts(), facts()]), **change}
    with pytest.raises(ValueError, match=message):
        program({key: rows for key, rows in given.items() if rows is not None})


def test_a_test_that_several_quantifiers_share_is_written_once() -> None:
    text = (
        "near(C, X) :- car(C, _, X), C \\== ego, limit(L), X < L. "
        "p(C) :- aggregate_all(min(X, D), near(D, X), min(_, C)). "
        "q :- near(_, X), X > 5.0."
    )
    source = scalar_source(lower(engine_of(text), SCHEMA, [Query("p", 1, "first"), Query("q", 0, "holds")]))
    assert source.count("for ") == 1
    assert source.count("x < l:") == 1
