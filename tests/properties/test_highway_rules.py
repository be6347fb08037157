"""Every predicate of highway.pl equals a predicate written by hand, on generated scenes."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings

from drlsl.driving.scene import Scene, Vehicle
from drlsl.driving.shield import Shield
from tests.properties.oracle import SECTIONS, Oracle, critical_distance
from tests.scenes import scenes, scenes_with_one_catching_up, scenes_with_one_coming_fast

MANY = settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])


@pytest.fixture(scope="module")
def shield() -> Shield:
    return Shield.default()


@pytest.fixture(scope="module")
def every_tier() -> list[Shield]:
    return [Shield.default(tier=tier) for tier in ("interpreter", "scalar", "numpy", "numba")]


def ask(shield: Shield, scene: Scene, goal: str) -> list[dict[str, object]]:
    shield.state_facts(scene)
    return [dict(solution) for solution in shield.engine.query(goal)]


def cars(found: list[dict[str, object]]) -> list[object]:
    return [solution["Car"] for solution in found]


@MANY
@given(scene=scenes())
def test_decision(shield: Shield, scene: Scene) -> None:
    oracle, decision = Oracle(scene), shield.decide(scene)
    assert [action.atom for action in decision.safe_actions] == oracle.actions()
    assert decision.target_speed == oracle.target_speed()
    assert dict(zip(shield.observation.names, decision.observation, strict=True)) == oracle.observation()
    assert decision.front_is_free == (not oracle.busy("front"))
    assert decision.lane_to_keep == oracle.lane_to_keep()
    assert decision.comfortable_acceleration == oracle.comfortable_acceleration()
    assert shield.entry_is_safe(scene) == oracle.is_safe("entry")
    assert any(decision.action_mask)


@MANY
@given(scene=scenes())
def test_sections(shield: Shield, scene: Scene) -> None:
    oracle = Oracle(scene)
    for name in SECTIONS:
        busy = oracle.busy(name)
        assert bool(ask(shield, scene, f"{name}_is_busy")) == busy
        assert bool(ask(shield, scene, f"{name}_is_free")) != busy
        assert cars(ask(shield, scene, f"busy_section({name}, Car, Gap)")) == [
            car.id for car in oracle.section(name)
        ]
        nearest = min(oracle.section(name), key=oracle.gap, default=None)
        assert cars(ask(shield, scene, f"nearest({name}, Car, Gap)")) == ([nearest.id] if nearest else [])


@MANY
@given(scene=scenes())
def test_sides(shield: Shield, scene: Scene) -> None:
    oracle = Oracle(scene)
    for side in ("left", "right"):
        for reason, holds in (
            ("changing_lanes", not oracle.settled),
            ("no_lane", not oracle.is_valid(side)),
            ("too_close(_, _, _)", not oracle.is_safe(side)),
        ):
            assert bool(ask(shield, scene, f"objection({side}_lane_change, {reason})")) == holds
        lane = oracle.side_lane(side)
        assert ask(shield, scene, f"side_lane({side}, Lane)") == ([{"Lane": lane.id}] if lane else [])
    for side in ("own", "home", "entry", "left", "right"):
        found = ask(shield, scene, f"obstacle({side}, Car, Gap, Needed)")
        assert [(row["Car"], row["Gap"], row["Needed"]) for row in found] == [
            (car.id, oracle.gap(car), oracle.needed_gap(car)) for car in oracle.obstacles(side)
        ]
        assert bool(ask(shield, scene, f"beside({side}, Car)")) == oracle.beside(side)
        assert bool(ask(shield, scene, f"catches_up({side}, Car)")) == oracle.catches_up(side)
    assert bool(ask(shield, scene, "settled")) == oracle.settled


@MANY
@given(scene=scenes())
def test_reading_of_the_facts(shield: Shield, scene: Scene) -> None:
    oracle = Oracle(scene)
    assert cars(ask(shield, scene, "target_vehicle(Car)")) == [car.id for car in oracle.targets()]
    assert ask(shield, scene, "direction(ego, D)") == [{"D": oracle.lane.direction.value}]
    assert ask(shield, scene, "ego_heading(S)") == [{"S": oracle.sign}]
    assert ask(shield, scene, "speed_limit(V)") == [{"V": oracle.lane.speed_limit}]
    for car in (scene.ego, *scene.in_range()):
        assert ask(shield, scene, f"lane({car.id}, L), position_x({car.id}, X), position_y({car.id}, Y)") == [
            {"L": car.lane, "X": car.x, "Y": car.y}
        ]
        assert ask(shield, scene, f"speed({car.id}, V)") == [{"V": oracle.speed(car)}]
        assert ask(shield, scene, f"offset({car.id}, S), gap({car.id}, G)") == [
            {"S": oracle.offset(car), "G": oracle.gap(car)}
        ]
    for car in oracle.targets():
        (found,) = ask(shield, scene, f"speed(ego, V1), speed({car.id}, V2), critical_distance(V1, V2, C)")
        assert found["C"] == critical_distance(oracle.speed(scene.ego), oracle.speed(car))


@MANY
@given(scene=scenes_with_one_coming_fast())
def test_actions_where_few_distances_forbid_one(shield: Shield, scene: Scene) -> None:
    """Where lane changes are mostly offered, a reason too many shows."""
    assert [action.atom for action in shield.decide(scene).safe_actions] == Oracle(scene).actions()


@MANY
@given(scene=scenes_with_one_catching_up())
def test_a_lane_change_is_given_up_for_a_follower_that_catches_up(
    every_tier: list[Shield], scene: Scene
) -> None:
    expected = Oracle(scene).lane_to_keep()
    assert [shield.decide(scene).lane_to_keep for shield in every_tier] == [expected] * len(every_tier)


@MANY
@given(scene=scenes())
def test_an_action_is_offered_exactly_when_nothing_speaks_against_it(shield: Shield, scene: Scene) -> None:
    offered = {action.atom for action in shield.decide(scene).safe_actions}
    opposed = {row["A"] for row in ask(shield, scene, "objection(A, _)")}
    assert offered.isdisjoint(opposed)
    assert offered | opposed == {"lane_keeping", "left_lane_change", "right_lane_change"}


def mirrored(scene: Scene) -> Scene:
    """The scene turned by half a turn: every direction, place and velocity the other way."""

    def turned(car: Vehicle) -> Vehicle:
        return car._replace(x=-car.x, y=-car.y, vx=-car.vx, vy=-car.vy)

    from dataclasses import replace

    from drlsl.traffic import Direction

    other = {
        Direction.LEFT_TO_RIGHT: Direction.RIGHT_TO_LEFT,
        Direction.RIGHT_TO_LEFT: Direction.LEFT_TO_RIGHT,
    }
    lanes = tuple(
        replace(lane, centre=-lane.centre, direction=other[lane.direction]) for lane in scene.road.lanes
    )
    return replace(
        scene,
        road=replace(scene.road, lanes=lanes),
        ego=turned(scene.ego),
        vehicles=tuple(turned(car) for car in scene.vehicles),
    )


@MANY
@given(scene=scenes())
def test_half_a_turn_changes_nothing(shield: Shield, scene: Scene) -> None:
    assert shield.decide(mirrored(scene)) == shield.decide(scene)
