"""highway-env's straight roads, highway-v0 and merge-v0, with the rules of rules/envs/straight_road.pl."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, Final

import gymnasium

from drlsl.lowering import Relation, Schema
from drlsl.shield.environments.meta_actions import FALLBACK, meta_actions
from drlsl.shield.fact_forms import Facts
from drlsl.shield.wrapper import LogicShield

RULES: Final = "envs/straight_road.pl"

SIGHT: Final = 100.0
"""How far along the road the ego sees [m]."""

_MOTION: Final = ("float",) * 6

ROAD_SCHEMA: Final = Schema(
    [
        Relation("ego", _MOTION, single=True),
        Relation("vehicle", ("int", *_MOTION, "float", "atom"), key=0, capacity=16),
        Relation("aim", ("atom", "float", "float"), key=0, first="idle", capacity=5),
        Relation("speeds", ("float", "float"), single=True),
        Relation("period", ("float", "float"), single=True),
    ]
)
"""The facts of rules/envs/straight_road.pl."""


def shield_straight_road(env: gymnasium.Env[Any, Any], **settings: Any) -> LogicShield:
    """Return an environment of highway-env behind a shield: highway-v0, highway-fast-v0, merge-v0.

    The road runs along x, and the actions are the five meta-actions. `settings` are those of `LogicShield`.

    Raises:
        UserError: the actions are others.
    """
    actions = meta_actions(env, lateral=True)
    given = {"fallback": FALLBACK, **settings}
    return LogicShield(env, RULES, actions=actions, facts=straight_road_facts, schema=ROAD_SCHEMA, **given)


def straight_road_facts(world: Any) -> Facts:
    """Return the facts of the present state of an environment of highway-env."""
    ego, road = world.vehicle, world.road
    period = 1.0 / world.config["policy_frequency"]
    here = ego.position.item(0)
    seen = [
        (number, thing)
        for number, thing in enumerate([*road.vehicles, *road.objects])
        if thing is not ego and abs(thing.position.item(0) - here) <= SIGHT
    ]
    speeds = ego.target_speeds.tolist()
    return {
        ("ego", 6): [_motion(ego)],
        ("vehicle", 9): [
            (number, *_motion(thing), _goal(road, thing), _sees(road, thing, ego)) for number, thing in seen
        ],
        ("aim", 3): list(_aims(ego, road.network)),
        ("speeds", 2): [(speeds[0], speeds[1] - speeds[0] if len(speeds) > 1 else 0.0)],
        ("period", 2): [(period, math.exp(-period / ego.TAU_ACC))],
    }


def _motion(thing: Any) -> tuple[float, ...]:
    """Return the place, velocity and size of a vehicle or an obstacle."""
    x, y = thing.position.tolist()
    speed, heading = float(thing.speed), float(thing.heading)
    return x, y, speed * math.cos(heading), speed * math.sin(heading), thing.LENGTH, thing.WIDTH


def _aims(ego: Any, network: Any) -> Iterator[tuple[str, float, float]]:
    """Yield each action that does anything, with the centre line [m] and the speed [m/s] that it steers for.

    Source: `MDPVehicle.act` and `ControlledVehicle.act`.
    """
    (start, end, lane), speeds = ego.target_lane_index, ego.target_speeds.tolist()
    nearest, target = int(ego.speed_to_index(ego.speed)), float(ego.target_speed)
    here = _centre(network, ego.target_lane_index, ego)
    yield "idle", here, target
    yield "slower", here, speeds[max(nearest - 1, 0)]
    if nearest + 1 < len(speeds):
        yield "faster", here, speeds[nearest + 1]
    for action, side in (("lane_left", lane - 1), ("lane_right", lane + 1)):
        index = (start, end, side)
        if 0 <= side < len(network.graph[start][end]) and network.get_lane(index).is_reachable_from(
            ego.position
        ):
            yield action, _centre(network, index, ego), target


def _centre(network: Any, index: Any, thing: Any) -> float:
    """Return y of a lane's centre line beside a vehicle."""
    lane = network.get_lane(index)
    along, _ = lane.local_coordinates(thing.position)
    return float(lane.position(along, 0.0)[1])


def _goal(road: Any, thing: Any) -> float:
    """Return y of the lane to which a vehicle must come over because its own ends, or its own y."""
    network, index = road.network, thing.lane_index
    if thing in road.objects:
        return float(thing.position[1])
    while network.get_lane(index).forbidden:
        start, end, lane = index
        if lane > 0:
            return _centre(network, (start, end, lane - 1), thing)
        if end not in network.graph:
            break
        place = network.get_lane(index).position(network.get_lane(index).length, 0.0)
        following, lanes = next(iter(network.graph[end].items()))
        nearest = min(range(len(lanes)), key=lambda number: lanes[number].distance(place))
        index = (end, following, nearest)
    return float(thing.position[1])


def _sees(road: Any, thing: Any, ego: Any) -> str:
    """Return no for a driver who does not see the ego, for it is on another segment of the road; else yes."""
    if thing in road.objects or road.neighbour_vehicles_connected_lanes:
        return "yes"
    return "yes" if thing.lane_index[:2] == ego.lane_index[:2] else "no"
