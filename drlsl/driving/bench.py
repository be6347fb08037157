"""How fast each tier of the rules answers what driving asks, beside SWI-Prolog where it is there."""

from __future__ import annotations

import random
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np

from drlsl.driving.batch import SceneBatch
from drlsl.driving.limits import ACCELERATION_LIMIT, BRAKING_LIMIT, CENTRE_TOLERANCE
from drlsl.driving.lowered import FREE, SCHEMA, SPEED, STATE
from drlsl.driving.scene import EGO, Facts, Road, Scene, Vehicle, road_facts, scene_facts
from drlsl.driving.shield import default_rules
from drlsl.logic import Engine
from drlsl.logic.lowering.lower import Query, lower
from drlsl.logic.lowering.numpy_backend import ArrayProgram, Rows, compile_numpy
from drlsl.logic.lowering.scalar import compile_scalar
from drlsl.traffic.road import Direction, Lane

QUERIES: Final = (Query("safe_actions", 1, "all"), FREE, SPEED, STATE)
VEHICLES: Final = (5, 20, 40)
BATCH: Final = 256
_TYPES: Final[tuple[Literal["float64", "float32"], ...]] = ("float64", "float32")
_SCENES: Final = 64
_ROUNDS: Final = 7

Speeds = dict[str, dict[str, Any]]


def rule_speeds() -> Speeds:
    """Times of this machine, now, for highway.pl.

    `one_scene_ms`: by tier and number of vehicles, the facts of a scene replaced and the four queries asked;
    the tiers are swipl (where it is on the path), interpreter and scalar. `batch_us_per_scene`: by tier, 256
    scenes with 40 vehicles. The least of several rounds counts.
    """
    engine = Engine()
    for path in default_rules():
        engine.consult(path)
    lowered = lower(engine, SCHEMA, QUERIES)
    scalar = compile_scalar(lowered)
    one_scene: dict[str, dict[str, float]] = {"interpreter": {}, "scalar": {}}
    swipl = shutil.which("swipl")
    for vehicles in VEHICLES:
        facts = [_facts(scene) for scene in random_scenes(_SCENES, vehicles)]
        ask = _interpreter(engine)
        one_scene["interpreter"][str(vehicles)] = _milliseconds(ask, facts[:16])
        one_scene["scalar"][str(vehicles)] = _milliseconds(scalar, facts)
        if swipl is not None:
            one_scene.setdefault("swipl", {})[str(vehicles)] = _swipl_milliseconds(swipl, facts)
    scenes = random_scenes(BATCH, 40)
    batch = {"scalar": 1e3 * _milliseconds(scalar, [_facts(scene) for scene in scenes])}
    for dtype in _TYPES:
        program = compile_numpy(lowered, dtype)
        columns = array_facts(SceneBatch.of(scenes), program)
        batch[f"numpy {dtype}"] = 1e6 * _least_time(lambda: program(columns)) / BATCH  # noqa: B023  (called at once)
    return {"one_scene_ms": one_scene, "batch_us_per_scene": batch}


def random_scenes(count: int, vehicles: int, seed: int = 1) -> list[Scene]:
    """Scenes on a road with three lanes in each direction, every vehicle in radar range."""
    rng = random.Random(seed)
    lanes = tuple(
        Lane(
            number + 1,
            Direction.RIGHT_TO_LEFT if number < 3 else Direction.LEFT_TO_RIGHT,
            2.0 + 3.75 * number + (2.0 if number > 2 else 0.0),
            3.75,
            36.1,
        )
        for number in range(6)
    )
    road = Road(lanes, 0.04, 100.0, ACCELERATION_LIMIT, BRAKING_LIMIT, CENTRE_TOLERANCE)

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


def array_facts(scenes: SceneBatch, program: ArrayProgram) -> dict[tuple[str, int], Any]:
    """A batch on one road, with the road's facts made ready."""
    columns = [scenes.lane, scenes.x, scenes.y, scenes.vx, scenes.vy, scenes.length, scenes.width]
    facts: dict[tuple[str, int], Any] = {
        ("vehicle", 8): Rows([None, *map(np.asfortranarray, columns)], np.asfortranarray(scenes.valid)),
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


def _facts(scene: Scene) -> Facts:
    return {**road_facts(scene.road), **scene_facts(scene)}


def _interpreter(engine: Engine) -> Callable[[Facts], None]:
    goals = [engine.prepare(goal) for goal in ("front_is_free", "longitudinal_velocity(V)", "state(L)")]
    actions = engine.prepare("safe_actions(A)")

    def ask(facts: Facts) -> None:
        for (name, arity), rows in facts.items():
            engine.replace_facts(name, arity, rows)
        list(actions.solutions())
        for goal in goals:
            goal.once()

    return ask


def _least_time(run: Callable[[], object]) -> float:
    run()
    times = []
    for _ in range(_ROUNDS * 10):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return min(times)


def _milliseconds(answer: Callable[[Facts], object], scenes: Sequence[Facts]) -> float:
    """The mean over the scenes of the least time of each."""
    total = 0.0
    for facts in scenes:
        answer(facts)
        times = []
        for _ in range(_ROUNDS):
            start = time.perf_counter()
            answer(facts)
            times.append(time.perf_counter() - start)
        total += min(times)
    return 1e3 * total / len(scenes)


_DRIVER: Final = """
:- initialization(main, main).
tell(Fact) :- functor(Fact, Name, Arity), functor(Any, Name, Arity), ( told(Any) -> true ; assertz(told(Any))
),     assertz(Fact). :- dynamic(told/1). ask :- forall(safe_actions(_), true), ignore(front_is_free),
ignore(longitudinal_velocity(_)), ignore(state(_)). scene(Facts) :- forall(told(Any), retractall(Any)),
forall(member(Fact, Facts), tell(Fact)), ask. round(Ms) :- get_time(T0), forall(facts(Facts), scene(Facts)),
get_time(T1), Ms is (T1 - T0) * 1000. main :- findall(Ms, ( between(1, %d, _), round(Ms) ), All),
min_list(All, Least), print(Least), nl.
"""


def _swipl_milliseconds(swipl: str, scenes: Sequence[Facts]) -> float:
    """The time of one scene in SWI-Prolog: the best round over all scenes, divided among them."""
    lines = [f":- consult('{path}')." for path in default_rules()]
    lines.extend(f"facts([{', '.join(_terms(facts))}])." for facts in scenes)
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "measure.pl"
        program.write_text("\n".join([*lines, _DRIVER % _ROUNDS]), encoding="utf-8")
        done = subprocess.run([swipl, str(program)], capture_output=True, text=True, check=True, timeout=120)
    return float(done.stdout) / len(scenes)


def _terms(facts: Facts) -> list[str]:
    return [f"{name}({', '.join(map(str, row))})" for (name, _), rows in facts.items() for row in rows]
