"""Tasks in processes of this machine."""

import contextlib
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path
from types import FrameType
from typing import Any, Final, TypeAlias

from drlsl.workers.outcome import Failure, Make, Outcome, attempt, portable

LogOf: TypeAlias = Callable[[Any], Path]
"""Gives the file for the output of a task's process."""

PATIENCE_S: Final = 30.0
"""Time limit for processes to save their work once they are asked to stop."""

TAIL: Final = 4_000
"""Characters of a process's last output that are kept with a failure."""

_context: Final = multiprocessing.get_context("spawn")


Heard: TypeAlias = Callable[[Any, Any], None]
"""Hears of a task what it says on the way."""


@dataclass(frozen=True, slots=True)
class _Word:
    """Something that a task says on the way to its answer."""

    value: Any


@dataclass(slots=True)
class _Worker:
    """A process that performs one task after another, and ends when one fails."""

    process: SpawnProcess
    connection: Connection
    task: Any = None


class LocalWorkers:
    """Up to `count` processes of this machine.

    They are spawned, so they inherit nothing; each performs many tasks, because it may have much to load
    first. A process that fails in any way ends. With `log`, a function that gives the file for the output of
    a task, that keeps what was said; else the output is this process's. `saves`: when they are stopped, tasks
    in progress are asked to, and have `PATIENCE_S` to save what they did; else they are ended at once.
    `heard` is called while one waits.
    """

    def __init__(
        self,
        make: Make,
        count: int,
        *,
        log: LogOf | None = None,
        saves: bool = False,
        heard: Heard = lambda _, __: None,
    ) -> None:
        self._make = make
        self._count = count
        self._log = log
        self._saves = saves
        self._heard = heard
        self._workers: list[_Worker] = []

    @property
    def busy(self) -> list[Any]:
        """The tasks in progress."""
        return [worker.task for worker in self._workers if worker.task is not None]

    @property
    def free(self) -> int:
        """The number of tasks that can be started now."""
        return self._count - len(self.busy)

    def start(self, task: Any) -> None:
        """Begin a task."""
        idle = [worker for worker in self._workers if worker.task is None and worker.process.is_alive()]
        worker = idle[0] if idle else self._spawn()
        worker.task = task
        # One that ends at this very moment is noticed by `wait`, as one that fails at the task.
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            worker.connection.send(task)

    def wait(self, timeout_s: float) -> list[Outcome[Any, Any]]:
        """Return the tasks that ended; none if the time is up before, or a task said something."""
        at_work = [worker for worker in self._workers if worker.task is not None]
        ready = wait([worker.connection for worker in at_work], timeout_s)
        found = [self._outcome(worker) for worker in at_work if worker.connection in ready]
        return [outcome for outcome in found if outcome is not None]

    def stop(self) -> None:
        """Tell all processes to save their work and end; kill those that do not, or take too long."""
        for worker in self._workers:
            worker.process.terminate()
        for worker in self._workers:
            worker.process.join(PATIENCE_S)
            if worker.process.is_alive():
                worker.process.kill()
                worker.process.join()
            worker.connection.close()
        self._workers.clear()

    def close(self) -> None:
        """End all processes, which are idle."""
        for worker in self._workers:
            worker.connection.close()
        for worker in self._workers:
            worker.process.join()
        self._workers.clear()

    def _spawn(self) -> _Worker:
        ours, theirs = _context.Pipe()
        process = _context.Process(target=_serve, args=(theirs, self._make, self._log, self._saves))
        process.start()
        theirs.close()
        worker = _Worker(process, ours)
        self._workers.append(worker)
        return worker

    def _outcome(self, worker: _Worker) -> Outcome[Any, Any] | None:
        """Return what became of a worker's task; nothing if it only said something."""
        task = worker.task
        try:
            told: Outcome[Any, Any] | _Word = worker.connection.recv()
        except (EOFError, ConnectionResetError):
            worker.process.join()
            told = Outcome(task, None, _failure(worker.process.exitcode, self._said(task)))
        if isinstance(told, _Word):
            self._heard(task, told.value)
            return None
        outcome, worker.task = told, None
        if outcome.failure is None:
            return outcome
        worker.process.join()
        worker.connection.close()
        self._workers.remove(worker)
        said = self._said(task)
        return outcome if not said else replace(outcome, failure=replace(outcome.failure, log=said[-TAIL:]))

    def _said(self, task: Any) -> str:
        """Return what a task's process put out, if that is kept."""
        log = None if self._log is None else self._log(task)
        return log.read_text("utf-8", errors="replace") if log is not None and log.is_file() else ""


def _failure(status: int | None, said: str) -> Failure:
    """Describe how a process ended: by its last line, or by the signal that ended it."""
    lines = [line for line in said.splitlines() if line.strip()]
    if status is not None and status < 0:
        return Failure(f"the process was ended by {signal.Signals(-status).name}", said[-TAIL:])
    if lines:
        return Failure(lines[-1], said[-TAIL:])
    return Failure(f"the process ended with status {status}", said[-TAIL:])


def _serve(connection: Connection, make: Make, log: LogOf | None, saves: bool) -> None:
    """Perform tasks as they arrive, until there are no more; one that fails ends the process."""
    stopped = threading.Event()

    def note(number: int, frame: FrameType | None) -> None:
        stopped.set()

    # Ctrl-C reaches every process of a terminal; the parent process is the one to pass it on.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, note if saves else signal.SIG_DFL)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    made = lru_cache(make)
    while not stopped.is_set():
        try:
            # Waits in short turns, for a signal does not interrupt a wait.
            if not connection.poll(0.2):
                continue
            task = connection.recv()
        except EOFError:
            return
        if log is not None:
            _speak_into(log(task))
        outcome = attempt(made, task, stopped.is_set, lambda value: connection.send(_Word(value)))
        if outcome.failure is not None and log is not None:
            sys.stderr.write(outcome.failure.log)
            sys.stderr.flush()
        connection.send(portable(outcome))
        if outcome.failure is not None:
            return


def _end_with_parent() -> None:
    """End at once when the parent process is killed, so that no worker is left behind."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _speak_into(log: Path) -> None:
    """Redirect this process's stdout and stderr, output of native code included, into a file."""
    sys.stdout.flush()
    sys.stderr.flush()
    with log.open("wb") as file:
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)
