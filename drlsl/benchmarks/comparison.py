"""Compare the speed of two checkouts: the same measurements in each, in turn, on one machine."""

from __future__ import annotations

import json
import math
import os
import resource
import statistics
import subprocess
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeAlias

from drlsl.errors import UserError

Speeds: TypeAlias = Mapping[str, float]
"""Speeds by the name of the measurement; higher is faster."""

CONFIDENCE: Final = 0.95
"""Confidence of the interval of the median ratio."""

QUERIES: Final = 5
"""Number of queries in one measurement, each a process of its own."""

FOREIGN: Final = frozenset({"swipl", "pyswip"})
"""Tiers of `drlsl bench rules` that do not depend on the checkout."""


@dataclass(frozen=True)
class Comparison:
    """The relative speed of the new checkout in one respect: a ratio for each pair of runs."""

    name: str
    ratios: tuple[float, ...]

    @property
    def median(self) -> float:
        """The median of the ratios."""
        return statistics.median(self.ratios)

    @property
    def interval(self) -> tuple[float, float]:
        """The narrowest symmetric interval between ratios that holds the median with `CONFIDENCE`.

        With fewer than six pairs there is none, and it is their range. Source: the sign test.
        """
        ratios, count = sorted(self.ratios), len(self.ratios)
        cut = 0
        while cut + 1 <= (count - 1) // 2 and _coverage(count, cut + 1) >= CONFIDENCE:
            cut += 1
        return ratios[cut], ratios[count - 1 - cut]


def _coverage(count: int, cut: int) -> float:
    """Return the confidence of the interval between two order statistics, `cut` from either end."""
    outside = sum(math.comb(count, below) for below in range(cut + 1))
    return 1 - math.ldexp(outside, 1 - count)


def compare_checkouts(old: Path, new: Path, what: Sequence[str], pairs: int) -> Iterator[Comparison]:
    """Measure both checkouts in turn, and yield a comparison of each number when its pairs are complete.

    Raises:
        UserError: a folder is not a checkout with a virtual environment, or a measurement fails there.
    """
    programs = [_program(old), _program(new)]
    for name in what:
        measure = MEASUREMENTS[name]
        found: list[tuple[Speeds, Speeds]] = []
        for pair in range(pairs):
            turn = {number: measure(programs[number]) for number in ((0, 1) if pair % 2 == 0 else (1, 0))}
            found.append((turn[0], turn[1]))
        for label in sorted(set(found[0][0]) & set(found[0][1])):
            yield Comparison(
                f"{name}: {label}", tuple(after[label] / before[label] for before, after in found)
            )


def _program(checkout: Path) -> Path:
    """Return the `drlsl` command of a checkout.

    Raises:
        UserError: it does not exist.
    """
    program = checkout / ".venv" / "bin" / "drlsl"
    if not program.is_file():
        raise UserError(f"{checkout}: no .venv/bin/drlsl; name a checkout in which `make check` was run")
    return program.absolute()


def _run(program: Path, *arguments: str) -> str:
    """Return the output of a command, run in its checkout on one thread.

    Raises:
        UserError: it fails.
    """
    done = subprocess.run(
        [program, *arguments],
        cwd=program.parents[2],
        env={**os.environ, "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
    )
    if done.returncode != 0:
        problem = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise UserError(f"{program} {' '.join(arguments)} ended with {done.returncode}: {problem}")
    return done.stdout


def _bench(program: Path, part: str) -> Any:
    return json.loads(_run(program, "bench", part, "--runs", "1", "--json"))


def _rules(program: Path) -> Speeds:
    told = _bench(program, "rules")
    one = {
        f"{tier}, {vehicles} vehicles": 1 / time
        for tier, by_vehicles in told["one_scene_ms"].items()
        if tier not in FOREIGN
        for vehicles, time in by_vehicles.items()
    }
    return one | {f"{tier}, batch": 1 / time for tier, time in told["batch_us_per_scene"].items()}


def _env(program: Path) -> Speeds:
    return {f"{size} side by side": speed for size, speed in _bench(program, "env")["steps_per_s"].items()}


def _train(program: Path) -> Speeds:
    told = _bench(program, "train")
    return {"training": told["updates_per_s"], "bare updates": told["bare_updates_per_s"]}


def _query(program: Path) -> Speeds:
    """Return queries a second of processor time, each a process of its own."""
    state = str(program.parents[2] / "examples" / "scene.json")
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    for _ in range(QUERIES):
        _run(program, "query", "--state", state)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {"processor time": QUERIES / spent}


MEASUREMENTS: Final[dict[str, Callable[[Path], Speeds]]] = {
    "rules": _rules,
    "env": _env,
    "train": _train,
    "query": _query,
}
"""Measurements that can be compared."""
