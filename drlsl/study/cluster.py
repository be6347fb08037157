"""Tasks on a Ray cluster."""

import logging
import re
import signal
import socket
from pathlib import Path
from typing import Any, Final

import ray
import ray.exceptions

from drlsl.errors import UserError
from drlsl.study.folder import Failure, StudyFolder
from drlsl.study.plan import Task
from drlsl.study.tasks import Perform
from drlsl.study.workers import Outcome

ANSWER_S: Final = 10.0
"""Time limit for a cluster to answer."""

_COLOUR: Final = re.compile(r"\x1b\[\d+m")


class RayWorkers:
    """As many tasks at once as the cluster has processors, each with one PyTorch thread.

    Every node must see the study's folder at the same path, and have the same version of this package. Ray
    does not retry: the study does, and counts.
    """

    def __init__(self, folder: StudyFolder, perform: Perform, address: str) -> None:
        """Join the cluster at an address, or the one that this node belongs to ("auto").

        Raises:
            UserError: there is no cluster.
        """
        _knock(address)
        # Ray puts a handler of its own in place of the one that has the study stop in good order.
        on_terminate = signal.getsignal(signal.SIGTERM)
        try:
            ray.init(address=address, log_to_driver=False, logging_level=logging.WARNING)
        except (ConnectionError, ValueError, RuntimeError) as error:
            raise UserError(f"--ray {address}: no Ray cluster there ({error})") from error
        signal.signal(signal.SIGTERM, on_terminate)
        self._root = folder.root.resolve()
        self._remote = ray.remote(num_cpus=1, max_retries=0)(_perform)
        self._perform = perform
        self._refs: dict[Any, Task] = {}

    @property
    def busy(self) -> list[Task]:
        """The tasks in progress, or waiting for a processor."""
        return list(self._refs.values())

    @property
    def free(self) -> int:
        """The number of tasks that can be started now; nodes may come and go."""
        return max(1, int(ray.cluster_resources().get("CPU", 0))) - len(self._refs)

    def start(self, task: Task) -> None:
        """Begin a task."""
        self._refs[self._remote.remote(self._perform, self._root, task)] = task

    def wait(self, timeout_s: float) -> list[Outcome]:
        """Return the tasks that ended; none if the time is up before."""
        ready, _ = ray.wait(list(self._refs), num_returns=1, timeout=timeout_s)
        return [Outcome(self._refs.pop(ref), _failure(ref)) for ref in ready]

    def stop(self) -> None:
        """End the tasks in progress; each can be resumed from its last checkpoint."""
        for ref in self._refs:
            ray.cancel(ref, force=True)
        if self._refs:
            ray.wait(list(self._refs), num_returns=len(self._refs), timeout=30)
        self._refs.clear()
        self.close()

    def close(self) -> None:
        """Leave the cluster."""
        ray.shutdown()


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


def _perform(perform: Perform, root: Path, task: Task) -> None:
    """Run a task on a node; a task that is no longer wanted is ended from outside."""
    perform(root, task, lambda: False)


def _failure(ref: Any) -> Failure | None:
    """Return how a task failed; None if it did not."""
    try:
        ray.get(ref)
    except ray.exceptions.RayTaskError as error:
        text = _COLOUR.sub("", str(error)).strip()
        return Failure(text.splitlines()[-1].removeprefix("drlsl.errors.UserError: "), text)
    except ray.exceptions.RayError as error:
        # Its text names processes and nodes, which differ from run to run.
        return Failure(f"the process or its node ended ({type(error).__name__})", str(error))
    return None
