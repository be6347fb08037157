"""The interface of workers, which perform the tasks of a study: local processes, or a cluster."""

from typing import NamedTuple, Protocol

from drlsl.study.folder import Failure
from drlsl.study.plan import Task


class Outcome(NamedTuple):
    """A task that ended: done, stopped half-way, or failed."""

    task: Task
    failure: Failure | None


class Workers(Protocol):
    """Performs several tasks at once."""

    @property
    def busy(self) -> list[Task]:
        """The tasks in progress."""

    @property
    def free(self) -> int:
        """The number of tasks that can be started now."""

    def start(self, task: Task) -> None:
        """Begin a task."""

    def wait(self, timeout_s: float) -> list[Outcome]:
        """Return the tasks that ended; none if the time is up before."""

    def stop(self) -> None:
        """Stop the tasks in progress, so that they can be resumed."""

    def close(self) -> None:
        """Release all resources; no task is in progress."""
