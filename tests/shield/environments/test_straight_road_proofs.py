"""The properties of rules/envs/straight_road.pl are proved over all states with one other vehicle.

Each says that no vehicle has some quality: where several break it, one of them alone does.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction
from typing import Any

import pytest

from drlsl.logic import Engine
from drlsl.logic.terms import Atom
from drlsl.lowering import Query, lower
from drlsl.shield import consult_rules, rules_folder
from drlsl.shield.environments.straight_road import ROAD_SCHEMA
from tests.shield.environments.oracle import LAG

pytest.importorskip("z3", reason="the extra 'verify' is not installed")

from drlsl.verify.smt import Algebra, Bool, Formula, Row, Solver

LOWEST, STEP = 20, 5
SECONDS = 60.0
PROPERTIES = ("behind_at_each_decision", "room_behind")
ACTIONS = ("idle", "lane_left")
"""The actions whose names matter: one that keeps the lane, with any speed, and a lane change."""


class Open:
    """The states with one vehicle besides the ego, in which one action has any effect."""

    def __init__(self, action: str, room: float = 100.0) -> None:
        self.algebra = algebra = Algebra()
        self.always: list[Bool] = []
        self.about: dict[str, list[Bool]] = {}
        self.usual: dict[int, tuple[int, Fraction]] = {}
        ring, true = algebra.ring, algebra.booleans.true

        def number(name: str, low: float, high: float) -> Any:
            return ring.unknown(name, Fraction(low), Fraction(high))

        def exactly(value: float) -> Any:
            return ring.const(Fraction(str(value)))

        ego = (
            exactly(0),
            number("y", -4, 4),
            number("v", 0, 31),
            number("vy", -5, 5),
            exactly(5),
            exactly(2),
        )
        other = [number("x2", -room, room), number("y2", -20, 20), number("v2", 0, 40), number("vy2", -5, 5)]
        size = [number("length2", 1, 20), number("width2", 1, 3)]
        aim: tuple[Any, ...] = ({Atom(action): true}, number("aimed_y", -8, 8), number("aimed_v", LOWEST, 30))
        idle: tuple[Any, ...] = ({Atom("idle"): true}, exactly(0), exactly(LOWEST))
        self.facts = {
            ("ego", 6): [Row(true, ego)],
            ("vehicle", 9): [
                Row(true, ({1: true}, *other, *size, number("goal", -20, 20), {Atom("yes"): true}))
            ],
            ("aim", 3): [Row(true, aim)] if action == "idle" else [Row(true, idle), Row(true, aim)],
            ("speeds", 2): [Row(true, (exactly(LOWEST), exactly(STEP)))],
            ("period", 2): [Row(true, (exactly(1), exactly(round(math.exp(-1 / LAG), 6))))],
        }

    def tidy(self) -> list[Bool]:
        return []


def verdicts(engine: Engine, name: str) -> Iterator[str]:
    """Whether there is a state that breaks a property, for each kind of action."""
    lowered = lower(engine, ROAD_SCHEMA, [Query(f"violates {name}", 0, "holds")])
    for action in ACTIONS:
        states = Open(action)
        truth = Formula(states.algebra, states.facts).truth(lowered.answers[0].found)
        yield (
            "none"
            if truth.op == "false"
            else Solver(states, linear=False).holds_nowhere(truth, SECONDS).verdict
        )


def loaded(text: str | None = None) -> Engine:
    """The rules, or those of a text in their place, with the properties."""
    engine = Engine()
    properties = (rules_folder() / "envs/straight_road.properties.pl").read_text(encoding="utf-8")
    if text is None:
        consult_rules(engine, "envs/straight_road.pl")
    else:
        engine.consult_text(text, "rules")
    questions = "".join(f"'violates {name}' :- violates({name}).\n" for name in PROPERTIES)
    engine.consult_text(
        properties.replace(":- ensure_loaded('straight_road.pl').", "") + questions, "properties"
    )
    return engine


@pytest.mark.parametrize("name", PROPERTIES)
def test_a_property_is_proved(name: str) -> None:
    assert list(verdicts(loaded(), name)) == ["none"] * len(ACTIONS)


@pytest.mark.parametrize(
    ("name", "was", "wrong"),
    [
        ("behind_at_each_decision", "braking(stays, 5.0)", "braking(stays, 4.0)"),
        ("behind_at_each_decision", "room(stays, 3.0)", "room(stays, 0.0)"),
        ("room_behind", "follower_time(0.7)", "follower_time(0.1)"),
        ("room_behind", "min(V1, V)), Needed", "V1), Needed"),
    ],
)
def test_a_wrong_number_is_found(name: str, was: str, wrong: str) -> None:
    text = (rules_folder() / "envs/straight_road.pl").read_text(encoding="utf-8")
    assert text.count(was) == 1
    assert "some" in list(verdicts(loaded(text.replace(was, wrong)), name))
