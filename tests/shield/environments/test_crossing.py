"""rules/envs/crossing.pl on paths made up, against the exact overlap of two rectangles."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from typing import Any, NamedTuple

import gymnasium
import numpy as np
import pytest

from drlsl.errors import UserError
from drlsl.shield import ActionRules, Facts
from drlsl.shield.environments import shield_crossing
from drlsl.shield.environments.crossing import RULES, SCHEMA, STEP, STEPS
from drlsl.shield.environments.meta_actions import FALLBACK

ACTIONS = ("slower", "idle", "faster")
SPEEDS = {"slower": 0.0, "idle": 4.5, "faster": 9.0}
PLANS = {"stop": -4.5, "go": 4.5, "through": 0.0}
MANNERS = {"steady": 0.0, "speeding_up": 0.5, "slowing_down": -1.0}
LENGTH, WIDTH = 5.0, 2.0


class Box(NamedTuple):
    """A vehicle: its centre, and its direction as a unit vector."""

    x: float
    y: float
    right: float
    down: float

    def corners(self) -> list[tuple[float, float]]:
        return [
            (self.x + a * self.right - b * self.down, self.y + a * self.down + b * self.right)
            for a in (-LENGTH / 2, LENGTH / 2)
            for b in (-WIDTH / 2, WIDTH / 2)
        ]


def overlap(one: Box, other: Box) -> bool:
    """Whether two vehicles overlap: no line along a side of either separates them."""
    for right, down in (
        (one.right, one.down),
        (one.down, -one.right),
        (other.right, other.down),
        (other.down, -other.right),
    ):
        spans = [[x * right + y * down for x, y in box.corners()] for box in (one, other)]
        if max(spans[0]) < min(spans[1]) or max(spans[1]) < min(spans[0]):
            return False
    return True


CLEAR = ":- ensure_loaded('envs/crossing.pl').\n" + "".join(
    f"clear_{plan}(Action) :- clear(Action, {plan}).\n" for plan in PLANS
)


def rules(ask: str = "offered(Action)", tier: str = "scalar", text: str = RULES) -> ActionRules:
    return ActionRules(text, ACTIONS, fallback=FALLBACK, tier=tier, schema=SCHEMA, ask=ask)


def ego_rows(line: float) -> list[tuple[Any, ...]]:
    """An ego 30 m before the road that it crosses, and `line` m before the line; it is through after 45 m."""
    rows = []
    for action, speed in SPEEDS.items():
        for plan, change in PLANS.items():
            way = 0.0
            for step in range(1, STEPS + 1):
                aimed = speed if step * STEP <= 1.0 else min(max(speed + change, 0.0), 9.0)
                way += aimed * STEP
                past = way + LENGTH / 2 - line
                rows.append((action, plan, step, 0.0, 30.0 - way, 0.0, -1.0, past if way < 45.0 else 0.0))
    return rows


def crossings() -> Iterator[Facts]:
    """An ego on its way to a crossing, and one or two others that come to where it will be."""
    rng = np.random.default_rng(0)
    for number in range(200):
        cars, paths = [], []
        for car in range(1 + number % 2):
            heading, speed = rng.uniform(-math.pi, math.pi), rng.uniform(0, 12)
            place = str(rng.choice(["approach", "inside", "exit"]))
            cars.append((car, speed, LENGTH, WIDTH, int(rng.integers(3)), place))
            right, down = math.cos(heading), math.sin(heading)
            before = speed * rng.uniform(0, 3)  # on the ego's way
            x, y = rng.uniform(-4, 4) - before * right, rng.uniform(0, 25) - before * down
            for manner, change in MANNERS.items():
                for step in range(1, STEPS + 1):
                    time = step * STEP
                    way = max(0.0, speed * time + change * time * time / 2)
                    paths.append((car, 0, manner, step, x + way * right, y + way * down, right, down))
        yield {
            ("ego", 5): [(4.5, LENGTH, WIDTH, 1, "approach")],
            ("car", 6): cars,
            ("ego_path", 8): ego_rows(float(rng.choice([2.0, 12.0, 30.0]))),
            ("path", 8): paths,
        }


def touches(facts: Facts, action: str, plan: str) -> bool:
    """Whether the ego, on that plan, overlaps another vehicle that keeps its speed or speeds up."""
    ego = {row[2]: Box(*row[3:7]) for row in facts["ego_path", 8] if row[:2] == (action, plan)}
    return any(
        overlap(ego[row[3]], Box(*row[4:])) for row in facts["path", 8] if row[2] in ("steady", "speeding_up")
    )


def test_what_is_safe_touches_nobody_within_the_horizon() -> None:
    """Of the plans after a safe action there is one on which the ego overlaps nobody."""
    safe, offered = rules("safe(Action)"), rules()
    counted: Counter[str] = Counter()
    for facts in crossings():
        answer = safe.offer(facts)
        found = set() if answer.failure else set(answer.actions)
        for action in found:
            assert not all(touches(facts, action, plan) for plan in PLANS), action
        ends = {row[:2]: row[7] for row in facts["ego_path", 8] if row[2] == STEPS}
        for action in set(ACTIONS) - found:
            counted["unsafe"] += 1
            for plan in PLANS:
                if plan == "go" or ends[action, plan] <= 0.0:
                    counted["unsafe though nobody is touched"] += not touches(facts, action, plan)
        counted["safe"] += len(found)
        given = offered.offer(facts)
        assert not given.failure
        if found:
            assert set(given.actions) <= found
    assert counted["safe"] > 150
    assert counted["unsafe"] > 50
    assert counted["unsafe though nobody is touched"] < counted["unsafe"]  # margins, and the right of way


@pytest.mark.parametrize("plan", PLANS)
def test_a_clear_plan_touches_nobody(plan: str) -> None:
    clear = rules(f"clear_{plan}(Action)", text=CLEAR)
    count = 0
    for facts in crossings():
        offer = clear.offer(facts)
        found = () if offer.failure else offer.actions
        assert not any(touches(facts, action, plan) for action in found)
        count += len(found)
    assert 50 < count < 550  # of 600


def standing(*, past: float, place: str = "approach", priority: int = 0) -> dict[tuple[str, int], Any]:
    """An ego 30 m before a crossing, and a car that crosses there at 9 m/s a moment after the ego would."""
    return {
        ("ego", 5): [(9.0, LENGTH, WIDTH, 1, "approach")],
        ("car", 6): [(1, 9.0, LENGTH, WIDTH, priority, place)],
        ("ego_path", 8): ego_rows(past),
        ("path", 8): [
            (1, 0, manner, step, -31.0 + 9.0 * step * STEP, 6.0, 1.0, 0.0)
            for manner in MANNERS
            for step in range(1, STEPS + 1)
        ],
    }


def test_the_ego_gives_way_to_who_has_it() -> None:
    """The ego would be through before the car, which would have to brake behind it."""
    safe = rules("safe(Action)")
    nobody = standing(past=12.0)
    assert "faster" in safe.offer(nobody).actions
    for facts in (standing(past=12.0, place="inside"), standing(past=12.0, priority=2)):
        assert "faster" not in safe.offer(facts).actions
        assert any("conflict(go,1," in reason for reason in safe.objections(facts, "faster"))


def test_the_interpreter_offers_the_same() -> None:
    scalar, interpreter = rules(), rules(tier="interpreter")
    for facts in list(crossings())[:2]:
        assert set(interpreter.offer(facts).actions) == set(scalar.offer(facts).actions)
    assert interpreter.counts.fail_safes == 0


def test_an_environment_with_other_actions_is_refused() -> None:
    with pytest.raises(UserError, match=r"expected an environment of highway-env"):
        shield_crossing(gymnasium.make("CartPole-v1"))
