"""The folder of a study: what is done is what lies in it, so that going on is to look what is missing."""

import contextlib
import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Self

import filelock

from drlsl.errors import UserError
from drlsl.learning.checkpoint import write_atomic
from drlsl.learning.rundir import METRICS, RunFolder
from drlsl.study.plan import Run, StudyConfig, Task, dump_study, load_study

STUDY, INPUTS = "study.yaml", "inputs.json"
RUNS, EVALUATIONS, FAILURES, LOGS, REPORT = "runs", "evaluations", "failures", "logs", "report"
DONE = "trained.json"
"""The last file that a training writes into its run folder."""

ATTEMPTS = 2
"""How often a task is tried."""


@dataclass(frozen=True, slots=True)
class Failure:
    """An attempt at a task that failed: one line for people, and what its process last wrote."""

    summary: str
    log: str


class StudyFolder:
    """One study on disk."""

    def __init__(self, root: Path, study: StudyConfig) -> None:
        self.root = root
        self.study = study

    @classmethod
    def prepare(cls, root: Path, study: StudyConfig, inputs: Mapping[str, Any]) -> Self:
        """Make the folder, or go on with the study in it, perhaps with more seeds, methods, tests or sweeps.

        `inputs` holds the command, and digests of all that the results depend on beside the settings, which
        must be what they were.

        Raises:
            UserError: something else is there, another study, or its inputs have changed since.
        """
        if (root / STUDY).is_file():
            inputs = _inputs_to_go_on_with(root, study, inputs)
        elif root.exists() and (not root.is_dir() or any(root.iterdir())):
            raise UserError(f"{root}: not empty, and no study in it; choose another --out")
        try:
            for name in (RUNS, EVALUATIONS, FAILURES, LOGS):
                (root / name).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UserError(f"{root}: cannot make the study's folder: {error.strerror or error}") from error
        _write_json(root / INPUTS, inputs)
        write_atomic(root / STUDY, dump_study(study).encode())
        return cls(root, study)

    @classmethod
    def open(cls, root: Path) -> Self:
        """The study in a folder.

        Raises:
            UserError: there is none, or its configuration is not valid.
        """
        if not (root / STUDY).is_file():
            raise UserError(
                f"{root}: no study here (expected {STUDY}); `drlsl study --out {root}` starts one"
            )
        return cls(root, load_study(root / STUDY))

    @contextlib.contextmanager
    def locked(self, name: str = "study", *, wait_s: float = 0.0) -> Iterator[None]:
        """Hold a lock that ends with the process, however it ends.

        Raises:
            UserError: another process holds it, and still does after `wait_s`.
        """
        lock = filelock.FileLock(self.root / LOGS / f"{name}.lock")
        try:
            with lock.acquire(timeout=wait_s):
                yield
        except filelock.Timeout:
            raise UserError(
                f"{self.root}: another process is at work here ({name}); wait for it, or stop it"
            ) from None

    @property
    def inputs(self) -> dict[str, Any]:
        """What the results depend on beside the settings."""
        return _read_json(self.root / INPUTS)

    @property
    def report(self) -> Path:
        """Where the report is written."""
        return self.root / REPORT

    def run_path(self, run: Run) -> Path:
        """The run folder of a training."""
        return self.root / RUNS / run.name

    def run(self, run: Run) -> RunFolder:
        """A training that was begun.

        Raises:
            UserError: there is none, or it had other settings than the study says.
        """
        folder = RunFolder.open(self.run_path(run))
        if folder.config != self.study.training(run):
            raise UserError(
                f"{folder.root}: trained with other settings than {self.root / STUDY} has for it; "
                "delete that folder to train again"
            )
        return folder

    def episodes_done(self, run: Run) -> int:
        """Episodes that a training has behind it."""
        path = self.run_path(run) / METRICS
        return max(0, path.read_bytes().count(b"\n") - 1) if path.is_file() else 0

    def is_done(self, task: Task) -> bool:
        """Whether a task's result is there."""
        return self._result(task).is_file()

    def finish(self, task: Task, result: Mapping[str, Any]) -> None:
        """Record that a task is done."""
        _write_json(self._result(task), result)

    def result(self, task: Task) -> dict[str, Any]:
        """What was recorded when the task was done.

        Raises:
            UserError: the file is damaged.
        """
        return _read_json(self._result(task))

    def log(self, task: Task) -> Path:
        """Where the process at work on a task writes what it has to say."""
        return self.root / LOGS / f"{task.name}.log"

    def add_failure(self, task: Task, failure: Failure) -> None:
        """Record a failed attempt."""
        number = len(self.failures(task)) + 1
        _write_json(self.root / FAILURES / f"{task.name}.{number}.json", asdict(failure))

    def failures(self, task: Task) -> list[Failure]:
        """The attempts at a task that failed, in order."""
        found: list[Failure] = []
        while (path := self.root / FAILURES / f"{task.name}.{len(found) + 1}.json").is_file():
            found.append(Failure(**_read_json(path)))
        return found

    def is_given_up(self, task: Task) -> bool:
        """Whether a task failed as often as it is tried, or what it needs did."""
        if self.is_done(task):
            return False
        before = task.needs
        return len(self.failures(task)) >= ATTEMPTS or (before is not None and self.is_given_up(before))

    def _result(self, task: Task) -> Path:
        if task.test is None:
            return self.run_path(task.run) / DONE
        return self.root / EVALUATIONS / f"{task.name}.json"


def digest(paths: list[Path]) -> str:
    """SHA-256 over the contents of files, in order."""
    total = hashlib.sha256()
    for path in paths:
        total.update(hashlib.sha256(path.read_bytes()).digest())
    return total.hexdigest()


def _inputs_to_go_on_with(root: Path, study: StudyConfig, inputs: Mapping[str, Any]) -> Mapping[str, Any]:
    """The inputs of the study that is there, or of this one if it adds to that."""
    before = StudyFolder.open(root)
    if not study.extends(before.study):
        raise UserError(
            f"{root}: holds another study (see {STUDY} there); seeds, methods, tests and sweeps can be added "
            "to it, anything else needs another --out"
        )
    known = before.inputs
    for name, value in known["digests"].items():
        if inputs["digests"].get(name) != value:
            raise UserError(
                f"{root}: {name} has changed since the study began; put it back, or choose another --out"
            )
    return known if study == before.study else inputs


def _write_json(path: Path, values: Mapping[str, Any]) -> None:
    write_atomic(path, f"{json.dumps(values, indent=1, allow_nan=False)}\n".encode())


def _read_json(path: Path) -> dict[str, Any]:
    try:
        values: dict[str, Any] = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError) as error:
        raise UserError(f"{path}: cannot be read ({error}); delete it to have it made again") from error
    return values
