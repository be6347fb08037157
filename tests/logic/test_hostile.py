"""Hostile goals and files end within their limits: no hang, no process killed, no error but Prolog's."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.logic.hostile.corpus import CASES

ROOT = Path(__file__).parents[2]
# Processor time [s] of loading or of asking, 2 s of which the limits allow, and memory [bytes], that of the
# interpreter included.
MOST_SECONDS = 3.0
MOST_BYTES = 1 << 30


def check(numbers: list[int]) -> None:
    command = [sys.executable, "-m", "tests.logic.hostile.runner", *map(str, numbers)]
    done = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, timeout=60 * len(numbers), check=False
    )
    ends = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("[")]
    assert done.returncode == 0, (done.stderr[-2000:], CASES[numbers[len(ends)]].name)
    assert len(ends) == len(numbers)
    assert not [end for end in ends if end[1].startswith("fault")]
    assert not [end for end in ends if end[2] > MOST_SECONDS or end[3] > MOST_BYTES]


def test_the_corpus_is_large_and_without_repetitions() -> None:
    assert len(CASES) >= 300
    assert len({case.name for case in CASES}) == len(CASES)


@pytest.mark.skipif(sys.platform != "linux", reason="memory is measured as Linux tells it")
def test_a_sample_of_hostile_cases_ends_within_the_limits() -> None:
    check(list(range(5, len(CASES), 24)))


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="memory is measured as Linux tells it")
@pytest.mark.parametrize("part", range(24))
def test_every_hostile_case_ends_within_the_limits(part: int) -> None:
    check(list(range(part, len(CASES), 24)))
