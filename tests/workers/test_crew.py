"""Pure tasks: the same answers whoever performs them, also when a process is lost."""

import os
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from drlsl.errors import UserError
from drlsl.workers import ALONE, Crew, in_order

from .chores import counting_up, performed, squaring, tell


def squares(root: Path, crew: Crew, count: int) -> list[int]:
    return list(in_order(crew.perform(partial(squaring, root), range(count))))


def gone(process: int) -> bool:
    """Whether a process has ended."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    return False


@pytest.mark.parametrize("jobs", [1, 2, 3])
def test_answers_are_the_same_for_any_number_of_processes(tmp_path: Path, jobs: int) -> None:
    assert squares(tmp_path, Crew(jobs), 7) == [0, 1, 4, 9, 16, 25, 36]
    processes = {process for _, process in performed(tmp_path)}
    assert len(processes) <= jobs
    assert (os.getpid() in processes) == (jobs == 1)
    assert jobs == 1 or all(map(gone, processes))


def test_no_more_processes_than_tasks(tmp_path: Path) -> None:
    assert squares(tmp_path, Crew(8), 1) == [0]
    assert len({process for _, process in performed(tmp_path)}) == 1


@pytest.mark.parametrize("crew", [ALONE, Crew(2)])
def test_a_task_may_depend_on_the_answers_before(tmp_path: Path, crew: Crew) -> None:
    total = 0

    def tasks() -> Iterator[int]:
        number = 0
        while total < 30:
            number += 1
            yield number

    for square in in_order(crew.perform(partial(squaring, tmp_path), tasks())):
        total += square
    assert total == 30 if crew == ALONE else total >= 30


def test_the_task_of_a_lost_process_is_done_again(tmp_path: Path) -> None:
    tell(tmp_path, "killed", 1)
    tell(tmp_path, "killed", 4, times=2)
    with pytest.warns(UserWarning, match="done again: the process was ended by SIGKILL"):
        assert squares(tmp_path, Crew(2), 6) == [0, 1, 4, 9, 16, 25]
    tried = [number for number, _ in performed(tmp_path)]
    assert [tried.count(number) for number in range(6)] == [1, 2, 1, 1, 3, 1]


@pytest.mark.filterwarnings("ignore:a task was lost")
def test_a_task_that_is_always_lost_is_given_up(tmp_path: Path) -> None:
    tell(tmp_path, "killed", 2, times=9)
    with pytest.raises(UserError, match="lost 3 times: the process was ended by SIGKILL; is there enough"):
        squares(tmp_path, Crew(2), 4)


@pytest.mark.parametrize("crew", [ALONE, Crew(2)])
def test_what_a_task_raises_ends_the_work(tmp_path: Path, crew: Crew) -> None:
    (tmp_path / "slow.0").touch() if crew != ALONE else None
    tell(tmp_path, "key", 1)
    started = time.monotonic()
    with pytest.raises(KeyError):
        squares(tmp_path, crew, 50)
    assert time.monotonic() - started < 25.0
    assert all(map(gone, {process for _, process in performed(tmp_path)} - {os.getpid()}))


@pytest.mark.parametrize("crew", [ALONE, Crew(2)])
def test_a_task_says_how_far_it_is(crew: Crew) -> None:
    heard: list[tuple[int, int]] = []
    numbers = [3, 5, 0]
    answers = in_order(crew.perform(counting_up, numbers, heard=lambda *said: heard.append(said)))
    assert list(answers) == [9, 25, 0]
    for number in numbers:
        assert [said for task, said in heard if task == number] == list(range(number))


def test_an_error_that_cannot_be_sent_is_told_in_words(tmp_path: Path) -> None:
    tell(tmp_path, "awkward", 0)
    with pytest.raises(RuntimeError, match="AwkwardError: this is awkward"):
        squares(tmp_path, Crew(2), 2)


def test_processes_end_when_no_more_answers_are_wanted(tmp_path: Path) -> None:
    (tmp_path / "slow.3").touch()
    answers = Crew(2).perform(partial(squaring, tmp_path), range(4))
    assert next(answers)
    answers.close()  # type: ignore[attr-defined]
    assert all(gone(process) for _, process in performed(tmp_path))
