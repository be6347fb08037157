"""The speed of each tier for the questions of driving, beside SWI-Prolog if installed."""

from __future__ import annotations

import random
import shutil
import statistics
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np

from drlsl.driving.scene import (
    EGO,
    SCHEMA,
    Facts,
    Road,
    Scene,
    SceneBatch,
    Vehicle,
    facts_of,
    road_facts,
)
from drlsl.driving.shield import ACTIONS, FREE, SPEED, STATE, Shield, default_rules, query_of
from drlsl.files import cache_folder
from drlsl.logic import Engine
from drlsl.lowering.backends import BatchProgram, Rows, TextProgram, compile_numpy, compile_scalar
from drlsl.lowering.frontend import Lowered, lower
from drlsl.traffic import Direction, Lane

QUERIES: Final = tuple(query_of(one, ordered=True) for one in (ACTIONS, FREE, SPEED, STATE))
VEHICLES: Final = (5, 20, 40)
BATCH: Final = 256
_SCENES: Final = 64
_LEAST_TIME: Final = 0.05
"""Each run repeats its measurement for at least this time [s]."""

Speeds = dict[str, dict[str, Any]]
Ask = Callable[[Facts], object]
Asked = TypeVar("Asked")


def rule_speeds(runs: int) -> Speeds:
    """Return times of this machine, now, for highway.pl: medians of `runs` runs.

    `one_scene_ms`: by tier and number of vehicles, replacing the facts of a scene and running the four
    queries; by SWI-Prolog, too, if it is on the path (swipl) or in this process (pyswip). `decide` is a whole
    `Shield.decide` on the scalar tier, all questions asked and answers checked.
    `batch_us_per_scene`: by tier, 256 scenes with 40 vehicles, their arrays ready.
    """
    engine = Engine()
    for path in default_rules():
        engine.consult(path)
    lowered = lower(engine, SCHEMA, QUERIES)
    scalar = compile_scalar(lowered)
    tiers: list[tuple[str, Ask]] = [("interpreter", _interpreter(engine)), ("scalar", scalar), *_pyswip()]
    shield = Shield.default(tier="scalar")
    one_scene: dict[str, dict[str, float]] = {}
    for vehicles in VEHICLES:
        told = random_scenes(_SCENES, vehicles)
        facts = [facts_of(scene) for scene in told]
        for name, ask in tiers:
            one_scene.setdefault(name, {})[str(vehicles)] = 1e3 * _seconds_each(ask, facts, runs)
        one_scene.setdefault("decide", {})[str(vehicles)] = 1e3 * _seconds_each(shield.decide, told, runs)
        if swipl := shutil.which("swipl"):
            one_scene.setdefault("swipl", {})[str(vehicles)] = _swipl_milliseconds(swipl, facts, runs)
    scenes = random_scenes(BATCH, 40)
    batch = {"scalar": 1e6 * _seconds_each(scalar, [facts_of(scene) for scene in scenes], runs)}
    for name, program in _array_programs(lowered):
        columns = array_facts(SceneBatch.of(scenes), program)
        batch[name] = 1e6 * median_seconds(partial(program, columns), runs) / BATCH
    return {"one_scene_ms": one_scene, "batch_us_per_scene": batch}


def median_seconds(run: Callable[[], object], runs: int) -> float:
    """Return the time of `run`: the median of several runs, each of them repeated for a while."""
    run()
    times = []
    for _ in range(runs):
        begin, count = time.perf_counter(), 0
        while count == 0 or time.perf_counter() - begin < _LEAST_TIME:
            run()
            count += 1
        times.append((time.perf_counter() - begin) / count)
    return statistics.median(times)


def six_lanes() -> tuple[Lane, ...]:
    """Return three lanes in each direction."""
    return tuple(
        Lane(
            number + 1,
            Direction.RIGHT_TO_LEFT if number < 3 else Direction.LEFT_TO_RIGHT,
            2.0 + 3.75 * number + (2.0 if number > 2 else 0.0),
            3.75,
            36.1,
        )
        for number in range(6)
    )


def random_scenes(count: int, vehicles: int, seed: int = 1) -> list[Scene]:
    """Return scenes on a road with three lanes in each direction, every vehicle in radar range."""
    rng = random.Random(seed)
    lanes = six_lanes()
    road = Road(lanes, 0.04, 100.0)

    def vehicle(name: str, x: float) -> Vehicle:
        lane = rng.choice(lanes)
        speed = lane.direction.sign * rng.uniform(15.0, 40.0)
        y = lane.centre + rng.gauss(0.0, 0.3)
        size = rng.uniform(4.0, 16.0), rng.uniform(1.8, 2.6)
        return Vehicle(name, lane.id, x, y, speed, rng.gauss(0.0, 0.2), *size)

    scenes = []
    for _ in range(count):
        ego = vehicle(EGO, 0.0)
        others = tuple(vehicle(f"v{n}", rng.uniform(-95.0, 95.0)) for n in range(vehicles))
        scenes.append(Scene(road, ego, others, ego.lane))
    return scenes


def array_facts(scenes: SceneBatch, program: BatchProgram[Any]) -> dict[tuple[str, int], Any]:
    """Return the facts of a batch on one road, in the layout that the program reads uncopied."""
    ordered = np.asfortranarray if isinstance(program, TextProgram) else np.ascontiguousarray
    facts: dict[tuple[str, int], Any] = {
        ("vehicle", 8): Rows([None, *map(ordered, scenes.columns)], ordered(scenes.valid)),
        ("target_lane", 1): Rows([scenes.target_lane]),
    }
    for (name, arity), rows in road_facts(scenes.roads[0]).items():
        table = [
            np.array([[program.code(value) if isinstance(value, str) else value for value in column]])
            for column in zip(*rows, strict=True)
        ]
        single = SCHEMA.relations[name, arity].single
        if (name, arity) in program.reads:
            ready = Rows([column[0] if single else column for column in table])
            facts[name, arity] = program.table(name, arity, ready)
    return facts


def _seconds_each(ask: Callable[[Asked], object], scenes: Sequence[Asked], runs: int) -> float:
    def ask_all() -> None:
        for one in scenes:
            ask(one)

    return median_seconds(ask_all, runs) / len(scenes)


def _array_programs(lowered: Lowered) -> Iterator[tuple[str, BatchProgram[Any]]]:
    """Yield the array tiers of this installation, by name."""
    yield "numpy", compile_numpy(lowered)
    yield "numpy_float32", compile_numpy(lowered, "float32")
    if find_spec("numba"):
        from drlsl.lowering.backends import compile_numba

        yield "numba", compile_numba(lowered, cache_folder() / "rules")
    if find_spec("torch"):
        from drlsl.lowering.backends import compile_torch

        yield "torch", compile_torch(lowered)


def _interpreter(engine: Engine) -> Ask:
    goals = [engine.prepare(goal) for goal in ("front_is_free", "longitudinal_velocity(V)", "state(L)")]
    actions = engine.prepare("safe_actions(A)")

    def ask(facts: Facts) -> None:
        for (name, arity), rows in facts.items():
            engine.replace_facts(name, arity, rows)
        list(actions.solutions())
        for goal in goals:
            goal.once()

    return ask


_ASK: Final = """
:- dynamic(told/1).
tell(Fact) :-
    functor(Fact, Name, Arity), functor(Any, Name, Arity),
    ( told(Any) -> true ; assertz(told(Any)) ), assertz(Fact).
ask :-
    forall(safe_actions(_), true), ignore(front_is_free), ignore(longitudinal_velocity(_)), ignore(state(_)).
scene(Facts) :- forall(told(Any), retractall(Any)), forall(member(Fact, Facts), tell(Fact)), ask.
"""
"""SWI-Prolog's work for one scene: like the interpreter, replace the facts and query."""

_DRIVER: Final = """
:- initialization(main, main).
round(Ms) :- get_time(T0), forall(facts(Facts), scene(Facts)), get_time(T1), Ms is (T1 - T0) * 1000.
main :- findall(Ms, ( between(1, %d, _), round(Ms) ), All), print(All), nl.
"""


def _swipl_milliseconds(swipl: str, scenes: Sequence[Facts], runs: int) -> float:
    """Return the time of one scene in SWI-Prolog: the median round over all scenes, divided among them."""
    lines = [f":- consult('{path}')." for path in default_rules()]
    lines.extend(f"facts([{', '.join(_terms(facts))}])." for facts in scenes)
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "measure.pl"
        program.write_text("\n".join([*lines, _ASK, _DRIVER % runs]), encoding="utf-8")
        done = subprocess.run([swipl, str(program)], capture_output=True, text=True, check=True, timeout=120)
    return statistics.median(map(float, done.stdout.strip(" []\n").split(","))) / len(scenes)


def _pyswip() -> list[tuple[str, Ask]]:
    """Return SWI-Prolog in this process, if its Python bridge is installed."""
    if not find_spec("pyswip"):
        return []
    from pyswip import Prolog

    prolog = Prolog()
    with tempfile.NamedTemporaryFile("w", suffix=".pl", encoding="utf-8") as program:
        program.write("\n".join([*(f":- consult('{path}')." for path in default_rules()), _ASK]))
        program.flush()
        prolog.consult(program.name)
    return [("pyswip", lambda facts: list(prolog.query(f"scene([{', '.join(_terms(facts))}])")))]


def _terms(facts: Facts) -> list[str]:
    return [f"{name}({', '.join(map(str, row))})" for (name, _), rows in facts.items() for row in rows]
