"""The interface of workers, and what becomes of a task."""

from __future__ import annotations

import pickle
import traceback
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from typing import Any, Generic, Protocol, TypeAlias, TypeVar

from drlsl.errors import UserError

Task = TypeVar("Task")
Answer = TypeVar("Answer")

Stop: TypeAlias = Callable[[], bool]
"""Tells a task whether it should stop, and leave what it did to be resumed."""

Function: TypeAlias = Callable[[Task, Stop], Answer]
"""Performs one task after another, and keeps what they share.

One that is a generator yields how far it is, and returns the answer at the end.
"""

Make: TypeAlias = Callable[[], "Function[Any, Any]"]
"""Makes the function, once in each process. It is pickled, and the module that defines it imported there."""


Hear: TypeAlias = Callable[[Any], None]
"""Hears how far a task is, whatever the task says of that."""


@dataclass(frozen=True, slots=True)
class Failure:
    """A failed attempt at a task: one line for people, and the last output of its process."""

    summary: str
    log: str


@dataclass(frozen=True, slots=True)
class Outcome(Generic[Task, Answer]):
    """A task that ended: with an answer, or with a failure.

    `error` is the exception that the task raised; a failure without one means that its process or its node
    ended, and that the task may succeed elsewhere.
    """

    task: Task
    answer: Answer | None = None
    failure: Failure | None = None
    error: Exception | None = None


class Workers(Protocol[Task, Answer]):
    """Performs several tasks at once."""

    @property
    def busy(self) -> list[Task]:
        """The tasks in progress."""

    @property
    def free(self) -> int:
        """The number of tasks that can be started now."""

    def start(self, task: Task) -> None:
        """Begin a task."""

    def wait(self, timeout_s: float) -> list[Outcome[Task, Answer]]:
        """Return the tasks that ended; none if the time is up before."""

    def stop(self) -> None:
        """Stop the tasks in progress, and release all resources."""

    def close(self) -> None:
        """Release all resources; no task is in progress."""


def followed(steps: Generator[Any, None, Answer], hear: Hear = lambda _: None) -> Answer:
    """Return what a generator returns; `hear` is called with what it yields before."""
    while True:
        try:
            said = next(steps)
        except StopIteration as end:
            answer: Answer = end.value
            return answer
        hear(said)


def attempt(make: Make, task: Task, stop: Stop, hear: Hear = lambda _: None) -> Outcome[Task, Any]:
    """Perform a task, and return what became of it; `hear` is called with what it says on the way."""
    try:
        answer = make()(task, stop)
        return Outcome(task, followed(answer, hear) if isinstance(answer, Generator) else answer)
    except Exception as error:  # noqa: BLE001  (returned)
        line = "".join(traceback.format_exception_only(error)).strip().splitlines()[-1]
        summary = line.removeprefix(f"{UserError.__module__}.{UserError.__name__}: ")
        return Outcome(task, None, Failure(summary, traceback.format_exc()), error)


def portable(outcome: Outcome[Task, Any]) -> Outcome[Task, Any]:
    """Return an outcome that another process can read: some exceptions cannot be pickled, or not be read."""
    if outcome.error is None or outcome.failure is None:
        return outcome
    try:
        pickle.loads(pickle.dumps(outcome.error))  # noqa: S301  (pickled here)
    except Exception:  # noqa: BLE001  (whatever the exception's own code raises)
        return replace(outcome, error=RuntimeError(outcome.failure.summary))
    return outcome
