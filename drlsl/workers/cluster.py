"""Tasks on a Ray cluster."""

import contextlib
import io
import logging
import os
import pickle
import platform
import signal
import socket
import sys
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TextIO

import ray
import ray.exceptions

from drlsl.errors import UserError
from drlsl.files import digest
from drlsl.version import __version__
from drlsl.workers.outcome import Failure, Function, Make, Outcome, attempt, portable

ANSWER_S: Final = 10.0
"""Time limit for a cluster to answer."""

LISTENER: Final = "ray_listen_error_messages"
"""The thread of Ray that prints, with `log_to_driver` or without."""


class RayWorkers:
    """As many tasks at once as the cluster has processors, each on one of them.

    Every node must have the same version of this package, and see the files that tasks name at the same
    paths; it checks `files` before it works. Ray does not retry: who asked for the task does, and counts.
    """

    def __init__(self, make: Make, address: str, files: Sequence[Path] = ()) -> None:
        """Join the cluster at an address, or the one that this node belongs to ("auto").

        Raises:
            UserError: there is no cluster.
        """
        _knock(address)
        # Ray puts a handler of its own in place of one that has the command stop in good order.
        on_terminate = signal.getsignal(signal.SIGTERM)
        try:
            ray.init(address=address, log_to_driver=False, logging_level=logging.WARNING)
        except (ConnectionError, ValueError, RuntimeError) as error:
            raise UserError(f"--ray {address}: {_why_not(error)}") from error
        signal.signal(signal.SIGTERM, on_terminate)
        self._stdout = sys.stdout
        sys.stdout = _WithoutRay(self._stdout)
        digests = {str(path): digest([path]) for path in files}
        # Stored once, for it may hold a whole rule program.
        self._order = ray.put(_Order(__version__, os.getcwd(), digests, pickle.dumps(make)))
        self._remote = ray.remote(num_cpus=1, max_retries=0)(_perform)
        self._refs: dict[Any, Any] = {}

    @property
    def busy(self) -> list[Any]:
        """The tasks in progress, or waiting for a processor."""
        return list(self._refs.values())

    @property
    def free(self) -> int:
        """The number of tasks that can be started now; nodes may come and go."""
        return max(1, int(ray.cluster_resources().get("CPU", 0))) - len(self._refs)

    def start(self, task: Any) -> None:
        """Begin a task."""
        self._refs[self._remote.remote(self._order, task)] = task

    def wait(self, timeout_s: float) -> list[Outcome[Any, Any]]:
        """Return the tasks that ended; none if the time is up before."""
        ready, _ = ray.wait(list(self._refs), num_returns=1, timeout=timeout_s)
        return [_outcome(ref, self._refs.pop(ref)) for ref in ready]

    def stop(self) -> None:
        """End the tasks in progress; each that saves its work can be resumed."""
        for ref in self._refs:
            ray.cancel(ref, force=True)
        if self._refs:
            ray.wait(list(self._refs), num_returns=len(self._refs), timeout=30)
        self._refs.clear()
        self.close()

    def close(self) -> None:
        """Leave the cluster."""
        # Ray prints what it has held back.
        with contextlib.redirect_stdout(io.StringIO()):
            ray.shutdown()
        sys.stdout = self._stdout


class _WithoutRay:
    """A stream without what Ray prints of lost workers, which would be in the middle of a command's JSON."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write a text, unless it is Ray's."""
        if threading.current_thread().name == LISTENER:
            return len(text)
        return self._stream.write(text)

    def __getattr__(self, name: str) -> Any:
        """Return what the stream itself has."""
        return getattr(self._stream, name)


def _knock(address: str) -> None:
    """Make sure that something answers at an address: Ray itself gives up after five minutes, and exits.

    Raises:
        UserError: the address is not HOST:PORT or auto, or nothing answers there.
    """
    if address == "auto":
        return
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if not (host and port.isdecimal()):
        raise UserError(f"--ray {address}: expected HOST:PORT of a Ray cluster, or auto")
    try:
        socket.create_connection((host, int(port)), timeout=ANSWER_S).close()
    except (OSError, OverflowError) as error:
        raise UserError(f"--ray {address}: no Ray cluster there ({error})") from error


def _why_not(error: BaseException) -> str:
    """Return why a cluster was not joined."""
    cause: BaseException | None = error
    while cause is not None:
        if type(cause).__name__ == "AuthenticationError":  # of Ray since 2.49
            return "the Ray cluster there asks for a token; set RAY_AUTH_MODE=token, or start it without"
        cause = cause.__cause__
    return f"no Ray cluster there ({error})"


@dataclass(frozen=True, slots=True)
class _Order:
    """All that a node needs besides the tasks, with which it checks that it is like the command's machine.

    `digests` of files by their names, as seen from `folder`; `make` is pickled.
    """

    version: str
    folder: str
    digests: dict[str, str]
    make: bytes


def _perform(order: _Order, task: Any) -> Outcome[Any, Any]:
    """Perform a task on a node; one that is no longer wanted is ended from outside."""
    return portable(attempt(lambda: _function(order), task, lambda: False))


_functions: Final[dict[bytes, Function[Any, Any]]] = {}
"""The function that this process of a node performs tasks with, kept for its next task."""


def _function(order: _Order) -> Function[Any, Any]:
    """Return the function that performs tasks.

    Raises:
        UserError: this node is not like the machine of the command.
    """
    if order.make not in _functions:
        _check_node(order)
        _functions.clear()
        _functions[order.make] = pickle.loads(order.make)()  # noqa: S301  (Ray itself unpickles what nodes are sent)
    return _functions[order.make]


def _check_node(order: _Order) -> None:
    """Check that this node is like the machine of the command; enter the same folder, where it has one.

    Raises:
        UserError: it has another version of DRLSL, or other files.
    """
    node = platform.node()
    if order.version != __version__:
        raise UserError(
            f"{node} has DRLSL {__version__}, and the machine of the command {order.version}; "
            "install the same version on every node"
        )
    if Path(order.folder).is_dir():
        os.chdir(order.folder)
    for name, expected in order.digests.items():
        if not Path(name).is_file():
            raise UserError(f"{node} has no {name}; put it at the same place on every node")
        if digest([Path(name)]) != expected:
            raise UserError(f"{name} on {node} differs from that on the machine of the command")


def _outcome(ref: Any, task: Any) -> Outcome[Any, Any]:
    """Return what became of a task that ended."""
    try:
        outcome: Outcome[Any, Any] = ray.get(ref)
    except ray.exceptions.RayTaskError as error:
        # The task was not even begun, for example since the node has no DRLSL.
        last = str(error).strip().splitlines()[-1]
        problem = UserError(f"a node of the cluster cannot perform tasks: {last}")
        return Outcome(task, None, Failure(str(problem), str(error)), problem)
    except ray.exceptions.RayError as error:
        # Its text names processes and nodes, which differ from run to run.
        told = f"the process or its node ended ({type(error).__name__})"
        return Outcome(task, None, Failure(told, str(error)))
    return outcome
