"""rules/envs/straight_road.pl against predicates written by hand, on facts made up."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from typing import Any

import gymnasium
import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from drlsl.errors import UserError
from drlsl.shield import ActionRules, Facts
from drlsl.shield.environments import shield_straight_road
from drlsl.shield.environments.meta_actions import FALLBACK
from drlsl.shield.environments.straight_road import ROAD_SCHEMA, RULES
from tests.shield.environments.oracle import LAG, World, braked, steered

ACTIONS = ("lane_left", "idle", "lane_right", "faster", "slower")
TIERS = ("scalar", "interpreter", "numpy", "numba")


def rules(tier: str) -> ActionRules:
    return ActionRules(RULES, ACTIONS, fallback=FALLBACK, tier=tier, schema=ROAD_SCHEMA)


SCALAR = rules("scalar")


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False, width=32)


@st.composite
def states(draw: st.DrawFn, most: int = 4) -> Facts:
    """Facts of a road with lanes 4 m apart, on which most vehicles are where they matter."""
    lane, lanes = draw(st.integers(0, 3)), 4
    here = 4.0 * lane
    ego = (
        draw(numbers(0, 500)),
        here + draw(numbers(-2, 2)),
        draw(numbers(15, 32)),
        draw(numbers(-3, 3)),
        5.0,
        2.0,
    )
    vehicles = []
    for number in range(draw(st.integers(0, most))):
        y = 4.0 * draw(st.integers(0, lanes - 1)) + draw(numbers(-1, 1))
        goal = draw(st.sampled_from([y, y, y, here, here + 4.0]))
        away = draw(st.one_of(numbers(-40, 60), numbers(-100, 100)))
        size = (draw(st.sampled_from([5.0, 2.0, 15.0])), 2.0)
        sees = draw(st.sampled_from(["yes", "yes", "no"]))
        vehicles.append(
            (number, ego[0] + away, y, draw(numbers(0, 35)), draw(numbers(-2, 2)), *size, goal, sees)
        )
    step = draw(st.sampled_from([5.0, 2.5]))
    speeds = [20.0, 20.0 + step, 20.0 + 2 * step]
    aimed = draw(st.sampled_from(speeds))
    nearest = min(range(3), key=lambda index: abs(speeds[index] - ego[2]))
    aims: list[tuple[str, float, float]] = [
        ("idle", here, aimed),
        ("slower", here, speeds[max(nearest - 1, 0)]),
    ]
    aims += [("faster", here, speeds[nearest + 1])] if nearest < 2 else []
    aims += [("lane_left", here - 4.0, aimed)] if lane > 0 else []
    aims += [("lane_right", here + 4.0, aimed)] if lane < lanes - 1 else []
    period = draw(st.sampled_from([1.0, 0.5]))
    return {
        ("ego", 6): [ego],
        ("vehicle", 9): vehicles,
        ("aim", 3): aims,
        ("speeds", 2): [(20.0, step)],
        ("period", 2): [(period, math.exp(-period / LAG))],
    }


def alone(gap: float, *, lane: float = 0.0, speed: float = 25.0, other: float = 25.0) -> dict[Any, Any]:
    """Facts of an ego in the middle lane of three, with one vehicle ahead."""
    return {
        ("ego", 6): [(0.0, 4.0, speed, 0.0, 5.0, 2.0)],
        ("vehicle", 9): [(1, gap + 5.0, 4.0 + lane, other, 0.0, 5.0, 2.0, 4.0 + lane, "yes")],
        ("aim", 3): [
            ("idle", 4.0, speed),
            ("slower", 4.0, 20.0),
            ("faster", 4.0, 30.0),
            ("lane_left", 0.0, speed),
            ("lane_right", 8.0, speed),
        ],
        ("speeds", 2): [(20.0, 5.0)],
        ("period", 2): [(1.0, math.exp(-1.0 / LAG))],
    }


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(states())
@example(alone(1.0, other=0.0))
def test_the_rules_offer_what_the_oracle_offers(facts: Facts) -> None:
    offer = SCALAR.offer(facts)
    assert not offer.failure
    assert set(offer.actions) == World(facts).offered()


def jams() -> Iterator[Facts]:
    """Facts of many states in which the ego is close to one or two vehicles."""
    rng = np.random.default_rng(0)
    for number in range(6000):
        speed, lane = rng.uniform(17, 32), int(rng.integers(3))
        here = 4.0 * lane
        ego = (0.0, here + rng.choice([0.0, rng.uniform(-3, 3)]), speed, 0.0, 5.0, 2.0)
        cars = []
        for car in range(1 + number % 2):
            y = here + 4.0 * float(rng.integers(-1, 2)) + rng.uniform(-2, 2)
            goal = y + rng.choice([0.0, 0.0, -4.0, 4.0])
            away = rng.choice([-1.0, 1.0, 1.0]) * rng.choice([rng.uniform(0, 12), rng.uniform(5, 60)])
            motion = (max(0.0, speed + rng.uniform(-15, 12)), rng.choice([0.0, rng.uniform(-2, 2)]))
            cars.append((car, away, y, *motion, 5.0, 2.0, goal, str(rng.choice(["yes", "yes", "no"]))))
        nearest = min(range(3), key=lambda index: abs(20.0 + 5.0 * index - speed))
        aim = 20.0 + 5.0 * float(rng.integers(3))
        aims = [("idle", here, aim), ("slower", here, 20.0 + 5.0 * max(nearest - 1, 0))]
        aims += [("faster", here, 25.0 + 5.0 * nearest)] if nearest < 2 else []
        aims += [("lane_left", here - 4.0, aim), ("lane_right", here + 4.0, aim)][lane < 1 : 3 - (lane > 1)]
        yield {
            ("ego", 6): [ego],
            ("vehicle", 9): cars,
            ("aim", 3): aims,
            ("speeds", 2): [(20.0, 5.0)],
            ("period", 2): [(1.0, math.exp(-1.0 / LAG))],
        }


def test_each_layer_of_the_rules_is_that_of_the_oracle() -> None:
    """The actions without danger, the good ones and the ways out, in states where they matter."""
    asked = {
        goal: ActionRules(
            RULES, ACTIONS, fallback=FALLBACK, tier="scalar", schema=ROAD_SCHEMA, ask=f"{goal}(Action)"
        )
        for goal in ("safe", "good", "way_out", "offered")
    }
    counted: Counter[tuple[str, int]] = Counter()
    for facts in jams():
        world = World(facts)
        expected = {
            "safe": world.safe(),
            "good": world.good(),
            "way_out": world.ways_out(),
            "offered": world.offered(),
        }
        for goal, answer in expected.items():
            offer = asked[goal].offer(facts)
            assert (set() if offer.failure else set(offer.actions)) == answer, goal
            counted[goal, len(answer)] += 1
    assert min(counted["way_out", 1], counted["good", 0], counted["safe", 0], counted["good", 2]) > 100


@pytest.mark.parametrize("tier", TIERS)
def test_every_tier_offers_the_same(tier: str) -> None:
    if tier == "numba":
        pytest.importorskip("numba", reason="the extra 'fast' is not installed")
    tried = rules(tier)
    found = []

    @settings(max_examples=20 if tier == "interpreter" else 60, deadline=None, database=None)
    @given(st.lists(states(), min_size=1, max_size=4))
    def compare(many: list[Facts]) -> None:
        expected = [[action in SCALAR.offer(facts).actions for action in ACTIONS] for facts in many]
        assert tried.offers(many).mask.tolist() == expected
        found.append(len(many))

    compare()
    assert tried.tier_for_many == tier
    assert tried.counts.fail_safes == tried.counts.interpreted == 0
    assert sum(found) > 20


def test_what_is_offered_near_a_vehicle_ahead() -> None:
    def offered(**where: float) -> set[str]:
        return set(SCALAR.offer(alone(**where)).actions)

    everything = set(ACTIONS)
    assert offered(gap=90.0) == everything
    assert offered(gap=20.0) == everything - {"faster"}
    assert offered(gap=2.0) == {"lane_left", "lane_right"}  # no action is safe, and these just pass it
    assert offered(gap=0.5) == {"slower"}  # these would touch it
    assert offered(gap=90.0, other=0.0) == {"lane_left", "lane_right"}  # it stands, and the ego cannot
    assert offered(gap=2.0, lane=-4.0) == everything - {"lane_left"}
    assert offered(gap=2.0, lane=4.0) == everything - {"lane_right"}


def test_an_action_without_effect_is_not_offered_and_the_reason_says_so() -> None:
    facts = alone(90.0)
    facts["aim", 3] = [row for row in facts["aim", 3] if row[0] != "lane_left"]
    assert "lane_left" not in SCALAR.offer(facts).actions
    assert SCALAR.objections(facts, "lane_left") == ("no_effect",)
    assert SCALAR.objections(alone(2.0), "faster")[0].startswith("too_near_ahead(1,2.0,")


@settings(max_examples=150, deadline=None)
@given(states(most=3))
def test_an_action_that_is_not_offered_has_a_reason(facts: Facts) -> None:
    offered = SCALAR.offer(facts).actions
    for action in set(ACTIONS) - set(offered):
        assert SCALAR.objections(facts, action)


@settings(max_examples=300, deadline=None)
@given(
    gap=numbers(0, 90),
    speed=numbers(17.5, 32),
    other=numbers(0, 35),
    aimed=st.sampled_from([20.0, 25.0, 30.0]),
)
def test_nothing_is_touched_within_three_decisions(
    gap: float, speed: float, other: float, aimed: float
) -> None:
    """After any action offered as safe, and then going slower, while the vehicle ahead brakes by 5 m/s²."""
    facts = alone(gap, speed=speed, other=other)
    facts["aim", 3][0] = ("idle", 4.0, aimed)
    nearest = min((0, 1, 2), key=lambda index: abs(20.0 + 5.0 * index - speed))
    facts["aim", 3][1] = ("slower", 4.0, 20.0 + 5.0 * max(nearest - 1, 0))
    facts["aim", 3][2] = ("faster", 4.0, 20.0 + 5.0 * min(nearest + 1, 2))
    for action, _, target in facts["aim", 3][:3]:
        if SCALAR.objections(facts, action):
            continue
        way, now, aim = 0.0, speed, target
        for decision in range(3):
            for tenth in range(1, 11):
                time = decision + tenth / 10
                part = steered(now, aim, tenth / 10, math.exp(-tenth / 10 / LAG))[0]
                assert way + part < gap + braked(other, 5.0, time) - 1.5
            more, now = steered(now, aim, 1.0, math.exp(-1.0 / LAG))
            way, aim = way + more, max(20.0, aim - 5.0)


def test_an_environment_with_other_actions_is_refused() -> None:
    with pytest.raises(UserError, match=r"no action faster; expected an environment of highway-env"):
        shield_straight_road(gymnasium.make("CartPole-v1"))
