"""The oracle of tests/properties as cases: what a person's own program says about generated scenes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from hypothesis import HealthCheck, Phase, given, settings

from drlsl.assurance import load_table, tables_of
from drlsl.assurance.checks import Case, Check, Equals, Holds, Observed, Offered, Solves
from drlsl.assurance.driving_rules import ACTIONS, COMFORT, ENTRY, LANE, OBSERVATION, SPEED
from drlsl.assurance.tested_rules import Question
from drlsl.driving.scene import Scene
from drlsl.driving.shield import Shield
from tests.properties.oracle import SECTIONS, Oracle
from tests.scenes import scenes

RULES = Path(__file__).parents[2] / "rules"
EXACT = 1e-9


def table_cases(program: Path) -> list[Case]:
    """The cases of the tables beside a program."""
    names = Shield.from_files([program]).observation.names
    return [case for table in tables_of([program]) for case in load_table(table, names)]


def generated_scenes(count: int) -> list[Scene]:
    """The same scenes in every run."""
    found: list[Scene] = []

    @settings(
        max_examples=count,
        derandomize=True,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(scene=scenes())
    def collect(scene: Scene) -> None:
        found.append(scene)

    collect()
    return found


def oracle_cases(count: int) -> list[Case]:
    """What the oracle expects in generated scenes."""
    return [
        Case(f"generated scene {number}", "oracle", scene, tuple(_checks(Oracle(scene))))
        for number, scene in enumerate(generated_scenes(count))
    ]


def _checks(oracle: Oracle) -> Iterator[Check]:
    yield Offered("actions", ACTIONS, tuple(oracle.actions()))
    yield Equals("speed", SPEED, oracle.target_speed(), EXACT)
    observation = oracle.observation()
    yield Observed("observation", OBSERVATION, tuple(observation), tuple(observation.items()), EXACT)
    yield Equals("lane", LANE, oracle.lane_to_keep(), 0.0)
    yield Equals("comfort", COMFORT, oracle.comfortable_acceleration(), EXACT)
    yield Holds("entry", ENTRY, oracle.is_safe("entry"))
    yield Holds("settled", Question("settled", "holds"), oracle.settled)
    for side in ("left", "right"):
        for reason, holds in (
            ("no_lane", oracle.is_valid(side)),
            ("too_close(_, _, _)", oracle.is_safe(side)),
        ):
            question = Question(f"objection({side}_lane_change, {reason})", "holds")
            yield Holds(f"{side} {reason}", question, not holds)
        found = tuple(
            {"Car": car.id, "Gap": oracle.gap(car), "Needed": oracle.needed_gap(car)}
            for car in oracle.obstacles(side)
        )
        yield Solves(
            f"{side} obstacles", Question(f"obstacle({side}, Car, Gap, Needed)", "all"), found, EXACT
        )
    for name in SECTIONS:
        yield Holds(name, Question(f"{name}_is_busy", "holds"), oracle.busy(name))
        yield Holds(name, Question(f"{name}_is_free", "holds"), not oracle.busy(name))
