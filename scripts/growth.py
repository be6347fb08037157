"""Measure how time and memory grow with the work, and draw the curves of docs/performance.md.

`python -m scripts.growth measure FILE.json` measures every curve in some ten minutes, each point in a process
of its own, and writes the numbers; `--only CURVE` measures some of them again. `python -m scripts.growth page
FILE.json` makes docs/growth.png and the table of docs/performance.md of them. The power of growth is the
slope of the line through the upper half of a curve, log over log; 1 is linear.
"""

from __future__ import annotations

import argparse
import importlib
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

DOCS: Final = Path(__file__).parents[1] / "docs"

MARKER: Final = "<!-- what follows is made by scripts/growth.py -->"

MINUTES: Final = 0.5
"""Length of a recording."""

HARDLY_MB: Final = 16.0
"""Memory by which a process may grow without its size being the reason."""

LEAST_S: Final = 0.3
"""Time for which short work is repeated [s]."""

Work = Callable[[], object]


@dataclass(frozen=True, slots=True)
class Curve:
    """A kind of work and its sizes: `prepare(size)` returns the work, which is measured."""

    title: str
    of: str
    sizes: tuple[int, ...]
    prepare: Callable[[int], Work]
    repeated: bool = True
    """False: it is done once, for a second time would find what the first one left in memory."""


def _decide(tier: str, vehicles: int) -> Work:
    from drlsl.benchmarks import random_scenes
    from drlsl.driving.shield import Shield

    shield = Shield.default(tier=tier)
    (scene,) = random_scenes(1, vehicles)
    shield.decide(scene)
    return lambda: shield.decide(scene)


def _decide_batch(vehicles: int) -> Work:
    from drlsl.benchmarks import random_scenes
    from drlsl.driving.scene import SceneBatch
    from drlsl.driving.shield import Shield

    shield = Shield.default(tier="numba")
    scenes = SceneBatch.of(random_scenes(64, vehicles))
    shield.decide_batch(scenes)
    return lambda: shield.decide_batch(scenes)


def _clauses(count: int) -> str:
    """Return a program of highway.pl and `count` further reasons against a lane change."""
    reasons = (
        f"objection(Action, further_{number}) :- lane_change(Action, _), velocity(ego, V), "
        f"V > {60 + number / 16}.\n"
        for number in range(count)
    )
    return "".join([":- ensure_loaded('highway.pl').\n:- multifile(objection/2).\n", *reasons])


def _rule_file(count: int) -> Path:
    path = Path(tempfile.mkdtemp(dir=os.environ["DRLSL_GROWTH"])) / "grown.pl"
    path.write_text(_clauses(count), encoding="utf-8")
    return path


def _consult(count: int) -> Work:
    from drlsl.driving.shield import Shield

    path = _rule_file(count)
    return lambda: Shield.from_files([path])


def _compile(tier: str, count: int) -> Work:
    """Return the work from a program of many clauses to its first decision."""
    from drlsl.benchmarks import random_scenes
    from drlsl.driving.scene import SceneBatch
    from drlsl.driving.shield import Shield

    # What earlier runs compiled is not to be found.
    os.environ["DRLSL_CACHE"] = tempfile.mkdtemp(dir=os.environ["DRLSL_GROWTH"])
    shield = Shield.from_files([_rule_file(count)], tier=tier)
    scenes = SceneBatch.of(random_scenes(16, 20))
    return lambda: shield.decide_batch(scenes)


def _decide_by(tier: str, count: int) -> Work:
    from drlsl.benchmarks import random_scenes
    from drlsl.driving.shield import Shield

    shield = Shield.from_files([_rule_file(count)], tier=tier)
    (scene,) = random_scenes(1, 20)
    shield.decide(scene)
    return lambda: shield.decide(scene)


def _step(count: int) -> Work:
    from drlsl.benchmarks import any_offered, steady_envs

    step = any_offered(steady_envs(count))
    for _ in range(3):
        step()
    return step


def _step_among(vehicles: int) -> Work:
    from drlsl.benchmarks import any_offered, steady_envs

    step = any_offered(steady_envs(16, vehicles))
    for _ in range(3):
        step()
    return step


def _reset(count: int) -> Work:
    """Return the work of making environments and resetting them."""
    from drlsl.benchmarks import any_offered, steady_envs

    any_offered(steady_envs(1))()
    return lambda: any_offered(steady_envs(count))


def _recordings(count: int) -> Work:
    from drlsl.traffic import load_recordings

    root = _data_set(count)
    os.environ["DRLSL_CACHE"] = tempfile.mkdtemp(dir=os.environ["DRLSL_GROWTH"])
    return lambda: load_recordings(root)


def _train_on(count: int) -> Work:
    """Return the work from recordings that were loaded before to the first step of 16 environments."""
    from drlsl.driving import EnvConfig
    from drlsl.driving.envs import HighwayVectorEnv
    from drlsl.traffic import load_recordings

    root = _data_set(count)
    load_recordings(root)

    def first_step(recording: str) -> None:
        env = HighwayVectorEnv(EnvConfig(recording=recording), num_envs=16)
        env.reset(seed=0)
        env.step(env.action_masks().argmax(axis=1))

    first_step("freeway")
    return lambda: first_step(root)


def _data_set(count: int) -> str:
    """Return the folder of a data set of short recordings, each another one."""
    large = importlib.import_module("scripts.large_data_set")
    root = Path(os.environ["DRLSL_GROWTH"]) / str(count)
    for number in range(1, count + 1):
        if not (folder := root / f"{number:02d}").exists():
            large.write_recording(folder, number, MINUTES)
    return str(root)


def _episodes(count: int) -> Work:
    from drlsl.benchmarks import steady_traffic
    from drlsl.driving import EnvConfig, stress
    from drlsl.driving.shield import Shield

    recording = steady_traffic()
    config = EnvConfig(recording=recording.name, track_length=40.0)
    shield = Shield.default(tier="auto")

    def run(episodes: int) -> None:
        for _ in stress(config, [recording], shield, ["random"], episodes=episodes, seed=0):
            pass

    run(2)
    return lambda: run(count)


VEHICLES: Final = (5, 10, 20, 40, 80, 160, 400)
CLAUSES: Final = (10, 30, 100, 300, 1000)

CURVES: Final[dict[str, Curve]] = {
    "vehicles-interpreter": Curve(
        "a decision, interpreter", "vehicles", VEHICLES, lambda n: _decide("interpreter", n)
    ),
    "vehicles-scalar": Curve("a decision, scalar", "vehicles", VEHICLES, lambda n: _decide("scalar", n)),
    "vehicles-numba": Curve("64 decisions, numba", "vehicles", VEHICLES, _decide_batch),
    "vehicles-step": Curve("a step of 16 environments", "vehicles", VEHICLES, _step_among),
    "clauses-consult": Curve("consult", "clauses", CLAUSES, _consult),
    "clauses-interpreter": Curve(
        "a decision, interpreter", "clauses", CLAUSES, lambda n: _decide_by("interpreter", n)
    ),
    "clauses-numpy": Curve(
        "to the first decisions, numpy", "clauses", CLAUSES, lambda n: _compile("numpy", n), repeated=False
    ),
    "clauses-numba": Curve(
        "to the first decisions, numba",
        "clauses",
        CLAUSES,
        lambda n: _compile("numba", n),
        repeated=False,
    ),
    "n-step": Curve("a step", "environments", (1, 16, 256, 4096, 16384, 65536), _step),
    "n-reset": Curve(
        "making and resetting", "environments", (1, 16, 256, 4096, 16384, 65536), _reset, repeated=False
    ),
    "recordings-load": Curve("loading", "recordings", (1, 4, 15, 30, 60), _recordings, repeated=False),
    "recordings-train": Curve(
        "to the first step", "recordings", (1, 4, 15, 30, 60), _train_on, repeated=False
    ),
    "episodes": Curve("stress", "episodes", (1, 100, 1000, 10_000, 100_000), _episodes, repeated=False),
}


def measure(curve: Curve, size: int) -> dict[str, float]:
    """Return the processor time of the work in this process [s], and the most memory during it [MB]."""
    work = curve.prepare(size)
    if curve.repeated:
        _repeat(work, LEAST_S)  # what is called often is compiled only then
    # Linux forgets the peak: preparing may need more than the work.
    Path("/proc/self/clear_refs").write_text("5", encoding="utf-8")
    spent = _repeat(work, LEAST_S if curve.repeated else 0.0)
    return {"size": size, "s": spent, "peak_mb": peak_mb()}


def _repeat(work: Work, least: float) -> float:
    """Return the processor time of work that is done once or, for at least so long, again and again [s]."""
    count, begin = 0, time.process_time()
    while count == 0 or time.process_time() - begin < least:
        work()
        count += 1
    return (time.process_time() - begin) / count


def peak_mb() -> float:
    """Return the most memory that this process has had so far [MB], on Linux."""
    for line in Path("/proc/self/status").read_text(encoding="utf-8").splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) / 1024
    raise RuntimeError("/proc/self/status has no VmHWM")


def power(sizes: Sequence[float], values: Sequence[float]) -> float:
    """Return the slope of the line through the upper half of a curve, log over log."""
    half = max(0, min(len(sizes) // 2, len(sizes) - 2))
    xs = [math.log(one) for one in sizes[half:]]
    ys = [math.log(one) for one in values[half:]]
    middle, height = sum(xs) / len(xs), sum(ys) / len(ys)
    above = sum((x - middle) * (y - height) for x, y in zip(xs, ys, strict=True))
    return above / sum((x - middle) ** 2 for x in xs)


def measured(name: str, folder: str) -> Iterator[dict[str, float]]:
    """Yield the points of a curve, each measured in a process of its own.

    The first size is measured before, and left out: its process fills the cache.
    """
    environment = {
        **os.environ,
        "OMP_NUM_THREADS": "1",
        "DRLSL_GROWTH": folder,
        "DRLSL_CACHE": f"{folder}/cache",
    }
    sizes = CURVES[name].sizes
    for number, size in enumerate((sizes[0], *sizes)):
        done = subprocess.run(
            [sys.executable, "-m", "scripts.growth", "point", name, str(size)],
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            sys.exit(f"{name} {size}: {done.stderr.strip().splitlines()[-1]}")
        if number == 0:
            continue
        point = json.loads(done.stdout.splitlines()[-1])
        print(f"{name:<22} {size:>7} {point['s']:12.6f} s {point['peak_mb']:8.0f} MB", flush=True)
        yield point


def time_power(points: Sequence[Mapping[str, float]]) -> float:
    """Return the power with which time grows."""
    return power([point["size"] for point in points], [point["s"] for point in points])


def memory_power(points: Sequence[Mapping[str, float]]) -> float | None:
    """Return the power of the memory beyond that of the smallest size; None if it hardly grows."""
    least = points[0]["peak_mb"]
    grown = [point for point in points if point["peak_mb"] > least + HARDLY_MB]
    if len(grown) < 2:
        return None
    return power([one["size"] for one in grown], [one["peak_mb"] - least for one in grown])


def table(found: Mapping[str, Sequence[Mapping[str, float]]]) -> str:
    """Return the curves as a table in Markdown."""
    lines = ["| work | sizes | time | power | memory [MB] | power |", "|---|---|---|--:|---|--:|"]
    for name, points in found.items():
        curve, first, last = CURVES[name], points[0], points[-1]
        memory = memory_power(points)
        cells = (
            curve.title,
            f"{first['size']:,.0f} to {last['size']:,.0f} {curve.of}",
            f"{_time(first['s'])} to {_time(last['s'])}",
            f"{time_power(points):.2f}",
            f"{first['peak_mb']:.0f} to {last['peak_mb']:.0f}",
            "-" if memory is None else f"{memory:.2f}",
        )
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _time(seconds: float) -> str:
    for unit, factor in (("s", 1.0), ("ms", 1e3)):
        if seconds * factor >= 1.0:
            return f"{seconds * factor:.3g} {unit}"
    return f"{seconds * 1e6:.3g} µs"


def draw(found: Mapping[str, Sequence[Mapping[str, float]]], path: Path) -> None:
    """Draw time over size, one picture for each kind of size."""
    from matplotlib.figure import Figure

    kinds = list(dict.fromkeys(CURVES[name].of for name in found))
    figure = Figure(figsize=(3.2 * len(kinds), 3.4), layout="constrained")
    for axes, kind in zip(figure.subplots(1, len(kinds), squeeze=False)[0], kinds, strict=True):
        for name, points in found.items():
            if CURVES[name].of == kind:
                sizes, times = [one["size"] for one in points], [one["s"] for one in points]
                axes.loglog(sizes, times, marker="o", markersize=3, label=CURVES[name].title)
        axes.set_xlabel(kind)
        axes.legend(fontsize=7)
        axes.grid(visible=True, alpha=0.3)
    figure.supylabel("processor time [s]", fontsize=9)
    figure.savefig(path, dpi=110)


def write_page(found: Mapping[str, Sequence[Mapping[str, float]]], docs: Path) -> None:
    """Write the picture, and what stands below the marker of the page."""
    draw(found, docs / "growth.png")
    page = docs / "performance.md"
    kept = page.read_text(encoding="utf-8").partition(MARKER)[0]
    page.write_text(f"{kept}{MARKER}\n\n{table(found)}\n", encoding="utf-8")


def main() -> None:
    """Measure, or make the page."""
    parser = argparse.ArgumentParser(description="measure how time and memory grow with the work")
    commands = parser.add_subparsers(dest="command", required=True)
    measuring, paging, one = (commands.add_parser(name) for name in ("measure", "page", "point"))
    for each in (measuring, paging):
        each.add_argument("file", type=Path)
    measuring.add_argument("--only", action="append", choices=sorted(CURVES))
    one.add_argument("name")
    one.add_argument("size", type=int)
    options = parser.parse_args()
    if options.command == "point":
        print(json.dumps(measure(CURVES[options.name], options.size)))
        return
    exists = options.file.exists()
    found = json.loads(options.file.read_text(encoding="utf-8")) if exists else {}
    if options.command == "page":
        write_page({name: found[name] for name in CURVES if name in found}, DOCS)
        return
    with tempfile.TemporaryDirectory(prefix="drlsl-growth-") as folder:
        for name in options.only or CURVES:
            found[name] = list(measured(name, folder))
            print(f"{name:<22} power {time_power(found[name]):.2f}", flush=True)
            options.file.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
