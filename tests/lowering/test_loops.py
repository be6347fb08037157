"""What several answers share within one loop does not change any of them."""

from __future__ import annotations

import pytest

from drlsl.logic import Engine
from drlsl.lowering.backends import compile_scalar
from drlsl.lowering.frontend import Query, lower
from drlsl.lowering.ir import Relation, Schema
from tests.lowering.tiers import ask

SCHEMA = Schema([Relation("vehicle", ("atom", "int", "float"), key=0)])
TEXTS = {
    "the opposite of a part of a condition": """
        first(Car) :- vehicle(Car, L, X), X > 5.0, L > 2.
        second(Car) :- vehicle(Car, L, X), \\+ X > 5.0.
    """,
    "two that exclude the one between them": """
        first(Car) :- vehicle(Car, L, X), L \\== 2, X > 1.0.
        second(Car) :- vehicle(Car, L, X), L == 2, X > 1.0.
        third(Car) :- vehicle(Car, L, X), L == 3, X > 0.0.
    """,
    "the same in another order": """
        first(Car) :- vehicle(Car, L, X), L == 2, X > 1.0.
        second(Car) :- vehicle(Car, L, X), L \\== 2.
        third(Car) :- vehicle(Car, L, X), L == 3, X > 0.0.
    """,
    "opposites": """
        first(Car) :- vehicle(Car, L, X), X > 5.0.
        second(Car) :- vehicle(Car, L, X), \\+ X > 5.0.
    """,
}


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
@pytest.mark.parametrize("mode", ["first", "all"])
def test_answers_that_share_a_loop(text: str, mode: str) -> None:
    engine = Engine()
    engine.consult_text(text)
    names = [name for name in ("first", "second", "third") if engine.defines(name, 1)]
    queries = [Query(name, 1, mode) for name in names]  # type: ignore[arg-type]  # a Mode
    answers = compile_scalar(lower(engine, SCHEMA, queries))
    places = [(lane, x) for lane in (1, 2, 3) for x in (0.0, 0.5, 3.0, 9.0)]
    for one in places:
        for other in places:
            facts = {("vehicle", 3): [("a", *one), ("b", *other)]}
            assert list(answers(facts)) == [ask(engine, query, facts) for query in queries], (one, other)
