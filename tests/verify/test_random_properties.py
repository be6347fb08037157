"""A sample of properties made at random: what is proved breaks in no scene; the script has thousands."""

from __future__ import annotations

import random
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import pytest

from drlsl.driving.scene import EGO, Facts, Scene, Vehicle, road_facts, scene_facts
from drlsl.lowering.backends import compile_scalar
from drlsl.lowering.frontend import lower
from drlsl.lowering.ir import NotLowerable, Undecided
from drlsl.verify.properties import load
from drlsl.verify.scope import witnesses
from scripts.random_properties import BROKEN, examine, main
from tests.scenes import road
from tests.verify.random_properties import RULES, random_program

ROAD = road(0, 2)
SAMPLE = random.Random(20_260_101).sample(range(10_000, 1_000_000), 25)


def test_a_sample_of_proofs_holds() -> None:
    records = [examine(seed, scenes=20_000, time_limit=0.5) for seed in SAMPLE]
    assert [record for record in records if record.hit in BROKEN] == []
    assert sum(record.status == "proved" for record in records) >= 5


@pytest.mark.slow
def test_no_proof_of_three_thousand_is_broken(tmp_path: Path) -> None:
    assert main(["--state", str(tmp_path / "state.jsonl"), "--count", "3000", "--jobs", "2"]) == 0


def test_a_broken_proof_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    state = tmp_path / "state.jsonl"
    state.write_text('{"seed": 0, "status": "proved", "hit": "exact"}\n{"seed": 1, "status": "pro')
    assert main(["--state", str(state), "--count", "1"]) == 1
    assert "1 exact" in capsys.readouterr().out


def test_the_same_seed_makes_the_same_program() -> None:
    assert random_program(5) == random_program(5) != random_program(6)


@pytest.mark.parametrize("seed", random.Random(20_260_102).sample(range(10_000, 1_000_000), 30))
def test_enough_vehicles_are_enough(seed: int, tmp_path: Path) -> None:
    """From a scene that breaks a property so many vehicles can be kept that it still is broken."""
    rules, properties = tmp_path / "rules.pl", tmp_path / "properties.pl"
    rules.write_text(RULES)
    properties.write_text(random_program(seed))
    book = load([rules], [properties])
    try:
        lowered = lower(book.engine, book.facts, [book.properties[0].query])
    except NotLowerable:
        return
    enough = witnesses(lowered.answers[0])
    if enough is None:
        return
    scalar = compile_scalar(lowered)

    def broken(scene: Scene) -> bool:
        facts: Facts = {**road_facts(scene.road), **scene_facts(scene), ("focus", 1): [("none",)]}
        try:
            return bool(scalar(facts)[0])
        except Undecided:
            return True

    rng = random.Random(seed)
    for _ in range(60):
        scene = scene_of_five(rng)
        if broken(scene):
            parts = (part for count in range(enough + 1) for part in combinations(scene.vehicles, count))
            assert any(broken(replace(scene, vehicles=part)) for part in parts)


def scene_of_five(rng: random.Random) -> Scene:
    """The ego and five others in two lanes, a few of their numbers alike."""

    def car(name: str, low: float) -> Vehicle:
        lane = rng.choice(ROAD.lanes)
        speed = rng.choice([-70.0, 0.0, 20.0, 45.0, 70.0, rng.uniform(-70, 70)])
        return Vehicle(
            name,
            lane.id,
            0.0 if name == EGO else rng.choice([-90.0, 0.0, 40.0, rng.uniform(-99, 99)]),
            lane.centre,
            max(low, speed),
            rng.choice([-10.0, 0.0, rng.uniform(-10, 10)]),
            rng.choice([1.0, 30.0, rng.uniform(1, 30)]),
            rng.uniform(0.5, 3),
        )

    return Scene(ROAD, car(EGO, 0.0), tuple(car(f"v{n}", -70.0) for n in range(1, 6)), 1)
