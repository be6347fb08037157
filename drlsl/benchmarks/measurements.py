"""The measurements that compare two versions, each of them made by commands of the version itself."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final, TypeAlias

from drlsl.benchmarks.rule_speed import random_scenes
from drlsl.benchmarks.subjects import Subject, children_time
from drlsl.driving.scene import scene_json

Times: TypeAlias = Mapping[str, float]
"""Times by the name of what takes them [s]."""

QUERIES: Final = 5
"""Number of queries in one measurement, each a process of its own."""

PROPERTIES: Final = ("critical_distance_front", "nobody_alongside", "nothing_hidden")
"""The properties that are proved."""

FOREIGN: Final = frozenset({"swipl", "pyswip"})
"""Tiers of `drlsl bench rules` that do not depend on the version."""

_FIRST_STEP: Final = """
import os, sys
from drlsl.cli import run
from drlsl.driving.simulation import World

step = World.step

def first_step(*arguments, **options):
    step(*arguments, **options)
    os._exit(0)

World.step = first_step
run(["train", "--out", sys.argv[1]])
sys.exit("drlsl train ended before its first step")
"""
"""Ends where `drlsl train` has made its first step."""

_FIRST_DECISION: Final = """
import sys, time
from drlsl.driving.scene import load_scene
from drlsl.driving.shield import Shield

scene = load_scene(sys.argv[1])
begin = time.process_time()
Shield.default(tier="numba").decide(scene)
print(time.process_time() - begin)
"""
"""Prints the processor time from the rules to the first decision of Numba's tier."""


def _bench(version: Subject, part: str, *options: str) -> Any:
    return json.loads(version.run("bench", part, "--runs", "1", "--json", *options))


def _rules(version: Subject) -> Times:
    told = _bench(version, "rules")
    one = {
        f"{tier}, {vehicles} vehicles": time / 1e3
        for tier, by_vehicles in told["one_scene_ms"].items()
        if tier not in FOREIGN
        for vehicles, time in by_vehicles.items()
    }
    return one | {f"{tier}, batch": time / 1e6 for tier, time in told["batch_us_per_scene"].items()}


def _env(version: Subject) -> Times:
    steps = _bench(version, "env")["steps_per_s"]
    return {f"{size} side by side": 1 / speed for size, speed in steps.items()}


def _train(version: Subject) -> Times:
    told = _bench(version, "train", *(word for setting in version.settings for word in ("--set", setting)))
    return {"training": 1 / told["updates_per_s"], "bare updates": 1 / told["bare_updates_per_s"]}


def _query(version: Subject) -> Times:
    """Return the processor time of a query, a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        scene = _scene(Path(folder))
        before = children_time()
        for _ in range(QUERIES):
            version.run("query", "--state", scene)
        return {"processor time": (children_time() - before) / QUERIES}


def _start(version: Subject) -> Times:
    """Return the processor time of `drlsl train` until its first step, with machine code in the cache."""
    with tempfile.TemporaryDirectory() as folder:
        if not version.cache.exists():
            version.run_code(_FIRST_STEP, f"{folder}/warm")
        before = children_time()
        version.run_code(_FIRST_STEP, f"{folder}/run")
        return {"train to its first step": children_time() - before}


def _compile(version: Subject) -> Times:
    """Return the processor time of Numba's first decision, with an empty cache."""
    with tempfile.TemporaryDirectory() as folder:
        told = version.run_code(_FIRST_DECISION, _scene(Path(folder)), cache=Path(folder) / "cache")
        return {"first decision of numba": float(told)}


def _proofs(version: Subject) -> Times:
    """Return the processor time of proofs and of the attack on them, with an empty cache."""
    only = [word for name in PROPERTIES for word in ("--only", name)]
    with tempfile.TemporaryDirectory() as folder:
        before = children_time()
        version.run("rules", "verify", "--jobs", "1", *only, cache=Path(folder))
        return {f"{len(PROPERTIES)} properties": children_time() - before}


def _scene(folder: Path) -> str:
    """Return the file of a scene with 20 vehicles."""
    (scene,) = random_scenes(1, 20)
    path = folder / "scene.json"
    path.write_text(scene_json(scene), encoding="utf-8")
    return str(path)


MEASUREMENTS: Final[dict[str, Callable[[Subject], Times]]] = {
    "rules": _rules,
    "env": _env,
    "train": _train,
    "query": _query,
    "start": _start,
    "compile": _compile,
    "proofs": _proofs,
}
"""Measurements that can be compared."""
