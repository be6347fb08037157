"""The order of the tasks: what is ready, what is tried again, and when all is done."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

from drlsl.study.folder import Failure, StudyFolder
from drlsl.study.plan import Task
from drlsl.study.workers import Workers

TICK_S: Final = 0.5
"""How often progress is looked at."""


NOTHING_DONE: Final = Failure("the process stopped before the end", "")


@dataclass(frozen=True, slots=True)
class Progress:
    """Where a study stands."""

    done: int
    given_up: int
    total: int
    busy: list[Task]
    ended: Task | None = None
    """The task whose end this tells of."""
    failure: Failure | None = None
    """How it failed, if it did."""


def work(
    folder: StudyFolder, workers: Workers, stop: Callable[[], bool] = lambda: False
) -> Iterator[Progress]:
    """Do all that is missing, and tell where the study stands, at each task's end and every now and then.

    A task that failed is tried again, from where it was, `ATTEMPTS` times in all; failures lie in the folder,
    so those before an interruption count. Once `stop` holds, tasks in work are stopped.
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
            for task, failure in workers.wait(TICK_S):
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


def _start_ready(folder: StudyFolder, workers: Workers, open_tasks: list[Task]) -> None:
    busy = workers.busy
    ready = [
        task for task in open_tasks if task not in busy and (not task.needs or folder.is_done(task.needs))
    ]
    # Tests first: they are short, and a study that is stopped has the more to show.
    ready.sort(key=lambda task: task.test is None)
    for task in ready[: workers.free]:
        workers.start(task)


def _standing(
    folder: StudyFolder, workers: Workers, ended: Task | None = None, failure: Failure | None = None
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
