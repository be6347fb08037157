"""No tier fuses a product with a sum: what margins of proofs take for granted."""

from __future__ import annotations

import numpy as np
import pytest

from drlsl.logic import Engine
from drlsl.lowering.backends import Rows
from drlsl.lowering.frontend import Query, lower
from drlsl.lowering.ir import Relation, Schema
from tests.lowering.tiers import Tiers

NEAR_1 = 1.0 + 2.0**-27
"""Its square is 1 + 2**-26 + 2**-54, and rounds to 1 + 2**-26."""

FACTS = {("a", 1): [(NEAR_1,)], ("b", 1): [(NEAR_1,)], ("c", 1): [(-(1.0 + 2.0**-26),)]}
SCHEMA = Schema([Relation(name, ("float",), single=True) for name, _ in FACTS])


def test_a_product_is_rounded_before_it_is_added_to() -> None:
    engine = Engine()
    engine.consult_text(
        ":- dynamic(a/1). :- dynamic(b/1). :- dynamic(c/1).\n"
        "rounded :- a(A), b(B), c(C), X is A * B + C, X =:= 0.0, Y is C + B * A, Y =:= 0.0.\n"
    )
    query = Query("rounded", 0, "holds")
    tiers = Tiers(engine, SCHEMA, query)
    assert tiers.check([FACTS] * 64) == 64
    assert tiers.scalar(FACTS) == (True,)
    pytest.importorskip("numba", reason="Numba is not installed")
    from drlsl.lowering.backends import compile_numba

    program = compile_numba(lower(engine, SCHEMA, [query]))
    many = {key: Rows([np.full(64, rows[0][0])], np.ones(64, dtype=np.bool_)) for key, rows in FACTS.items()}
    (answer,) = program(many).answers
    assert np.all(np.asarray(answer.value))
