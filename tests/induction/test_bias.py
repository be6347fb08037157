"""The declared quantities: what a file says, and that the numbers are those of its predicates."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drlsl.driving.scene import SceneBatch, facts_of
from drlsl.driving.shield import LIMITS
from drlsl.errors import UserError
from drlsl.induction import Quantity
from drlsl.induction.lane_changes import SceneBias
from drlsl.induction.lane_changes.scene_bias import SIDES
from drlsl.induction.quantities import EASIEST
from drlsl.logic import Engine
from drlsl.shield import consult_rules
from tests.assurance.evidence import generated_scenes

SHIPPED = SceneBias("learning.pl")


def test_the_numbers_are_the_hardest_that_the_predicates_give() -> None:
    scenes = generated_scenes(60)
    found = SHIPPED.values(SceneBatch.of(scenes))
    engine = Engine()
    consult_rules(engine, "learning.pl")
    some = 0
    for scene, values in zip(scenes, found, strict=True):
        for (name, arity), rows in facts_of(scene).items():
            engine.replace_facts(name, arity, rows)
        for side, numbers in zip(SIDES, values, strict=True):
            for one, number in zip(SHIPPED.quantities, numbers.tolist(), strict=True):
                goal = one.goal.format(choice=side, number="V")
                wanted = [float(str(one["V"])) for one in engine.query(goal, limits=LIMITS)]
                some += bool(wanted)
                if wanted:
                    assert number == pytest.approx((min if one.more else max)(wanted), abs=1e-9), goal
                else:
                    assert np.isnan(number), goal
    assert some > 100


@settings(max_examples=300, deadline=None)
@given(
    value=st.floats(-1e6, 1e6) | st.integers(-5000, 5000).map(lambda hundredths: hundredths / 100),
    limit=st.integers(-10_000, 10_000),
    more=st.booleans(),
)
def test_a_limit_holds_of_a_value_exactly_where_it_holds_of_its_ease(
    value: float, limit: int, more: bool
) -> None:
    bias = _with(Quantity("gap({choice}, {number})", "more" if more else "less"))
    (ease,) = bias.eases(np.array([value])).tolist()
    literal = bias.quantities[0].literal(limit, "V").removeprefix("forall(gap(Side, V), ").removesuffix(")")
    engine = Engine()
    engine.replace_facts("given", 1, [(value,)])
    assert engine.holds(f"given(V), {literal}") == (ease >= limit)


def _with(quantity: Quantity) -> SceneBias:
    bias = object.__new__(SceneBias)
    bias.quantities = (quantity,)  # type: ignore[misc]
    return bias


def test_what_has_no_solution_is_easiest_and_beyond_32_bits_is_refused() -> None:
    bias = _with(Quantity("gap({choice}, {number})", "more"))
    assert bias.eases(np.array([np.nan])).tolist() == [EASIEST]
    with pytest.raises(UserError, match=r"gap\(Side, _\): 2\.2e\+07 in hundredths is beyond the 32 bits"):
        bias.eases(np.array([2.2e7]))


def test_round_limits_are_round_and_all_within_32_bits() -> None:
    limits = Quantity("gap({choice}, {number})", "more", 0.5).round_limits
    assert (np.diff(limits) > 0).all()
    assert abs(int(limits[0])) < EASIEST
    assert [one / 100 for one in limits.tolist() if 300 <= one <= 3000] == [
        *(3.0, 3.5, 4.0, 4.5, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 12.5, 15.0, 17.5, 20.0, 22.5, 25.0, 30.0)
    ]


@pytest.mark.parametrize(
    ("declared", "why"),
    [
        ("", "declares nothing to learn from"),
        ("learn(gap(_, ahead), bigger).", r"learn\(gap\(Side, ahead, _\), bigger\): expected more or less"),
        ("learn(gap(_, ahead), more, 0.0).", "expected a step of 0.01 or more"),
        ("learn(gap(_, ahead), more). learn(gap(_, ahead), less).", "is declared twice"),
    ],
)
def test_a_wrong_declaration_is_told(declared: str, why: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.pl"
    path.write_text(f":- ensure_loaded('highway.pl').\n{declared}\ngap(_, ahead, 1.0).\n")
    with pytest.raises(UserError, match=why):
        SceneBias(path)


def test_a_quantity_that_only_the_interpreter_runs_is_asked_of_it(tmp_path: Path) -> None:
    path = tmp_path / "mine.pl"
    path.write_text(
        ":- ensure_loaded('highway.pl').\nlearn(letters(_), less).\n"
        "letters(_, N) :- target_vehicle(Car), atom_length(Car, N).\n"
    )
    scenes = generated_scenes(6)
    values = SceneBias(path).values(SceneBatch.of(scenes))[:, 0, 0]
    for scene, value in zip(scenes, values.tolist(), strict=True):
        cars = [car.id for car in scene.in_range()]
        assert np.isnan(value) if not cars else value >= 1
