"""highway-env's straight roads, highway-v0 and merge-v0, with the rules of rules/envs/straight_road.pl."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cache
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
    speeds = ego.target_speeds.tolist()
    return {
        ("ego", 6): [_motion(ego)],
        ("vehicle", 9): list(_seen(road, ego)),
        ("aim", 3): list(_aims(ego, speeds, road.network)),
        ("speeds", 2): [(speeds[0], speeds[1] - speeds[0] if len(speeds) > 1 else 0.0)],
        ("period", 2): [(period, math.exp(-period / ego.TAU_ACC))],
    }


def _motion(thing: Any) -> tuple[float, ...]:
    """Return the place, velocity and size of a vehicle or an obstacle."""
    x, y = thing.position.tolist()
    speed, heading = float(thing.speed), float(thing.heading)
    return x, y, speed * math.cos(heading), speed * math.sin(heading), thing.LENGTH, thing.WIDTH


def _seen(road: Any, ego: Any) -> Iterator[tuple[Any, ...]]:
    """Yield what the ego sees: number, motion and size, the y it comes over to, whether it sees the ego."""
    here, vehicles, all_see = ego.position.item(0), road.vehicles, road.neighbour_vehicles_connected_lanes
    for number, car in enumerate(vehicles):
        if abs(car.position.item(0) - here) <= SIGHT and car is not ego:
            sees = "yes" if all_see or car.lane_index[:2] == ego.lane_index[:2] else "no"
            yield number, *_motion(car), _goal(road.network, car), sees
    for number, thing in enumerate(road.objects, len(vehicles)):
        if abs(thing.position.item(0) - here) <= SIGHT:
            yield number, *_motion(thing), thing.position.item(1), "yes"


def _aims(ego: Any, speeds: Sequence[float], network: Any) -> Iterator[tuple[str, float, float]]:
    """Yield each action that does anything, with the centre line [m] and the speed [m/s] that it steers for.

    Source: `MDPVehicle.act`, `MDPVehicle.speed_to_index` and `ControlledVehicle.act`.
    """
    (start, end, lane), target = ego.target_lane_index, float(ego.target_speed)
    most = len(speeds) - 1
    part = (float(ego.speed) - speeds[0]) / (speeds[-1] - speeds[0]) if most else 0.0
    nearest = min(max(round(part * most), 0), most)
    here = _centre(network.get_lane(ego.target_lane_index), ego)
    yield "idle", here, target
    yield "slower", here, speeds[max(nearest - 1, 0)]
    if nearest < most:
        yield "faster", here, speeds[nearest + 1]
    lanes = network.graph[start][end]
    for action, side in (("lane_left", lane - 1), ("lane_right", lane + 1)):
        if 0 <= side < len(lanes) and lanes[side].is_reachable_from(ego.position):
            yield action, _centre(lanes[side], ego), target


def _centre(lane: Any, car: Any) -> float:
    """Return y of a lane's centre line beside a vehicle."""
    if type(lane) is _straight_lane() and lane.direction.item(1) == 0.0:
        return float(lane.start.item(1))
    along, _ = lane.local_coordinates(car.position)
    return float(lane.position(along, 0.0)[1])


@cache
def _straight_lane() -> Any:
    """Return the class of straight lanes; its package is there wherever there is one."""
    from highway_env.road.lane import StraightLane

    return StraightLane


def _goal(network: Any, car: Any) -> float:
    """Return y of the lane to which a vehicle must come over because its own ends, or its own y."""
    index = car.lane_index
    while network.get_lane(index).forbidden:
        start, end, lane = index
        if lane > 0:
            return _centre(network.get_lane((start, end, lane - 1)), car)
        if end not in network.graph:
            break
        place = network.get_lane(index).position(network.get_lane(index).length, 0.0)
        following, lanes = next(iter(network.graph[end].items()))
        nearest = min(range(len(lanes)), key=lambda number: lanes[number].distance(place))
        index = (end, following, nearest)
    return float(car.position[1])
