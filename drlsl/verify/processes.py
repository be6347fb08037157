"""Several processes that work on tasks side by side; leaving the context ends them at once."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection, wait
from types import TracebackType
from typing import Any, Final, Generic, TypeVar

from drlsl.errors import UserError

Task = TypeVar("Task")
Result = TypeVar("Result")

_CONTEXT: Final = multiprocessing.get_context("spawn")


class WorkerDied(UserError):
    """A process ended without an answer, for example because memory ran out."""


class Workers(Generic[Task, Result]):
    """Processes that apply one function, each to one task at a time.

    `prepare`, called once in each process, makes the function from `arguments`.
    """

    def __init__(self, count: int, prepare: Callable[..., Callable[[Task], Result]], *arguments: Any) -> None:
        self._pipes: list[Connection] = []
        self._processes = []
        for _ in range(count):
            ours, theirs = _CONTEXT.Pipe()
            process = _CONTEXT.Process(target=_work, args=(theirs, prepare, arguments), daemon=True)
            self._pipes.append(ours)
            self._processes.append((process, theirs))

    def __enter__(self) -> Workers[Task, Result]:
        for process, theirs in self._processes:
            process.start()
            theirs.close()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for process, _ in self._processes:
            process.terminate()
        for process, _ in self._processes:
            process.join()
        for pipe in self._pipes:
            pipe.close()

    def results(self, next_task: Callable[[], Task | None]) -> Iterator[Result]:
        """Yield the results as they become ready; `next_task` returns None if there are no more tasks.

        Raises:
            WorkerDied: a process ended without an answer.
        """
        busy = [pipe for pipe in self._pipes if _hand_out(pipe, next_task)]
        while busy:
            for pipe in wait(busy):
                assert isinstance(pipe, Connection)
                try:
                    failed, result = pipe.recv()
                except EOFError:
                    raise WorkerDied(
                        "a worker process ended without an answer; is there enough memory?"
                    ) from None
                if failed:
                    raise result
                yield result
                if not _hand_out(pipe, next_task):
                    busy.remove(pipe)


def _hand_out(pipe: Connection, next_task: Callable[[], Any]) -> bool:
    task = next_task()
    if task is not None:
        pipe.send(task)
    return task is not None


def _work(pipe: Connection, prepare: Callable[..., Callable[[Any], Any]], arguments: tuple[Any, ...]) -> None:
    """Perform tasks in a process until it is ended."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent process handles it
    function = None
    while True:
        try:
            task = pipe.recv()
        except EOFError:
            return
        try:
            function = function or prepare(*arguments)
            answer = (False, function(task))
        except BaseException as error:  # noqa: BLE001  (raised again in the parent)
            answer = (True, error)
        pipe.send(answer)
