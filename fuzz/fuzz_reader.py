"""Coverage-guided fuzzing of the reader: ``python fuzz/fuzz_reader.py [CORPUS] [-max_total_time=20]``."""

import sys

import atheris

with atheris.instrument_imports(include=["drlsl.logic"]):
    import targets


def one_input(data: bytes) -> None:
    """Read the bytes as a text."""
    targets.read(data.decode("utf-8", errors="replace"))


if __name__ == "__main__":
    atheris.Setup(sys.argv, one_input)
    atheris.Fuzz()
