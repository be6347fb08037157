"""A folder of Prolog programs, such as the set of van Roy, each timed beside SWI-Prolog in the same run.

Each program is a file with a goal ``top`` (or ``main``) without arguments. Two times are measured for each:
that of the first call in a fresh engine, including compilation, and that of a repeated call.
"""

from __future__ import annotations

import gc
import io
import math
import shutil
import statistics
import subprocess
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Final

from drlsl.benchmarks.inference_speed import rare_collections
from drlsl.logic import Engine, Limits, PrologError, Query

_GOALS: Final = ("top", "main")
_LONGEST_S: Final = 60.0
# Repeated calls are measured over this time, since clocks tick and one call may take a microsecond.
_MEASURED_S: Final = 0.15
_WARM_UP_CALLS: Final = 3
# SWI-Prolog's side: first and repeated time, and whether the goal holds, as the last line of standard error.
_SWIPL_GOAL: Final = (
    "statistics(cputime, A), (catch({goal}, _, fail) -> Holds = true ; Holds = false),"
    " statistics(cputime, B), First is B - A,"
    " N is max(3, min(20000, integer({measured} / max(First, 1.0e-6)))), statistics(cputime, C),"
    " forall(between(1, N, _), (catch({goal}, _, fail) -> true ; true)), statistics(cputime, D),"
    " Repeated is (D - C) / N, format(user_error, '~n~w ~w ~w~n', [Holds, First, Repeated])"
)


@dataclass(frozen=True)
class Times:
    """Processor times of one program's goal: of the first call and of each later one [s], and if it held."""

    holds: bool
    first: float
    repeated: float

    SHORTEST: ClassVar[float] = 1e-7
    """Least time of a call [s], used if the clock measures 0."""


@dataclass(frozen=True)
class Comparison:
    """A program's medians here and in SWI-Prolog; `problem` is the reason if it is not rated."""

    program: str
    here: Times | None = None
    swipl: Times | None = None
    problem: str = ""


def compare_folder(folder: Path, runs: int) -> Iterator[Comparison]:
    """Time each program of a folder alternately here and in SWI-Prolog; yield the medians of the runs.

    Raises:
        FileNotFoundError: SWI-Prolog is not installed, or the folder has no programs.
    """
    if shutil.which("swipl") is None:
        raise FileNotFoundError("swipl")
    paths = sorted(folder.glob("*.pl"))
    if not paths:
        raise FileNotFoundError(str(folder / "*.pl"))
    for path in paths:
        yield _compare(path, runs)


def geometric_mean(ratios: list[float]) -> float:
    """Return the geometric mean of positive numbers."""
    return math.exp(statistics.fmean(map(math.log, ratios)))


def _compare(path: Path, runs: int) -> Comparison:
    here: list[Times] = []
    swipl: list[Times] = []
    options: tuple[str, ...] = ()
    try:
        for _ in range(runs):
            goal, times = _time_here(path)
            here.append(times)
            swipl.append(_time_swipl(path, goal, options))
            if len(swipl) == 1 and swipl[0].holds is not times.holds:
                # Old programs may need lists of '.'/2, which SWI-Prolog has only on request.
                options = ("--traditional",)
                swipl[0] = _time_swipl(path, goal, options)
    except (PrologError, LookupError) as error:
        return Comparison(path.stem, problem=str(error).splitlines()[0])
    except (subprocess.SubprocessError, ValueError):
        return Comparison(path.stem, problem="SWI-Prolog does not run it")
    if here[0].holds is not swipl[0].holds:
        return Comparison(path.stem, problem="the answers differ")
    return Comparison(path.stem, _median(here), _median(swipl))


def _median(times: list[Times]) -> Times:
    first = statistics.median(each.first for each in times)
    return Times(times[0].holds, first, statistics.median(each.repeated for each in times))


def _goal(engine: Engine) -> str:
    for goal in _GOALS:
        if engine.defines(goal, 0):
            return goal
    raise LookupError(f"it defines neither {' nor '.join(f'{goal}/0' for goal in _GOALS)}")


def _time_here(path: Path) -> tuple[str, Times]:
    engine = Engine(flags={"iso": "false"}, output=io.StringIO())
    engine.consult(path)
    goal = _goal(engine)
    query = engine.prepare(goal)
    limits = Limits(seconds=_LONGEST_S)
    with rare_collections():
        start = time.process_time()
        holds = query.holds(limits)
        first = time.process_time() - start
        if first < _MEASURED_S:
            for _ in range(_WARM_UP_CALLS):
                query.holds(limits)
        gc.collect()
        return goal, Times(holds, first, _repeated(query, limits))


def _repeated(query: Query, limits: Limits) -> float:
    start = now = time.process_time()
    calls = 0
    while now - start < _MEASURED_S:
        query.holds(limits)
        calls += 1
        now = time.process_time()
    return (now - start) / calls


def _time_swipl(path: Path, goal: str, options: tuple[str, ...]) -> Times:
    measure = _SWIPL_GOAL.format(goal=goal, measured=_MEASURED_S)
    command = ["swipl", "-q", "-f", "none", *options, "-g", measure, "-t", "halt", str(path)]
    done = subprocess.run(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, timeout=_LONGEST_S, check=True
    )
    holds, first, repeated = done.stderr.split()[-3:]
    return Times(holds == "true", float(first), float(repeated))
