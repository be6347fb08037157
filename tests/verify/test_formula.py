"""The formulas against the other back ends: the same program, the same scene, the same answer."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from drlsl.driving.scene import SCHEMA, Facts, Road, Scene, Vehicle, road_facts, scene_facts
from drlsl.driving.shield import default_rules
from drlsl.logic import Engine
from drlsl.logic.terms import Atom
from drlsl.lowering.backends import Scalar, compile_scalar
from drlsl.lowering.frontend import Lowered, Query, lower
from drlsl.traffic import Direction, Lane
from drlsl.verify import RANGES, Case
from drlsl.verify.smt import Algebra, Bool, Formula, Row, Solver, SymbolicScene

QUESTIONS = {
    "left": "safe_actions(left_lane_change)",
    "right": "safe_actions(right_lane_change)",
    "front": "front_is_free",
    "entry": "entry_is_safe",
    "slow": "longitudinal_velocity(V), V < 20.0",
    "braking": "longitudinal_velocity(V), vehicle(ego, _, _, _, Vx, _, _, _), V < abs(Vx)",
    "near": "state([Front|_]), Front < 0.3",
    "first": "once(( vehicle(Id, _, X, _, _, _, _, _), X > 5.0 )), Id == v2",
    "place": "state([_, _, _, _, _, _, _, _, Place, _]), Place > 0.4",
}


def eighths(low: int, high: int) -> st.SearchStrategy[float]:
    """Numbers that floats and rational arithmetic add and multiply alike."""
    return st.integers(low * 8, high * 8).map(lambda number: number / 8)


@st.composite
def exact_scenes(draw: st.DrawFn) -> Scene:
    """A scene of numbers in eighths."""
    ways = draw(st.sampled_from([(0, 2), (0, 3), (2, 0), (1, 2), (2, 2)]))
    lanes = tuple(
        Lane(
            number,
            Direction.RIGHT_TO_LEFT if number <= ways[0] else Direction.LEFT_TO_RIGHT,
            4.0 * number,
            4.0,
            draw(eighths(10, 40)),
        )
        for number in range(1, sum(ways) + 1)
    )
    road = Road(lanes, 0.125, 100.0, 3.0, 8.0, 0.4)
    own = draw(st.sampled_from(lanes))

    def vehicle(name: str, y: float, speed: float) -> Vehicle:
        x = 0.0 if name == "ego" else draw(eighths(-60, 60))
        return Vehicle(
            name, road.lane_at(y), x, y, speed, draw(eighths(-2, 2)), draw(eighths(3, 8)), draw(eighths(1, 3))
        )

    ego = vehicle(
        "ego", own.centre + draw(st.sampled_from([0.0, 0.25, 1.0])), own.direction.sign * draw(eighths(0, 40))
    )
    others = tuple(
        vehicle(f"v{number}", draw(eighths(2, 4 * sum(ways) + 2)), draw(eighths(-40, 40)))
        for number in range(draw(st.integers(0, 3)))
    )
    target = draw(st.sampled_from([lane for lane in lanes if lane.direction is own.direction]))
    return Scene(road, ego, others, draw(st.sampled_from([own.id, target.id])))


def rows(algebra: Algebra, facts: Facts) -> dict[tuple[str, int], list[Row]]:
    """Facts as rows whose every number is known."""
    true = algebra.booleans.true
    result = {}
    for key, relation in SCHEMA.relations.items():
        result[key] = [
            Row(
                true,
                tuple(
                    {Atom(str(value)): true}
                    if kind == "atom"
                    else {int(value): true}
                    if kind == "int"
                    else algebra.ring.const(Fraction(str(value)))
                    for kind, value in zip(relation.columns, row, strict=True)
                ),
            )
            for row in facts[key]
        ]
    return result


def load(name: str) -> tuple[Lowered, Scalar]:
    engine = Engine()
    engine.consult(default_rules()[0].parent / name)
    engine.consult_text("".join(f"ask_{name} :- {goal}.\n" for name, goal in QUESTIONS.items()), "questions")
    lowered = lower(engine, SCHEMA, [Query(f"ask_{name}", 0, "holds") for name in QUESTIONS])
    return lowered, compile_scalar(lowered)


PROGRAMS = {name: load(name) for name in ("highway.pl", "paper.pl")}


def truth_of(algebra: Algebra, scene: SymbolicScene, truth: Bool) -> bool:
    """Whether a formula without open numbers is true; definitions of roots are left to the solver."""
    solver = Solver(scene, linear=False)
    possible = solver.holds_nowhere(truth, 20.0).verdict != "none"
    deniable = solver.holds_nowhere(algebra.booleans.not_(truth), 20.0).verdict != "none"
    assert possible != deniable
    return possible


@pytest.mark.parametrize("name", PROGRAMS)
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(scene=exact_scenes())
def test_formulas_say_what_generated_code_says(name: str, scene: Scene) -> None:
    lowered, scalar = PROGRAMS[name]
    facts = {**road_facts(scene.road), **scene_facts(scene)}
    expected = scalar(facts)
    algebra = Algebra()
    formula = Formula(algebra, rows(algebra, facts))
    frame = SymbolicScene(algebra, Case(0, 1, 1, 1), RANGES, 0)
    for question, answer, wanted in zip(QUESTIONS, lowered.answers, expected, strict=True):
        truth = formula.truth(answer.found)
        if truth.op not in ("true", "false"):
            assert truth_of(algebra, frame, truth) == wanted, question
        else:
            assert (truth.op == "true") == wanted, question
