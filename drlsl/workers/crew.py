"""Performers of tasks, and pure tasks performed by them: an answer depends on its task alone."""

from __future__ import annotations

import os
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeVar

from drlsl.errors import UserError
from drlsl.workers.local import Heard, LocalWorkers
from drlsl.workers.outcome import Make, Outcome, Stop, Workers, attempt

Answer = TypeVar("Answer")

ATTEMPTS: Final = 3
"""Attempts at a task whose process or node ends."""

TICK_S: Final = 0.5
"""Time after which workers are asked again whether more of them are free: nodes of a cluster come and go."""


@dataclass(frozen=True, slots=True)
class Crew:
    """The performers of tasks: `jobs` processes, 1 meaning this one alone, or the Ray cluster at `ray`.

    That is an address, HOST:PORT, or auto for the cluster that this machine belongs to; `jobs` then does not
    matter, since the cluster's processors decide.
    """

    jobs: int = 1
    ray: str | None = None

    def workers(
        self,
        make: Make,
        *,
        log: Callable[[Any], Path] | None = None,
        saves: bool = False,
        files: Sequence[Path] = (),
        heard: Heard = lambda _, __: None,
    ) -> Workers[Any, Any]:
        """Return workers that perform tasks with the function that `make` makes.

        `log`, `saves` and `heard` as for `LocalWorkers`, which is chosen even for one job; `files` as for
        `perform`. A cluster does not tell how far a task is.

        Raises:
            UserError: there is no such cluster, or the extra ray is missing.
        """
        if self.ray is None:
            return LocalWorkers(make, self.jobs, log=log, saves=saves, heard=heard)
        try:
            from drlsl.workers.cluster import RayWorkers
        except ImportError as error:
            raise UserError("--ray needs the extra 'ray': pip install 'drlsl[ray]'") from error
        return RayWorkers(make, self.ray, files)

    def perform(
        self,
        make: Make,
        tasks: Iterable[Any],
        *,
        files: Sequence[Path] = (),
        heard: Heard = lambda _, __: None,
    ) -> Iterator[tuple[int, Any]]:
        """Yield the answer to each task, with the task's number from 0, in the order in which they end.

        A task is taken from `tasks` when a worker is free, so `tasks` may depend on the answers before. One
        whose process or node ends is done again, up to `ATTEMPTS` times. `files` are what the answers depend
        on besides the tasks; a node of a cluster that has others refuses to work. `heard` is called with a
        task and what its function yields before it has the answer, while one waits for the next answer; not
        on a cluster.

        Raises:
            UserError: a task was lost `ATTEMPTS` times, a node has other files, or as `workers`.
            Exception: whatever a task raises; the others are stopped.
        """
        if self == ALONE:
            workers: Workers[Any, Any] = _ThisProcess(make, heard)
        else:
            numbered = _Numbered(make)
            workers = self.workers(numbered, files=files, heard=lambda task, said: heard(task[1], said))
        yield from _performed(workers, enumerate(tasks))


ALONE: Final = Crew()
"""This process alone."""


def in_order(answers: Iterable[tuple[int, Answer]]) -> Iterator[Answer]:
    """Yield the answers of `Crew.perform` in the order of their tasks."""
    waiting: dict[int, Answer] = {}
    number = 0
    for found, answer in answers:
        waiting[found] = answer
        while number in waiting:
            yield waiting.pop(number)
            number += 1


def cores() -> int:
    """Return the number of processors that this process may use."""
    # os.process_cpu_count is newer than the oldest Python that we support.
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@dataclass(frozen=True, slots=True)
class _Numbered:
    """Makes a function of numbered tasks."""

    make: Make

    def __call__(self) -> Callable[[tuple[int, Any], Stop], Any]:
        function = self.make()
        return lambda task, stop: function(task[1], stop)


class _ThisProcess:
    """A single worker: this process performs a task when it is waited for."""

    def __init__(self, make: Make, heard: Heard) -> None:
        self._make, self._heard = make, heard
        self._function: Any = None
        self._task: tuple[int, Any] | None = None

    @property
    def busy(self) -> list[Any]:
        """The task to perform."""
        return [] if self._task is None else [self._task]

    @property
    def free(self) -> int:
        """1 if there is no task to perform."""
        return int(self._task is None)

    def start(self, task: tuple[int, Any]) -> None:
        """Take a task."""
        self._task = task

    def wait(self, timeout_s: float) -> list[Outcome[Any, Any]]:
        """Perform the task."""
        task, self._task = self._task, None
        if task is None:
            return []
        return [attempt(self._made, task, lambda: False, lambda said: self._heard(task[1], said))]

    def stop(self) -> None:
        """Do nothing: nothing is in progress."""

    close = stop

    def _made(self) -> Any:
        self._function = self._function or _Numbered(self._make)()
        return self._function


def _performed(
    workers: Workers[tuple[int, Any], Any], tasks: Iterator[tuple[int, Any]]
) -> Iterator[tuple[int, Any]]:
    lost: Counter[int] = Counter()
    again: list[tuple[int, Any]] = []
    try:
        while True:
            while workers.free > 0:
                task = again.pop(0) if again else next(tasks, None)
                if task is None:
                    break
                workers.start(task)
            if not workers.busy:
                workers.close()
                return
            for outcome in workers.wait(TICK_S):
                number = outcome.task[0]
                if outcome.failure is None:
                    yield number, outcome.answer
                elif outcome.error is not None:
                    raise outcome.error
                else:
                    lost[number] += 1
                    why = outcome.failure.summary
                    if lost[number] == ATTEMPTS:
                        raise UserError(f"a task was lost {ATTEMPTS} times: {why}; is there enough memory?")
                    again.append(outcome.task)
                    warnings.warn(f"a task was lost, and is done again: {why}", stacklevel=2)
    finally:
        # Also when the caller ends the iteration, or an error does.
        workers.stop()
