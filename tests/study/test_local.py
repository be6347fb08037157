"""Processes that do tasks: what is retried, what is given up, and what a failure leaves behind."""

from pathlib import Path

import pytest

from drlsl.study import Progress, StudyFolder, work, workers_of
from drlsl.study.plan import Run, Task
from drlsl.workers import Crew

from .fake import INPUTS, PAUSE, perform, study, tell_to_fail

TRAINING = Task(Run("m0", 1))


@pytest.fixture
def folder(tmp_path: Path) -> StudyFolder:
    return StudyFolder.prepare(tmp_path / "study", study(), INPUTS)


def work_off(folder: StudyFolder) -> Progress:
    """Where the study stands in the end."""
    return list(work(folder, workers_of(folder, Crew(2), perform)))[-1]


def attempts(folder: StudyFolder) -> list[str]:
    return (folder.root / "performed.txt").read_text().split()


def test_every_task_is_done_once_and_after_what_it_needs(folder: StudyFolder) -> None:
    last = work_off(folder)
    assert (last.done, last.given_up, last.total) == (16, 0, 16)
    done = attempts(folder)
    assert sorted(done) == sorted(task.name for task in folder.study.tasks)
    for task in folder.study.tasks:
        before = folder.study.needs(task)
        assert before is None or done.index(before.name) < done.index(task.name)
    assert work_off(folder).done == 16
    assert attempts(folder) == done


def test_a_failed_task_is_tried_once_more_and_then_given_up(folder: StudyFolder) -> None:
    told = {
        "m0-seed0": ("raise", 1, "told to fail at m0-seed0"),
        "m1-seed0.freeway": ("killed", 1, "the process was ended by SIGKILL"),
        "m1-seed0.left-to-right": ("silently", 1, "the process ended with status 3"),
        "m0-seed1": ("raise", 3, "told to fail at m0-seed1"),
        "m1-seed1.freeway": ("killed", 3, "the process was ended by SIGKILL"),
    }
    for name, (how, times, _) in told.items():
        tell_to_fail(folder.root, name, how, times)
    last = work_off(folder)
    # The tests of m0-seed1 are given up with it.
    assert (last.done, last.given_up) == (11, 5)
    for task in folder.study.tasks:
        failures = folder.failures(task)
        _, times, summary = told.get(task.name, ("", 0, ""))
        assert [failure.summary for failure in failures] == [summary] * min(times, 2)
        assert attempts(folder).count(task.name) == (
            0 if task.run == TRAINING.run and task.test else min(times, 1) + 1
        )
    assert "Traceback" in folder.failures(TRAINING)[0].log
    before = attempts(folder)
    assert work_off(folder).given_up == 5
    assert attempts(folder) == before


@pytest.mark.slow
def test_failures_before_an_interruption_count(folder: StudyFolder) -> None:
    tell_to_fail(folder.root, TRAINING.name, "killed", 3)
    for progress in work(folder, workers_of(folder, Crew(2), perform)):
        if progress.failure:
            break
    assert len(folder.failures(TRAINING)) == 1
    assert work_off(folder).given_up == 4
    assert len(folder.failures(TRAINING)) == 2


@pytest.mark.slow
def test_being_stopped_is_no_failure(folder: StudyFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(PAUSE, "0.05")

    def begun() -> bool:
        return any(folder.episodes_done(run) for run in folder.study.runs)

    for progress in work(folder, workers_of(folder, Crew(2), perform), begun):
        assert progress.failure is None
    assert not all(map(folder.is_done, folder.study.tasks))
    monkeypatch.setenv(PAUSE, "0")
    assert work_off(folder).done == 16
