"""Coverage-guided fuzzing of loading and asking: ``python fuzz/fuzz_consult.py [-max_total_time=20]``.

The last line of an input is the goal, what precedes it the program.
"""

import io
import sys

import atheris

with atheris.instrument_imports(include=["drlsl.logic"]):
    import targets

    from drlsl.logic.jit import tiering as tiers


def one_input(data: bytes) -> None:
    """Load the text and ask the goal, with every predicate compiled at its first call."""
    program, _, goal = data.decode("utf-8", errors="replace").rpartition("\n")
    sys.stdin = io.StringIO("a. b(X) :- c.\n")
    targets.consult(program, goal)


if __name__ == "__main__":
    tiers._WORTH_IT = -1
    atheris.Setup(sys.argv, one_input)
    atheris.Fuzz()
