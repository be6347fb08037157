"""Who does the tasks of a study: processes on this machine, or a cluster."""

from typing import NamedTuple, Protocol

from drlsl.study.folder import Failure
from drlsl.study.plan import Task


class Outcome(NamedTuple):
    """A task that ended: done, stopped half-way, or failed."""

    task: Task
    failure: Failure | None


class Workers(Protocol):
    """Does several tasks at once."""

    @property
    def busy(self) -> list[Task]:
        """The tasks in work."""

    @property
    def free(self) -> int:
        """How many more tasks can be started."""

    def start(self, task: Task) -> None:
        """Begin a task."""

    def wait(self, timeout_s: float) -> list[Outcome]:
        """The tasks that ended; none if the time is up before."""

    def stop(self) -> None:
        """Stop the tasks in work, so that they can be gone on with."""

    def close(self) -> None:
        """Let go of what is held; no task is in work."""
