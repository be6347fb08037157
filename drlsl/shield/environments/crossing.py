"""highway-env's crossings, intersection-v0 and roundabout-v0, with the rules of rules/envs/crossing.pl.

The facts are geometry: where on their ways the ego and another would come too near. When they are there is
for the rules to say.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, Final, TypeAlias

import gymnasium

from drlsl.errors import UserError
from drlsl.lowering import Relation, Schema
from drlsl.shield.environments.meta_actions import FALLBACK, meta_actions
from drlsl.shield.environments.ways import Sampled, Way, meetings
from drlsl.shield.fact_forms import Facts
from drlsl.shield.wrapper import LogicShield

RULES: Final = "envs/crossing.pl"

HORIZON: Final = 3.0
"""How far the rules look ahead [s]: three decisions, a second each."""

SIGHT: Final = 60.0
"""How far the ego sees [m]."""

SCHEMA: Final = Schema(
    [
        Relation("ego", ("float", "int", "atom"), single=True),
        Relation("speeds", ("float", "float", "float"), single=True),
        Relation("aim", ("atom", "int", "float"), capacity=8),
        Relation("line", ("int", "float", "float"), capacity=4),
        Relation("zone", ("int", "int", *("float",) * 7, "int", "atom"), capacity=64),
    ]
)
"""The facts of rules/envs/crossing.pl."""

Index: TypeAlias = tuple[str, str, int]
"""A lane of highway-env: the nodes from and to which it runs, and its number."""


def shield_crossing(env: gymnasium.Env[Any, Any], **settings: Any) -> LogicShield:
    """Return intersection-v0 or roundabout-v0 of highway-env behind a shield; `settings` are LogicShield's.

    Raises:
        UserError: the actions are others, or decisions are not a second apart.
    """
    actions = meta_actions(env, lateral=False)
    frequency = env.unwrapped.config["policy_frequency"]  # type: ignore[attr-defined]
    if frequency != 1:
        raise UserError(
            f"policy_frequency is {frequency}; expected 1: the rules look ahead three decisions of a second"
        )
    given = {"fallback": FALLBACK, **settings}
    return LogicShield(env, RULES, actions=actions, facts=crossing_facts, schema=SCHEMA, **given)


def crossing_facts(world: Any) -> Facts:
    """Return the facts of the present state of an environment of highway-env with crossing traffic."""
    ego, network, sampled = world.vehicle, world.road.network, Sampled(world.road.network)
    speeds = [float(one) for one in ego.target_speeds]
    others = {
        number: car
        for number, car in enumerate(world.road.vehicles)
        if car is not ego and math.dist(car.position, ego.position) <= SIGHT
    }
    aims = list(_aims(world))
    routes: dict[tuple[Index, ...], int] = {}
    for _, route, _ in aims:
        routes.setdefault(route, len(routes))
    own = aims[0][1]
    reach = max(float(ego.speed), speeds[-1]) * HORIZON
    ways = [Way.along(sampled, route, ego, reach) for route in routes]
    paths = [(number, way) for number, car in others.items() for way in _ways(sampled, car)]
    rank = min(network.get_lane(index).priority for index in own[:2])
    return {
        ("ego", 3): [(ego.speed, int(rank), _place(ego.lane_index))],
        ("speeds", 3): [(speeds[0], speeds[1] - speeds[0], speeds[-1])],
        ("aim", 3): [(action, routes[route], speed) for action, route, speed in aims],
        ("line", 3): [
            (way, *line) for route, way in routes.items() if (line := _line(network, route, ego)) is not None
        ],
        ("zone", 11): [
            (number, way, *zone, *_about(others[number], ego)) for way, number, zone in meetings(ways, paths)
        ],
    }


def _aims(world: Any) -> Iterator[tuple[str, tuple[Index, ...], float]]:
    """Yield the actions that do anything, each with its route and the speed that it steers for."""
    ego, network = world.vehicle, world.road.network
    speeds = [float(one) for one in ego.target_speeds]
    nearest = int(ego.speed_to_index(ego.speed))
    own = _route(network, ego, ego.target_lane_index)
    kept = min(speeds, key=lambda speed: abs(speed - ego.target_speed))
    yield "slower", own, speeds[max(nearest - 1, 0)]
    yield "idle", own, kept
    if nearest + 1 < len(speeds):
        yield "faster", own, speeds[nearest + 1]
    start, end, lane = ego.target_lane_index
    lanes = len(network.graph[start][end]) if world.action_type.lateral else 0
    for action, side in (("lane_left", lane - 1), ("lane_right", lane + 1)):
        if 0 <= side < lanes and network.get_lane((start, end, side)).is_reachable_from(ego.position):
            yield action, _route(network, ego, (start, end, side)), kept


def _speed(car: Any) -> float:
    return 0.0 if car.crashed else max(float(car.speed), 0.0)


def _top(car: Any) -> float:
    """Return the highest speed of another vehicle: its lane's limit, or its own if that is higher [m/s]."""
    return 0.0 if car.crashed else max(_speed(car), float(car.lane.speed_limit or 0.0))


def _ways(sampled: Sampled, car: Any) -> Iterator[Way]:
    """Yield every way that another vehicle may take, for its route is not to be seen."""
    along, _ = car.lane.local_coordinates(car.position)
    reach = _top(car) * HORIZON
    for route in _branches(sampled.network, car.lane_index, along, reach):
        yield Way.along(sampled, route, car, reach)


def _branches(network: Any, index: Index, along: float, reach: float) -> Iterator[tuple[Index, ...]]:
    """Yield every route from a place in a lane that goes `reach` far."""
    lane = network.get_lane(index)
    rest = reach - (lane.length - along)
    if rest < 0.0 or index[1] not in network.graph:
        yield (index,)
        return
    end = lane.position(lane.length, 0.0)
    for following in network.graph[index[1]]:
        number, _ = network.next_lane_given_next_road(*index, following, None, end)
        for route in _branches(network, (index[1], following, number), 0.0, rest):
            yield (index, *route)


def _route(network: Any, ego: Any, index: Index) -> tuple[Index, ...]:
    """Return the lanes of the ego's route from the lane `index` on."""
    route = [index]
    for start, end, number in ego.route or ():
        if start == route[-1][1]:
            lane = network.get_lane(route[-1])
            place = lane.position(lane.length, 0.0)
            number, _ = network.next_lane_given_next_road(*route[-1], end, number, place)
            route.append((start, end, number))
    return tuple(route)


def _line(network: Any, route: Sequence[Index], ego: Any) -> tuple[float, float] | None:
    """Return how far the ego is from where its front is past the line of a crossing, and from its end [m].

    None on a roundabout, which has no line, and behind the crossing.
    """
    place = -float(network.get_lane(route[0]).local_coordinates(ego.position)[0])
    for index in route:
        length = float(network.get_lane(index).length)
        if index[1].startswith("ir"):
            inside = next((network.get_lane(one).length for one in route if one[0] == index[1]), 0.0)
            return place + length - ego.LENGTH / 2, place + length + float(inside)
        if index[0].startswith("ir"):
            return place - ego.LENGTH / 2, place + length
        place += length
    return None


def _about(car: Any, ego: Any) -> tuple[float, float, int, str]:
    """Return speed, highest speed, priority and place of another vehicle."""
    return _speed(car), _top(car), int(car.lane.priority), _place_beside(car, ego)


def _place_beside(car: Any, ego: Any) -> str:
    """Return the place of another vehicle; in the ego's lane, behind it or beside it."""
    if car.lane_index != ego.lane_index:
        return _place(car.lane_index)
    ahead = ego.lane.local_coordinates(car.position)[0] - ego.lane.local_coordinates(ego.position)[0]
    return "behind" if ahead < 0.0 else "beside"


def _place(index: Index) -> str:
    """Return the place of a lane of highway-env's intersection or roundabout, by its nodes.

    It is approach, inside, exit of the intersection or ring_exit of the roundabout.

    Source: `IntersectionEnv._make_road`, `RoundaboutEnv._make_road`.
    """
    start, end, _ = index
    if end.startswith("ir") or start.endswith(("er", "es")):
        return "approach"
    if start.startswith("il"):
        return "exit"
    return "ring_exit" if start.endswith("xs") or end.endswith("xs") else "inside"
