"""The order of the tasks: which are ready, which are tried again, and when the study is done."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

from drlsl.study.folder import StudyFolder
from drlsl.study.plan import Task
from drlsl.study.tasks import Perform, perform
from drlsl.workers import Crew, Failure, Stop, Workers

TICK_S: Final = 0.5
"""Interval between checks of the progress."""


NOTHING_DONE: Final = Failure("the process stopped before the end", "")


@dataclass(frozen=True, slots=True)
class Progress:
    """The state of a study in progress."""

    done: int
    given_up: int
    total: int
    busy: list[Task]
    ended: Task | None = None
    """The task that has just ended."""
    failure: Failure | None = None
    """Its failure, if it failed."""


def workers_of(folder: StudyFolder, crew: Crew, do: Perform = perform) -> Workers[Task, None]:
    """Return workers that perform the tasks of a study, also those of one job in a process of its own.

    Raises:
        UserError: there is no such cluster.
    """
    # Nodes of a cluster are in other folders.
    at_home = StudyFolder(folder.root.resolve(), folder.study)
    return crew.workers(partial(_performing, at_home.root, do), log=at_home.log, saves=True)


def _performing(root: Path, do: Perform) -> Callable[[Task, Stop], None]:
    return partial(do, root)


def work(folder: StudyFolder, workers: Workers[Task, None], stop: Stop = lambda: False) -> Iterator[Progress]:
    """Perform all missing tasks; yield the progress at the end of each task, and at intervals.

    A failed task is resumed, up to `ATTEMPTS` attempts in all; failures are kept in the folder, so those
    before an interruption count. Once `stop` holds, the tasks in progress are stopped.
    """
    tasks = folder.study.tasks
    try:
        while True:
            open_tasks = [task for task in tasks if not (folder.is_done(task) or folder.is_given_up(task))]
            _start_ready(folder, workers, open_tasks)
            if not workers.busy:
                yield _standing(folder, workers)
                workers.close()
                return
            for outcome in workers.wait(TICK_S):
                task, failure = outcome.task, outcome.failure
                problem = failure if folder.is_done(task) or failure else NOTHING_DONE
                if problem is not None:
                    folder.add_failure(task, problem)
                yield _standing(folder, workers, task, problem)
            yield _standing(folder, workers)
            if stop():
                return
    finally:
        # Also when the caller ends the iteration, or an error does.
        workers.stop()


def _start_ready(folder: StudyFolder, workers: Workers[Task, None], open_tasks: list[Task]) -> None:
    busy = workers.busy
    needs = folder.study.needs
    ready = [
        task
        for task in open_tasks
        if task not in busy and ((before := needs(task)) is None or folder.is_done(before))
    ]
    # Tests first: they are short, so a stopped study has more results.
    ready.sort(key=lambda task: task.test is None)
    for task in ready[: workers.free]:
        workers.start(task)


def _standing(
    folder: StudyFolder,
    workers: Workers[Task, None],
    ended: Task | None = None,
    failure: Failure | None = None,
) -> Progress:
    tasks = folder.study.tasks
    return Progress(
        done=sum(map(folder.is_done, tasks)),
        given_up=sum(map(folder.is_given_up, tasks)),
        total=len(tasks),
        busy=workers.busy,
        ended=ended,
        failure=failure,
    )
