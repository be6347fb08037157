"""Print how long exported C takes for one decision, beside the tiers.

`python scripts/export_speed.py [SCENES] [FILE]`: the scenes have 40 vehicles. A scene counts with the best of
five; the slowest scene is the bound for a control unit.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from drlsl.benchmarks import array_facts, random_scenes
from drlsl.driving.export import RuleProgram, export_rules
from drlsl.driving.scene import SCHEMA, Scene, SceneBatch, facts_of
from drlsl.driving.shield import query_of
from drlsl.lowering.backends import compile_numba, compile_scalar
from drlsl.lowering.frontend import lower
from scripts.compare_exports import CRules

AT_ONCE: Final = 1000
VEHICLES: Final = 40
RUNS: Final = 5


def best(ask: Callable[[], Any]) -> float:
    """Return the best time of some runs [µs]."""
    times = []
    for _ in range(RUNS):
        start = time.perf_counter()
        ask()
        times.append(time.perf_counter() - start)
    return min(times) * 1e6


def described(name: str, times: list[float]) -> str:
    """Return a line about the times of scenes [µs]."""
    times = sorted(times)
    middle, late = times[len(times) // 2], times[len(times) * 999 // 1000]
    return f"{name:<24} median {middle:8.2f}  of 1,000 the slowest {late:8.2f}  slowest {times[-1]:8.2f} µs"


def main(count: int, file: str) -> None:
    """Measure `count` scenes in C, and fewer in the tiers."""
    program = RuleProgram.of([Path(file)])
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "c"
        export_rules([Path(file)], "c", out, decisions=1)
        c = CRules(out, "-O2")
        sizes = subprocess.run(["size", out / "rules.so"], capture_output=True, text=True, check=False).stdout
        in_c, in_scalar, in_numba = [], [], []
        lowered = lower(program.shield.engine, SCHEMA, [query_of(one) for one in program.questions])
        scalar, numba = compile_scalar(lowered), compile_numba(lowered)

        def few(scenes: list[Scene]) -> None:
            for scene in scenes:
                facts = facts_of(scene)
                in_scalar.append(best(lambda facts=facts: scalar(facts)))  # type: ignore[misc]  # a default
                bound = numba.bind(array_facts(SceneBatch.of([scene]), numba))
                in_numba.append(best(bound))

        for start in range(0, count, AT_ONCE):
            scenes = random_scenes(min(AT_ONCE, count - start), VEHICLES, seed=start)
            for scene in scenes:
                c.put(scene)
                in_c.append(c.microseconds(RUNS))
            few(scenes[:20])
    print(f"{file}: {count} scenes of {VEHICLES} vehicles, each its best of {RUNS}")
    for name, times in (("C, -O2", in_c), ("scalar", in_scalar), ("Numba, bound arrays", in_numba)):
        print(described(name, times))
    print(sizes)


if __name__ == "__main__":
    main(
        int(sys.argv[1]) if len(sys.argv) > 1 else 100_000,
        sys.argv[2] if len(sys.argv) > 2 else "highway.pl",
    )
