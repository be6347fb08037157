"""One flipped bit anywhere in what a study reads back: refused by name, or of no consequence."""

import random
from pathlib import Path

import pandas as pd
import pytest

from drlsl.errors import UserError
from drlsl.study import StudyFolder
from drlsl.study.plan import Run, Task
from drlsl.study.results import Results, collect
from drlsl.workers import Failure

from .fake import INPUTS, perform, study

FLIPS = [pytest.param(25, id="sample"), pytest.param(500, id="all", marks=pytest.mark.slow)]
FILES = (
    "study.yaml",
    "inputs.json",
    "runs/*/config.yaml",
    "runs/*/trained.json",
    "runs/*/metrics.csv",
    "evaluations/*.json",
    "failures/*.json",
)


@pytest.fixture
def folder(tmp_path: Path) -> StudyFolder:
    folder = StudyFolder.prepare(tmp_path / "study", study(1, 1, episodes=3), INPUTS)
    for task in folder.study.tasks:
        perform(folder.root, task, lambda: False)
    folder.add_failure(Task(Run("m0", 0)), Failure("the process was ended by SIGKILL", "a line\nanother"))
    return folder


def same(one: Results, other: Results) -> bool:
    frames = ((one.training, other.training), (one.tests, other.tests), (one.sweeps, other.sweeps))
    rest = [(each.study, each.attempts, each.missing, each.inputs, each.makers) for each in (one, other)]
    return all(pd.DataFrame.equals(*pair) for pair in frames) and rest[0] == rest[1]


@pytest.mark.parametrize("count", FLIPS)
@pytest.mark.parametrize("file", FILES)
def test_a_flipped_bit_changes_no_result(folder: StudyFolder, file: str, count: int) -> None:
    path = sorted(folder.root.glob(file))[0]
    whole, content, draw = collect(folder), path.read_bytes(), random.Random(12)
    refused = 0
    for place in [draw.randrange(8 * len(content)) for _ in range(count)]:
        copy = bytearray(content)
        copy[place // 8] ^= 1 << place % 8
        path.write_bytes(copy)
        try:
            found = collect(StudyFolder.open(folder.root))
        except UserError as error:
            refused += path.name in str(error) and "\n" not in str(error)
        else:
            assert same(found, whole), f"bit {place} of {file}"
            refused += 1
    assert refused == count
