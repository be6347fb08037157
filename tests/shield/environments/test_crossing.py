"""rules/envs/crossing.pl on ways made up, against the exact overlap of rectangles in small steps."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
import pytest

from drlsl.errors import UserError
from drlsl.logic import Engine
from drlsl.shield import ActionRules, Facts, consult_rules
from drlsl.shield.environments import shield_crossing
from drlsl.shield.environments.crossing import HORIZON, RULES, SCHEMA
from drlsl.shield.environments.meta_actions import FALLBACK
from drlsl.shield.environments.ways import GRID, ROOM_ACROSS, ROOM_ALONG, Way, meetings, zones
from drlsl.traffic import Floats

ACTIONS = ("slower", "idle", "faster")

SPEEDS = (0.0, 4.5, 9.0)
PLANS = {"stop": (0, -1, -2), "go": (0, 1, 2)}
LENGTH, WIDTH = 5.0, 2.0
LAG = 0.6


@dataclass
class Straight:
    """A vehicle on a straight way."""

    x: float
    y: float
    heading: float
    speed: float = 0.0

    def way(self, reach: float) -> Way:
        places: Floats = np.arange(math.ceil(reach / GRID) + 2, dtype=np.float64) * GRID
        right, down = math.cos(self.heading), math.sin(self.heading)
        same = np.ones(len(places))
        return Way(self.x + places * right, self.y + places * down, same * right, same * down, LENGTH, WIDTH)

    def corners(self, way: float) -> list[tuple[float, float]]:
        right, down = math.cos(self.heading), math.sin(self.heading)
        x, y = self.x + way * right, self.y + way * down
        return [
            (x + a * right - b * down, y + a * down + b * right)
            for a in (-LENGTH / 2, LENGTH / 2)
            for b in (-WIDTH / 2, WIDTH / 2)
        ]


def overlap(one: list[tuple[float, float]], other: list[tuple[float, float]]) -> bool:
    """Whether two rectangles overlap: no line along a side of either separates them."""
    for corners in (one, other):
        for first, second in ((0, 1), (0, 2)):
            dx, dy = (corners[second][axis] - corners[first][axis] for axis in (0, 1))
            spans = [[x * dx + y * dy for x, y in box] for box in (one, other)]
            if max(spans[0]) < min(spans[1]) or max(spans[1]) < min(spans[0]):
                return False
    return True


def drive(speed: float, targets: list[float], until: float) -> Iterator[tuple[float, float]]:
    """Yield time and way of an ego that steers for each of the speeds for a second, in steps of 5 ms."""
    step, way, time = 0.005, 0.0, 0.0
    yield time, way
    while time < until:
        target = targets[min(int(time + 1e-9), len(targets) - 1)]
        way += speed * step
        speed += (target - speed) / LAG * step
        time += step
        yield time, way


def rules(ask: str = "offered(Action)", tier: str = "scalar", text: str = RULES) -> ActionRules:
    return ActionRules(text, ACTIONS, fallback=FALLBACK, tier=tier, schema=SCHEMA, ask=ask)


CLEAR = ":- ensure_loaded('envs/crossing.pl').\n" + "".join(
    f"clear_{plan}(Action) :- clear(Action, {plan}).\n" for plan in PLANS
)


@dataclass
class Crossing:
    """An ego before the road that it crosses, and others that come to where it will be."""

    ego: Straight
    line: float
    cars: list[tuple[Straight, float, int, str]]

    def facts(self) -> Facts:
        reach = 9.0 * HORIZON
        paths = [(number, car.way(top * HORIZON)) for number, (car, top, _, _) in enumerate(self.cars)]
        about = [(car.speed, top, rank, place) for car, top, rank, place in self.cars]
        found = meetings([self.ego.way(reach)], paths)
        return {
            ("ego", 3): [(self.ego.speed, 1, "approach")],
            ("speeds", 3): [(0.0, 4.5, 9.0)],
            ("aim", 3): [(action, 0, speed) for action, speed in zip(ACTIONS, SPEEDS, strict=True)],
            ("line", 3): [(0, self.line, self.line + 20.0)],
            ("zone", 11): [(car, way, *zone, *about[car]) for way, car, zone in found],
        }

    def touches(self, action: str, plan: str) -> bool:
        """Whether the ego overlaps at any time one that keeps its speed, or speeds up by 0.5 m/s2."""
        number = ACTIONS.index(action)
        targets = [SPEEDS[min(max(number + change, 0), 2)] for change in PLANS[plan]]
        for time, way in list(drive(self.ego.speed, targets, HORIZON))[::4]:
            body = self.ego.corners(way)
            for car, top, _, _ in self.cars:
                steady = car.speed * time
                faster = min(car.speed * time + 0.25 * time * time, top * time)
                if any(overlap(body, car.corners(one)) for one in (steady, faster)):
                    return True
        return False


def crossings(count: int = 120) -> Iterator[Crossing]:
    rng = np.random.default_rng(0)
    for number in range(count):
        cars = []
        for _ in range(1 + number % 2):
            heading, speed = rng.uniform(-math.pi, math.pi), rng.uniform(0, 12)
            before = speed * rng.uniform(0, 3)
            x, y = (
                rng.uniform(-4, 4) - before * math.cos(heading),
                rng.uniform(0, 25) - before * math.sin(heading),
            )
            place = str(rng.choice(["approach", "inside", "exit"]))
            cars.append((Straight(x, y, heading, speed), max(speed, 10.0), int(rng.integers(3)), place))
        ego = Straight(0.0, 30.0, -math.pi / 2, float(rng.choice([0.0, 4.5, 9.0])))
        yield Crossing(ego, float(rng.choice([2.0, 12.0, 30.0])), cars)


def test_zones_cover_every_pair_of_places_at_which_two_vehicles_overlap() -> None:
    rng = np.random.default_rng(1)
    overlapping = 0
    for crossing in crossings(60):
        car = crossing.cars[0][0]
        found = list(zones(crossing.ego.way(27.0), car.way(30.0)))
        for one, other in zip(rng.uniform(0, 27, 200), rng.uniform(0, 30, 200), strict=True):
            if overlap(crossing.ego.corners(one), car.corners(other)):
                overlapping += 1
                assert any(z.from_1 <= one <= z.to_1 and z.from_2 <= other <= z.to_2 for z in found)
    assert overlapping > 500


def test_zones_are_no_wider_than_needed() -> None:
    """Two vehicles that cross at right angles: bodies, rooms and a grid on each side."""
    (zone,) = zones(Straight(0.0, 20.0, -math.pi / 2).way(27.0), Straight(-20.0, 0.0, 0.0).way(40.0))
    half = (LENGTH + WIDTH) / 2
    assert 20.0 - half - ROOM_ALONG - 2 * GRID <= zone.from_1 <= 20.0 - half
    assert 20.0 + half <= zone.to_1 <= 20.0 + half + ROOM_ALONG + 2 * GRID
    assert 20.0 - half - ROOM_ACROSS - 2 * GRID <= zone.from_2 <= 20.0 - half
    assert abs(zone.alike) < 1e-9


@pytest.mark.parametrize("plan", PLANS)
def test_a_clear_plan_touches_nobody_at_any_time(plan: str) -> None:
    clear = rules(f"clear_{plan}(Action)", text=CLEAR)
    counted: Counter[bool] = Counter()
    for crossing in crossings():
        offer = clear.offer(crossing.facts())
        found = () if offer.failure else offer.actions
        for action in ACTIONS:
            counted[action in found] += 1
            if action in found:
                assert not crossing.touches(action, plan), (crossing, action)
    assert counted[True] > 60
    assert counted[False] > 60


def test_what_is_offered_is_safe_if_anything_is() -> None:
    safe, offered = rules("safe(Action)"), rules()
    some = 0
    for crossing in crossings():
        answer, given = safe.offer(crossing.facts()), offered.offer(crossing.facts())
        assert not given.failure
        if not answer.failure:
            some += 1
            assert set(given.actions) <= set(answer.actions)
    assert some > 30


def standing(
    *, place: str = "approach", priority: int = 0, speed: float = 9.0, start: float = -39.0
) -> Facts:
    """An ego at 9 m/s, 30 m before a crossing, and a car that crosses there a moment after the ego would."""
    ego = Straight(0.0, 18.0, -math.pi / 2, 9.0)
    return Crossing(ego, 12.0, [(Straight(start, 0.0, 0.0, speed), speed, priority, place)]).facts()


def test_the_ego_gives_way_to_who_has_it() -> None:
    """The ego would be through before the car, which would have to brake behind it."""
    clear = rules("clear_go(Action)", text=CLEAR)
    free = [
        start
        for start in np.arange(-80.0, 0.0, 0.5)
        if "faster" in clear.offer(standing(start=start)).actions
    ]
    for place, priority in (("inside", 0), ("approach", 2)):
        offers = {start: clear.offer(standing(start=start, place=place, priority=priority)) for start in free}
        held = [start for start, offer in offers.items() if "faster" not in offer.actions]
        assert 8 <= len(held) <= 10  # half a second at 9 m/s, in steps of half a metre


def test_the_share_of_a_difference_that_is_left_is_exponential() -> None:
    engine = Engine()
    consult_rules(engine, RULES)
    left = {solution["N"]: solution["F"] for solution in engine.query("left(N, F)")}
    assert left == pytest.approx({quarter: math.exp(-quarter / 4 / LAG) for quarter in range(5)}, abs=1e-9)


def test_the_interpreter_offers_the_same() -> None:
    scalar, interpreter = rules(), rules(tier="interpreter")
    for crossing in list(crossings())[:3]:
        assert set(interpreter.offer(crossing.facts()).actions) == set(scalar.offer(crossing.facts()).actions)
    assert interpreter.counts.fail_safes == 0


def test_an_environment_with_other_actions_is_refused() -> None:
    with pytest.raises(UserError, match=r"expected an environment of highway-env"):
        shield_crossing(gymnasium.make("CartPole-v1"))


def test_decisions_must_be_a_second_apart() -> None:
    class Crossroads(gymnasium.Env[Any, Any]):
        action_space = gymnasium.spaces.Discrete(3)
        config = {"policy_frequency": 2}  # noqa: RUF012

        class action_type:
            actions_indexes = {"SLOWER": 0, "IDLE": 1, "FASTER": 2}  # noqa: RUF012

    with pytest.raises(UserError, match="policy_frequency is 2; expected 1"):
        shield_crossing(Crossroads())
