"""A loop whose values do not count does not run, and that changes no answer."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from drlsl.logic import Engine
from drlsl.lowering.backends import compile_scalar
from drlsl.lowering.backends.needs import Needs
from drlsl.lowering.frontend import Query, lower
from drlsl.lowering.ir import Pool, Relation, Schema, reach
from tests.lowering.tiers import Tiers

SCHEMA = Schema(
    [
        Relation("car", ("int", "float", "float"), key=0, capacity=8),
        Relation("sight", ("float",), single=True),
    ]
)
TEXTS = {
    "a loop that reads another": """
        action(wait) :- near(_).
        action(go) :- \\+ near(_), least(Y), car(_, X, V), X > Y + 1.0, V > Y.
    """,
    "two, each read by the next": """
        action(wait) :- near(_), \\+ fast(_).
        action(go) :- \\+ near(_), fast(_), held(_).
        action(turn) :- \\+ near(_), fast(_), \\+ held(_), free(_).
        held(Car) :- least(Y), car(Car, X, V), V - Y > X.
        free(Car) :- aggregate_all(max(V), (held(_), car(_, _, V)), W), car(Car, X, _), X > W.
        free(Car) :- least(Y), car(Car, X, V), \\+ (car(Other, Z, _), Other \\== Car, abs(Z - X) < V - Y).
    """,
    "a choice": "action(wait) :- sight(S), ( S > 5.0 -> least(X) ; X = S ), X < 3.0.",
    "the other choice": "action(go) :- sight(S), ( S > 5.0 -> X = S ; greatest(X) ), X > 4.0.",
    "both choices": """
        action(wait) :- sight(S), ( S > 5.0 -> least(X) ; X = S ), X < 3.0.
        action(go) :- sight(S), ( S > 5.0 -> X = S ; greatest(X) ), X > 4.0.
    """,
    "needed in two places": """
        action(wait) :- sight(S), S > 7.0, crowded.
        action(go) :- sight(S), S < 3.0, crowded.
        crowded :- aggregate_all(count, (car(A, X, _), car(B, Y, _), A < B, abs(X - Y) < 3.0), N), N > 1.
    """,
}
RULES = """
    near(Car) :- car(Car, X, _), X < 5.0.
    fast(Car) :- car(Car, _, V), V > 5.0.
    least(X) :- aggregate_all(min(V), car(_, V, _), X).
    greatest(X) :- aggregate_all(max(Y), car(_, Y, _), X).
"""


class Read(list[Any]):
    """Rows that count how often they are gone through."""

    times = 0

    def __iter__(self) -> Iterator[Any]:
        self.times += 1
        return super().__iter__()


def engine(text: str) -> Engine:
    made = Engine()
    made.consult_text(RULES + text)
    return made


def facts(sight: float, rows: list[Any]) -> dict[Any, Any]:
    return {("car", 3): rows, ("sight", 1): [(sight,)]}


def scenes(count: int) -> list[dict[Any, Any]]:
    rng = np.random.default_rng(0)
    places = [rng.uniform(0.0, 10.0, (rng.integers(0, 5), 2)).tolist() for _ in range(count)]
    return [facts(rng.uniform(0.0, 10.0), [(n, *row) for n, row in enumerate(each)]) for each in places]


@pytest.mark.parametrize("mode", ["set", "all", "first"])
@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
def test_every_tier_answers_as_the_interpreter(text: str, mode: Any) -> None:
    tiers = Tiers(engine(text), SCHEMA, Query("action", 1, mode))
    assert tiers.arrays or mode != "set"
    assert tiers.check(scenes(300)) > 250


@pytest.mark.parametrize(
    ("name", "idle", "needed"),
    [("a choice", 4.0, 6.0), ("the other choice", 6.0, 4.0), ("needed in two places", 5.0, 9.0)],
)
def test_a_loop_runs_only_where_it_counts(name: str, idle: float, needed: float) -> None:
    answer = compile_scalar(lower(engine(TEXTS[name]), SCHEMA, [Query("action", 1, "set")]))
    times = {}
    for sight in (idle, needed):
        rows = Read([(0, 1.0, 8.0), (1, 2.0, 9.0)])
        answer(facts(sight, rows))
        times[sight] = rows.times
    assert times[idle] < times[needed]


def test_a_branch_of_a_number_counts_where_it_is_chosen() -> None:
    pool, (car, sight) = Pool(), SCHEMA.relations.values()
    loop = pool.fresh_loop(pool.rows(car))
    least = pool.extreme("min_of", loop, pool.true, pool.column(loop, car, 1))
    seen = pool.column(pool.row(sight), sight, 0)
    far = pool.less(pool.const(5.0), seen)
    for number, when in (
        (pool.choose(far, least, seen), far),
        (pool.choose(far, seen, least), pool.not_(far)),
        (pool.make("add", "float", (least, seen)), pool.true),
    ):
        result = pool.less(number, pool.const(3.0))
        assert Needs(pool, [(result, pool.true)], reach([result])).of([least], []) is when
