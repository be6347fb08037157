"""Programs of many clauses are lowered; those whose alternatives multiply are refused."""

from __future__ import annotations

import pytest

from drlsl.benchmarks import random_scenes
from drlsl.driving.scene import SCHEMA, Action, SceneBatch
from drlsl.driving.shield import Shield
from drlsl.logic import Engine
from drlsl.lowering.frontend import Query, lower
from drlsl.lowering.ir import NotLowerable
from drlsl.shield import consult_rules


def program(count: int) -> Engine:
    """highway.pl with further reasons against a lane change, of which the last one holds now and then."""
    engine = Engine()
    consult_rules(engine, "highway.pl")
    clauses = (
        f"objection(Action, further_{number}) :- lane_change(Action, _), velocity(ego, V), "
        f"V > {36 + (count - number) / 16}.\n"
        for number in range(count)
    )
    engine.consult_text("".join(["% many reasons\n:- multifile(objection/2).\n", *clauses]), "further")
    return engine


def test_a_program_of_many_clauses_decides_alike_in_arrays() -> None:
    engine = program(600)
    scenes = random_scenes(12, 10)
    arrays, alone = Shield(engine, tier="numpy"), Shield(engine, tier="interpreter")
    masks = arrays.decide_batch(SceneBatch.of(scenes)).action_mask
    told = [alone.decide(scene).safe_actions for scene in scenes]
    assert [{action for action in Action if mask[action]} for mask in masks] == [set(one) for one in told]
    assert len(set(told)) > 1


def test_a_program_that_explodes_is_refused() -> None:
    engine = Engine()
    choices = "".join(f"c({number}). " for number in range(20))
    engine.consult_text(f"{choices} many :- c(A), c(B), c(C), c(D), A + B + C + D > 70.", "exploding")
    with pytest.raises(NotLowerable, match="alternatives"):
        lower(engine, SCHEMA, [Query("many", 0, "holds")])
