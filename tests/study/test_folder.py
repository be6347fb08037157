"""What a study's folder lets in, and what it says is done."""

from pathlib import Path

import pytest

from drlsl.errors import UserError
from drlsl.files import digest
from drlsl.learning.rundir import CONFIG
from drlsl.study import StudyFolder
from drlsl.study.plan import Run, Task
from drlsl.study.results import collect
from drlsl.workers import Failure

from .fake import INPUTS, perform, study


@pytest.fixture
def folder(tmp_path: Path) -> StudyFolder:
    return StudyFolder.prepare(tmp_path / "study", study(1, 1), INPUTS)


def test_a_study_grows_and_keeps_what_it_has(folder: StudyFolder) -> None:
    perform(folder.root, Task(Run("m0", 0)), lambda: False)
    with_more = {"command": "drlsl study --seeds 2", "digests": {**INPUTS["digests"], "rules/paper.pl": "d"}}
    grown = StudyFolder.prepare(folder.root, study(2, 2), with_more)
    assert grown.is_done(Task(Run("m0", 0)))
    assert len(grown.study.tasks) == 16
    assert grown.inputs == with_more
    assert StudyFolder.open(folder.root).study == study(2, 2)


def test_the_command_that_began_a_study_stays(folder: StudyFolder) -> None:
    StudyFolder.prepare(folder.root, folder.study, {**INPUTS, "command": "drlsl study --jobs 1"})
    assert folder.inputs["command"] == INPUTS["command"]


@pytest.mark.parametrize("other", [study(1, 1, episodes=13), study(1, 1).model_copy(update={"seeds": 0})])
def test_another_study_is_kept_out(folder: StudyFolder, other: object) -> None:
    with pytest.raises(UserError, match="holds another study"):
        StudyFolder.prepare(folder.root, other, INPUTS)  # type: ignore[arg-type]  # parametrised
    assert StudyFolder.open(folder.root).study == study(1, 1)


def test_changed_rules_are_noticed(folder: StudyFolder) -> None:
    with pytest.raises(UserError, match=r"rules/highway\.pl has changed since the study began"):
        StudyFolder.prepare(
            folder.root, folder.study, {"command": "", "digests": {"rules/highway.pl": "new"}}
        )


def test_a_folder_of_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(UserError, match="not empty, and no study in it"):
        StudyFolder.prepare(tmp_path, study(), INPUTS)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_a_run_with_other_settings_is_not_taken_for_the_studys(folder: StudyFolder) -> None:
    run = Run("m0", 0)
    perform(folder.root, Task(run), lambda: False)
    path = folder.run_path(run) / CONFIG
    path.write_text(path.read_text().replace("discount: 0.95", "discount: 0.5"))
    with pytest.raises(UserError, match="changed by hand"):
        collect(folder)


def test_a_task_is_given_up_after_two_failures(folder: StudyFolder) -> None:
    training, test = Task(Run("m0", 0)), Task(Run("m0", 0), "freeway")
    folder.add_failure(training, Failure("first", "log"))
    assert not folder.is_given_up(training)
    folder.add_failure(training, Failure("second", "log"))
    assert folder.is_given_up(training)
    assert folder.is_given_up(test)
    assert [failure.summary for failure in folder.failures(training)] == ["first", "second"]
    assert folder.failures(test) == []


def test_a_damaged_result_is_an_error(folder: StudyFolder) -> None:
    task = Task(Run("m0", 0), "freeway")
    perform(folder.root, task, lambda: False)
    (folder.root / "evaluations" / f"{task.name}.json").write_text('{"evaluations": [')
    with pytest.raises(UserError, match=r"m0-seed0\.freeway\.json: cannot be read .* delete it"):
        collect(folder)


def test_a_lock_is_held_by_one(folder: StudyFolder) -> None:
    with folder.locked("x"):
        with (
            pytest.raises(UserError, match=r"study: process \d+ on \S+ is at work here \(x\)"),
            folder.locked("x"),
        ):
            pass
        with folder.locked("y"):
            pass
    with folder.locked("x"):
        pass


def test_digests_tell_contents_and_order(tmp_path: Path) -> None:
    one, other = tmp_path / "one", tmp_path / "other"
    one.write_text("a")
    other.write_text("b")
    found = {digest([one]), digest([other]), digest([one, other]), digest([other, one])}
    assert len(found) == 4
