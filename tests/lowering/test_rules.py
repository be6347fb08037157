"""The rule programs that ship: every predicate answers the same in all tiers."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from drlsl.driving.scene import SCHEMA, Facts, Scene, road_facts, scene_facts
from drlsl.logic import Engine
from drlsl.lowering.frontend import Mode, Query, lower
from drlsl.lowering.ir import NotLowerable
from tests.lowering.tiers import Tiers
from tests.scenes import scenes, scenes_with_ends

RULES = Path(__file__).parents[2] / "rules"
PROGRAMS = ("highway.pl", "overtake_left.pl", "paper.pl", "merge.pl")


@cache
def engine(program: str) -> Engine:
    result = Engine()
    result.consult(RULES / program)
    return result


def predicates(program: str) -> list[tuple[str, int]]:
    """The predicates of a rule file that are no facts of a scene."""
    defined = engine(program).program.predicates.items()
    return [key for key, predicate in defined if key not in SCHEMA.relations and predicate.clauses]


MODES: tuple[Mode, ...] = ("first", "all")


def queries(program: str) -> list[Query]:
    """Questions of every kind about every predicate."""
    return [
        Query(name, arity, mode)
        for name, arity in predicates(program)
        for mode in (MODES if arity else ("holds",))
    ]


@cache
def tiers(program: str, query: Query) -> Tiers | None:
    try:
        return Tiers(engine(program), SCHEMA, query)
    except NotLowerable:
        return None


def facts(scene: Scene) -> Facts:
    return {**road_facts(scene.road), **scene_facts(scene)}


# asked with unbound arguments, their answers hold an unbound variable
NOT_LOWERED = {
    "highway.pl": {"nearest/3", "section_room/2", "section_view/3", "side_limit/3"},
    "overtake_left.pl": {
        *("nearest/3", "section_room/2", "section_view/3", "side_limit/3", "speed_on_the_right/2"),
    },
    "paper.pl": {"room/2"},
    "merge.pl": {"nearest/3", "offered/2", "section_room/2", "section_view/3", "side_limit/3"},
}


def scenes_for(program: str) -> st.SearchStrategy[Scene]:
    return scenes_with_ends() if program == "merge.pl" else scenes()


@pytest.mark.parametrize("program", PROGRAMS)
def test_every_predicate_can_be_lowered(program: str) -> None:
    refused = {str(query) for query in queries(program) if tiers(program, query) is None}
    assert refused == NOT_LOWERED[program]


@pytest.mark.parametrize("program", PROGRAMS)
@settings(deadline=None, max_examples=10, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_every_predicate_answers_the_same_in_all_tiers(program: str, data: st.DataObject) -> None:
    drawn = [facts(scene) for scene in data.draw(st.lists(scenes_for(program), min_size=1, max_size=3))]
    for query in queries(program):
        both = tiers(program, query)
        if both is not None:
            both.check(drawn)


DECISION = (
    Query("safe_actions", 1, "set"),
    Query("front_is_free", 0, "holds"),
    Query("longitudinal_velocity", 1, "first"),
    Query("state", 1, "first"),
    Query("entry_is_safe", 0, "holds"),
)


@pytest.mark.parametrize("program", PROGRAMS)
@settings(deadline=None, max_examples=60, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_what_driving_asks_is_decided_without_the_interpreter(program: str, data: st.DataObject) -> None:
    scene = data.draw(scenes_for(program))
    for query in DECISION:
        both = tiers(program, query)
        assert both is not None
        assert both.arrays
        assert both.check([facts(scene)]) == 1


@pytest.mark.parametrize(
    ("beside", "offered"), [(1, "right_lane_change"), (3, "left_lane_change"), (2, "both")]
)
def test_a_vehicle_on_one_side_bars_that_side_alone(beside: int, offered: str) -> None:
    lanes = [(n, "left_to_right", 3.5 * n, 3.5, 30.0) for n in (1, 2, 3)]
    other = ("a", beside, 1.0 if beside != 2 else 90.0, 3.5 * beside, 20.0, 0.0, 4.0, 2.0)
    scene: dict[tuple[str, int], list[tuple[Any, ...]]] = {
        **{key: [(1.0,)] for key, relation in SCHEMA.relations.items() if relation.single},
        ("vehicle", 8): [("ego", 2, 0.0, 7.0, 20.0, 0.0, 4.0, 2.0), other],
        ("road_lane", 5): lanes,
        ("lane_end", 2): [],
        ("target_lane", 1): [(2,)],
        ("radar_range", 1): [(100.0,)],
    }
    both = tiers("highway.pl", Query("safe_actions", 1, "set"))
    assert both is not None
    assert both.arrays
    assert both.check([scene, scene]) == 2
    wanted = ["left_lane_change", "right_lane_change"] if offered == "both" else [offered]
    assert both.scalar(scene)[0] == ["lane_keeping", *wanted]


def changed(text: str, old: str, new: str) -> Engine:
    assert old in text
    result = Engine()
    result.consult_text(text.replace(old, new))
    return result


def test_a_changed_rule_text_changes_both_tiers() -> None:
    text = (RULES / "paper.pl").read_text(encoding="utf-8")
    scene: dict[tuple[str, int], list[tuple[Any, ...]]] = {
        ("vehicle", 8): [
            ("ego", 1, 0.0, 2.0, 20.0, 0.0, 4.0, 2.0),
            ("a", 2, -9.0, 5.5, 20.0, 0.0, 4.0, 2.0),
        ],
        ("road_lane", 5): [(1, "left_to_right", 2.0, 3.5, 30.0), (2, "left_to_right", 5.5, 3.5, 30.0)],
        **{(name, 1): [(1.0,)] for (name, _), relation in SCHEMA.relations.items() if relation.single},
        ("lane_end", 2): [],
        ("target_lane", 1): [(1,)],
        ("radar_range", 1): [(50.0,)],
    }
    query = Query("safe_actions", 1, "all")
    for distance, offered in (("6.15", True), ("12.0", False)):
        tier = Tiers(
            changed(text, "critical_distance(6.15)", f"critical_distance({distance})"), SCHEMA, query
        )
        assert tier.check([scene]) == 1
        assert ("right_lane_change" in tier.scalar(scene)[0]) is offered


def test_facts_that_the_schema_does_not_have_are_refused() -> None:
    text = (RULES / "paper.pl").read_text(encoding="utf-8")
    other = changed(text, "critical_distance(6.15).", ":- dynamic(critical_distance/1).")
    with pytest.raises(NotLowerable, match="critical_distance/1 is dynamic"):
        lower(other, SCHEMA, [Query("entry_is_safe", 0, "holds")])
