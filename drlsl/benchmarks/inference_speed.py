"""The speed of the engine: inferences per second, and ten small programs, beside SWI-Prolog if installed.

A logical inference is a call of a predicate, builtins such as is/2 included, as SWI-Prolog's statistics/2
counts them. The numbers of inferences are fixed here, so that both systems are credited with the same work.
"""

from __future__ import annotations

import gc
import shutil
import statistics
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from drlsl.logic import Engine

PROGRAMS: Final = Path(__file__).parents[2] / "benchmarks" / "programs"

# bench(Size, Answer) of each program: a size that takes a fraction of a second when compiled, and the right
# answer.
SIZES: Final[dict[str, int]] = {
    "append": 3000,
    "nrev": 300,
    "tak": 16,
    "queens": 6,
    "zebra": 3,
    "deriv": 1000,
    "poly_10": 10,
    "crypt": 60,
    "query": 30,
    "browse": 200,
}

# Inferences: nrev 496 for each of Size + 1 lists of 30; the others as counted by SWI-Prolog.
_NREV, _NREV_INFERENCES = 600, 601 * 496
_FIB, _FIB_INFERENCES = 19, 27_057
_QUEENS, _QUEENS_INFERENCES = 8, 63_740
_PLAIN_NREV, _PLAIN_NREV_INFERENCES = 60, 61 * 496
_SWI_TIMEOUT_S: Final = 300


@dataclass(frozen=True)
class Timing:
    """One program's times [s], the median of several runs; None if SWI-Prolog is not installed."""

    program: str
    size: int
    compiled: float
    plain: float
    swipl: float | None


def inferences_per_second(runs: int = 5) -> dict[str, float]:
    """Return logical inferences per second of the engine and, with the prefix ``swipl_``, of SWI-Prolog."""
    cases = (
        ("nrev30_lips", "nrev", _NREV, _NREV_INFERENCES),
        ("fib_lips", "fib", _FIB, _FIB_INFERENCES),
        ("queens8_lips", "queens", _QUEENS, _QUEENS_INFERENCES),
    )
    found = {}
    for key, program, size, inferences in cases:
        found[key] = inferences / _median(program, size, runs, compiled=True)
    seconds = _median("nrev", _PLAIN_NREV, runs, compiled=False)
    found["plain_nrev30_lips"] = _PLAIN_NREV_INFERENCES / seconds
    for key, program, size, inferences in cases:
        swipl = _swipl(program, size, runs)
        if swipl is not None:
            found[f"swipl_{key}"] = inferences / swipl
    return found


def program_times(runs: int = 3) -> list[Timing]:
    """Return the times of the ten programs."""
    return [
        Timing(
            program,
            size,
            _median(program, size, runs, compiled=True),
            _median(program, size, runs, compiled=False),
            _swipl(program, size, runs),
        )
        for program, size in SIZES.items()
    ]


def load(program: str, *, compiled: bool) -> Engine:
    """Return an engine with one of the benchmark programs.

    Raises:
        FileNotFoundError: The programs are only in a checkout of the project, not in an installed package.
    """
    engine = Engine(compiled=compiled)
    engine.consult(PROGRAMS / f"{program}.pl")
    return engine


@contextmanager
def rare_collections() -> Iterator[None]:
    """Have Python's collector search for cycles less often, for programs that build many terms."""
    before = gc.get_threshold()
    gc.collect()
    gc.set_threshold(50_000, 20, 20)
    try:
        yield
    finally:
        gc.set_threshold(*before)


def _median(program: str, size: int, runs: int, *, compiled: bool) -> float:
    """Return the median of the processor time [s] of a program's bench/2, after one run to compile it."""
    engine = load(program, compiled=compiled)
    query = engine.prepare(f"bench({size}, _)")
    times = []
    with rare_collections():
        if compiled:
            query.holds()
        for _ in range(runs):
            start = time.process_time()
            query.holds()
            times.append(time.process_time() - start)
    return statistics.median(times)


def _swipl(program: str, size: int, runs: int) -> float | None:
    """Return the same median for SWI-Prolog, or None if it is not installed.

    Short programs are repeated within a run, since SWI-Prolog's clock ticks in milliseconds.
    """
    swipl = shutil.which("swipl")
    if swipl is None:
        return None
    goal = (
        f"bench({size}, _), findall(T, (between(1, {runs}, _), statistics(cputime, A),"
        f" forall(between(1, 10, _), bench({size}, _)), statistics(cputime, B), T is (B - A) / 10), Ts),"
        " forall(member(T, Ts), (print(T), nl))"
    )
    command = [swipl, "-q", "-g", goal, "-t", "halt", str(PROGRAMS / f"{program}.pl")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=_SWI_TIMEOUT_S, check=True)
    return statistics.median(float(line) for line in done.stdout.split())
