"""Run hostile cases one after the other in this process, and write for each how it ended and what it took.

A line of JSON for each case: its name, its end (an answer or an error of Prolog; anything else is a fault),
the processor time [s] of loading its program or of asking its goal, whichever took longer, and the highest
memory of the process while it ran [bytes]. Linux only.
"""

from __future__ import annotations

import gc
import io
import json
import sys
import time
from pathlib import Path

from drlsl.logic import Engine, Limits, PrologError
from tests.logic.hostile.corpus import CASES, Case

LIMITS = Limits(seconds=2.0)
# Linux starts its record of the highest memory anew when this is written there.
_FORGET_HIGHEST = "5"


def load(case: Case) -> Engine | str:
    """An engine with the program of a case, or the error of loading it."""
    engine = Engine(output=io.StringIO(), compiled=case.compiled, flags={"iso": "false"})
    try:
        engine.consult_text(case.program, limits=LIMITS)
    except PrologError as error:
        return shown(error)
    return engine


def ask(engine: Engine, case: Case) -> str:
    """How the goal of a case ended."""
    try:
        return str(engine.once(case.goal, limits=LIMITS) is not None)
    except PrologError as error:
        return shown(error)


def shown(error: PrologError) -> str:
    """An error in one short line."""
    return f"{type(error).__name__}: {str(error)[:100]}"


def run(case: Case) -> tuple[str, float]:
    """How a case ended, and the processor time [s] of its longer part."""
    start = time.process_time()
    loaded = load(case)
    middle = time.process_time()
    end = loaded if isinstance(loaded, str) else ask(loaded, case)
    del loaded
    return end, max(middle - start, time.process_time() - middle)


def highest_bytes() -> int:
    """The highest memory of this process since it was last forgotten [bytes]."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) * 1024
    raise OSError("/proc/self/status has no line VmHWM")


def main(numbers: list[int]) -> None:
    """Run the cases of these numbers."""
    sys.stdin = io.StringIO()
    for number in numbers:
        case = CASES[number]
        gc.collect()  # what the case before left in cycles is not this one's
        Path("/proc/self/clear_refs").write_text(_FORGET_HIGHEST)
        start = time.process_time()
        try:
            end, seconds = run(case)
        except BaseException as error:  # noqa: BLE001  (what must not happen is what is looked for)
            end = f"fault: {type(error).__name__}: {str(error)[:200]}"
            seconds = time.process_time() - start
        sys.stdout.write(json.dumps([case.name[:120], end, round(seconds, 3), highest_bytes()]) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main([int(number) for number in sys.argv[1:]])
