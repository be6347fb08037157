"""highway-env's crossings, intersection-v0 and roundabout-v0, with the rules of rules/envs/crossing.pl."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple, TypeAlias

import gymnasium

from drlsl.lowering import Relation, Schema
from drlsl.shield.environments.meta_actions import FALLBACK, meta_actions
from drlsl.shield.fact_forms import Facts
from drlsl.shield.wrapper import LogicShield

RULES: Final = "envs/crossing.pl"

STEP: Final = 0.4
STEPS: Final = 8
"""Time between two predicted places [s], and how many there are."""

SIGHT: Final = 60.0
"""How far the ego sees [m]."""

LAG: Final = 0.6
"""Time constant with which the ego's speed approaches its target [s]. Source: `ControlledVehicle.TAU_ACC`."""

SIDE_LAG: Final = 0.7
"""Time constant with which a vehicle approaches the centre line of its lane [s], about."""

SPEEDING_UP: Final = 0.5
SLOWING_DOWN: Final = 1.0
"""How others may change their speed [m/s²]."""

PLANS: Final = {"stop": (-1, -2, -3), "go": (1, 2, 3), "through": (1, 2, 1, 0, -1)}
"""What the ego does after an action: its speed at each later decision, counted from that of the action."""

_PLACE: Final = ("float",) * 4

SCHEMA: Final = Schema(
    [
        Relation("ego", ("float", "float", "float", "int", "atom"), single=True),
        Relation("car", ("int", "float", "float", "float", "int", "atom"), key=0, capacity=16),
        Relation("ego_path", ("atom", "atom", "int", *_PLACE, "float"), capacity=128),
        Relation("path", ("int", "int", "atom", "int", *_PLACE), capacity=1024),
    ]
)
"""The facts of rules/envs/crossing.pl."""

Index: TypeAlias = tuple[str, str, int]
"""A lane of highway-env: the nodes from and to which it runs, and its number."""


def shield_crossing(env: gymnasium.Env[Any, Any], **settings: Any) -> LogicShield:
    """Return intersection-v0 or roundabout-v0 of highway-env behind a shield; `settings` are LogicShield's.

    Raises:
        UserError: the actions are others.
    """
    actions = meta_actions(env, lateral=False)
    given = {"fallback": FALLBACK, **settings}
    return LogicShield(env, RULES, actions=actions, facts=crossing_facts, schema=SCHEMA, **given)


def crossing_facts(world: Any) -> Facts:
    """Return the facts of the present state of an environment of highway-env with crossing traffic."""
    ego, network = world.vehicle, world.road.network
    route = _route(network, ego, ego.target_lane_index)
    others = [
        (number, car)
        for number, car in enumerate(world.road.vehicles)
        if car is not ego and math.dist(car.position, ego.position) <= SIGHT
    ]
    rank = min(network.get_lane(index).priority for index in route[:2])
    return {
        ("ego", 5): [(ego.speed, ego.LENGTH, ego.WIDTH, int(rank), _place(ego.lane_index))],
        ("car", 6): [
            (number, car.speed, car.LENGTH, car.WIDTH, int(car.lane.priority), _place_beside(car, ego))
            for number, car in others
        ],
        ("ego_path", 8): list(_ego_paths(world, route)),
        ("path", 8): [row for number, car in others for row in _paths(network, number, car)],
    }


class _Point(NamedTuple):
    """A place on a route: x and y [m], and the direction as a unit vector."""

    x: float
    y: float
    right: float
    down: float


def _ego_paths(world: Any, route: Sequence[Index]) -> Iterator[tuple[Any, ...]]:
    """Yield action, plan, step and place of the ego, and how far its front is past the line of a crossing."""
    ego, network = world.vehicle, world.road.network
    speeds, period = [float(one) for one in ego.target_speeds], 1.0 / world.config["policy_frequency"]
    nearest = int(ego.speed_to_index(ego.speed))
    kept = min(range(len(speeds)), key=lambda number: abs(speeds[number] - ego.target_speed))
    ways = {"idle": (kept, route), "slower": (max(nearest - 1, 0), route)}
    if nearest + 1 < len(speeds):
        ways["faster"] = (nearest + 1, route)
    start, end, lane = ego.target_lane_index
    for action, side in (("lane_left", lane - 1), ("lane_right", lane + 1)):
        index = (start, end, side)
        lanes = len(network.graph[start][end]) if world.action_type.lateral else 0
        if 0 <= side < lanes and network.get_lane(index).is_reachable_from(ego.position):
            ways[action] = (kept, _route(network, ego, index))
    for action, (number, way) in ways.items():
        along, across = network.get_lane(way[0]).local_coordinates(ego.position)
        for plan, changes in PLANS.items():
            later = (min(max(number + change, 0), len(speeds) - 1) for change in changes)
            targets = [speeds[number], *(speeds[one] for one in later)]
            for step in range(1, STEPS + 1):
                s = along + _way(float(ego.speed), targets, period, step * STEP)
                point = _at(network, way, s, across * math.exp(-step * STEP / SIDE_LAG))
                yield (action, plan, step, *point, _past_line(network, way, s, ego.LENGTH))


def _way(speed: float, targets: Sequence[float], period: float, time: float) -> float:
    """Return how far the ego comes in `time` if it steers for each of the speeds for one period."""
    way = 0.0
    for number, target in enumerate(targets):
        lasts = min(period, time) if number < len(targets) - 1 else time
        rest = math.exp(-lasts / LAG)
        way += target * lasts + (speed - target) * LAG * (1.0 - rest)
        speed, time = target + (speed - target) * rest, time - lasts
    return way


def _paths(network: Any, number: int, car: Any) -> Iterator[tuple[Any, ...]]:
    """Yield car, branch, speed and step of every place where another vehicle may be.

    It may take any branch, for its route is not to be seen, and keep its speed, speed up or slow down.
    """
    along, across = car.lane.local_coordinates(car.position)
    speed = 0.0 if car.crashed else max(float(car.speed), 0.0)
    times = [step * STEP for step in range(1, STEPS + 1)]
    top = max(speed, car.lane.speed_limit or speed)
    ways = {"steady": [speed * time for time in times]}
    if not car.crashed:
        ways["speeding_up"] = [_changed(speed, top, SPEEDING_UP, time) for time in times]
        ways["slowing_down"] = [_changed(speed, 0.0, -SLOWING_DOWN, time) for time in times]
    for branch, route in enumerate(_branches(network, car.lane_index, along, _farthest(ways))):
        for manner, distances in ways.items():
            for step, (time, way) in enumerate(zip(times, distances, strict=True), start=1):
                point = _at(network, route, along + way, across * math.exp(-time / SIDE_LAG))
                yield (number, branch, manner, step, *point)


def _farthest(ways: dict[str, list[float]]) -> float:
    """Return the farthest that a vehicle may come [m]."""
    return max(distances[-1] for distances in ways.values())


def _changed(speed: float, last: float, acceleration: float, time: float) -> float:
    """Return how far a vehicle comes that changes its speed to `last`."""
    changes = min(time, (last - speed) / acceleration)
    return speed * changes + acceleration * changes * changes / 2 + last * (time - changes)


def _branches(network: Any, index: Index, along: float, reach: float) -> Iterator[list[Index]]:
    """Yield every route from a place in a lane that goes `reach` far."""
    lane = network.get_lane(index)
    rest = reach - (lane.length - along)
    if rest < 0.0 or index[1] not in network.graph:
        yield [index]
        return
    end = lane.position(lane.length, 0.0)
    for following in network.graph[index[1]]:
        number, _ = network.next_lane_given_next_road(*index, following, None, end)
        for route in _branches(network, (index[1], following, number), 0.0, rest):
            yield [index, *route]


def _route(network: Any, ego: Any, index: Index) -> list[Index]:
    """Return the lanes of the ego's route from the lane `index` on."""
    route = [index]
    for start, end, number in ego.route or ():
        if start == route[-1][1]:
            lane = network.get_lane(route[-1])
            place = lane.position(lane.length, 0.0)
            number, _ = network.next_lane_given_next_road(*route[-1], end, number, place)
            route.append((start, end, number))
    return route


def _at(network: Any, route: Sequence[Index], along: float, across: float) -> _Point:
    """Return the place on a route, counted from the beginning of its first lane."""
    index, along = _lane_at(network, route, along)
    lane = network.get_lane(index)
    x, y = lane.position(along, across)
    heading = lane.heading_at(along)
    return _Point(float(x), float(y), math.cos(heading), math.sin(heading))


def _lane_at(network: Any, route: Sequence[Index], along: float) -> tuple[Index, float]:
    for index in route[:-1]:
        length = network.get_lane(index).length
        if along <= length:
            return index, along
        along -= length
    return route[-1], along


def _past_line(network: Any, route: Sequence[Index], along: float, length: float) -> float:
    """Return how far the front is past the line while the vehicle has not left the crossing [m].

    Negative before the line; 0 behind the crossing, and where there is no line, as on a roundabout.
    """
    index, rest = _lane_at(network, route, along)
    if _place(index) == "approach" and index[1].startswith("ir"):
        return rest + length / 2 - float(network.get_lane(index).length)
    return rest + length / 2 if index[0].startswith("ir") else 0.0


def _place_beside(car: Any, ego: Any) -> str:
    """Return the place of another vehicle; own if it is in the ego's lane."""
    return "own" if car.lane_index == ego.lane_index else _place(car.lane_index)


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
