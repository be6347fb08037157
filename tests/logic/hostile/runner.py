"""Run hostile cases one after the other in this process, and write for each how it ended and what it took.

A line of JSON for each case: its name, its end (an answer or an error of Prolog; anything else is a fault),
the processor time [s] and the highest memory of the process so far [bytes].
"""

from __future__ import annotations

import io
import json
import resource
import sys
import time

from drlsl.logic import Engine, Limits, PrologError
from tests.logic.hostile.corpus import CASES, Case

LIMITS = Limits(seconds=2.0)


def run(case: Case) -> str:
    """How a case ended."""
    engine = Engine(output=io.StringIO(), compiled=case.compiled, flags={"iso": "false"})
    try:
        engine.consult_text(case.program, limits=LIMITS)
        return str(engine.once(case.goal, limits=LIMITS) is not None)
    except PrologError as error:
        return f"{type(error).__name__}: {str(error)[:100]}"


def main(numbers: list[int]) -> None:
    """Run the cases of these numbers."""
    sys.stdin = io.StringIO()
    for number in numbers:
        case = CASES[number]
        start = time.process_time()
        try:
            end = run(case)
        except BaseException as error:  # noqa: BLE001  (what must not happen is what is looked for)
            end = f"fault: {type(error).__name__}: {str(error)[:200]}"
        seconds = time.process_time() - start
        highest = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
        sys.stdout.write(json.dumps([case.name[:120], end, round(seconds, 3), highest]) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main([int(number) for number in sys.argv[1:]])
