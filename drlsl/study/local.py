"""Perform tasks in processes on this machine."""

import contextlib
import multiprocessing
import os
import signal
import sys
import threading
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path
from types import FrameType
from typing import Final

from drlsl.study.folder import Failure, StudyFolder
from drlsl.study.plan import Task
from drlsl.study.tasks import Perform
from drlsl.study.workers import Outcome

PATIENCE_S: Final = 30.0
"""Time limit for processes to save their work once they are asked to stop."""

TAIL: Final = 4_000
"""Characters of a process's last output that are kept with a failure."""

_context: Final = multiprocessing.get_context("spawn")


@dataclass(slots=True)
class _Worker:
    """A process that performs one task after another, and ends when one fails."""

    process: SpawnProcess
    connection: Connection
    task: Task | None = None


class LocalWorkers:
    """Up to `count` processes, each with one PyTorch thread.

    They are spawned, so they inherit nothing; each performs many tasks, because loading PyTorch takes longer
    than a short test. A process that fails in any way ends, and leaves its last output in the log.
    """

    def __init__(self, folder: StudyFolder, perform: Perform, count: int) -> None:
        self._folder = folder
        self._perform = perform
        self._count = count
        self._workers: list[_Worker] = []

    @property
    def busy(self) -> list[Task]:
        """The tasks in progress."""
        return [worker.task for worker in self._workers if worker.task is not None]

    @property
    def free(self) -> int:
        """The number of tasks that can be started now."""
        return self._count - len(self.busy)

    def start(self, task: Task) -> None:
        """Begin a task."""
        idle = [worker for worker in self._workers if worker.task is None and worker.process.is_alive()]
        worker = idle[0] if idle else self._spawn()
        worker.task = task
        # One that ends at this very moment is noticed by `wait`, as one that fails at the task.
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            worker.connection.send(task)

    def wait(self, timeout_s: float) -> list[Outcome]:
        """Return the tasks that ended; none if the time is up before."""
        at_work = [worker for worker in self._workers if worker.task is not None]
        ready = wait([worker.connection for worker in at_work], timeout_s)
        return [
            self._outcome(worker, worker.task)
            for worker in at_work
            if worker.task and worker.connection in ready
        ]

    def stop(self) -> None:
        """Tell all processes to save their work and end; kill those that take too long."""
        for worker in self._workers:
            worker.process.terminate()
        for worker in self._workers:
            worker.process.join(PATIENCE_S)
            if worker.process.is_alive():
                worker.process.kill()
                worker.process.join()
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
        process = _context.Process(target=_serve, args=(theirs, self._folder.root, self._perform))
        process.start()
        theirs.close()
        worker = _Worker(process, ours)
        self._workers.append(worker)
        return worker

    def _outcome(self, worker: _Worker, task: Task) -> Outcome:
        try:
            worker.connection.recv()
        except (EOFError, ConnectionResetError):
            worker.process.join()
            self._workers.remove(worker)
            return Outcome(task, _failure(worker.process.exitcode, self._folder.log(task)))
        worker.task = None
        return Outcome(task, None)


def _failure(status: int | None, log: Path) -> Failure:
    """Describe how a process ended: by its last line, or by the signal that ended it."""
    text = log.read_text("utf-8", errors="replace") if log.is_file() else ""
    lines = [line for line in text.splitlines() if line.strip()]
    if status is not None and status < 0:
        summary = f"the process was ended by {signal.Signals(-status).name}"
    elif lines:
        summary = lines[-1].removeprefix("drlsl.errors.UserError: ")
    else:
        summary = f"the process ended with status {status}"
    return Failure(summary, text[-TAIL:])


def _serve(connection: Connection, root: Path, perform: Perform) -> None:
    """Perform tasks as they arrive, until there are no more; an exception ends the process."""
    stopped = threading.Event()

    def note(number: int, frame: FrameType | None) -> None:
        stopped.set()

    # Ctrl-C reaches every process of a terminal; the parent process is the one to pass it on.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, note)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    folder = StudyFolder.open(root)
    while not stopped.is_set():
        try:
            # Waits in short turns, for a signal does not interrupt a wait.
            if not connection.poll(0.2):
                continue
            task: Task = connection.recv()
        except EOFError:
            return
        _speak_into(folder.log(task))
        perform(root, task, stopped.is_set)
        connection.send(task.name)


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
