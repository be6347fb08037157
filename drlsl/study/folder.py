"""The folder of a study: what is done is what lies in it, so that going on is to look what is missing."""

import hashlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Self

from drlsl.errors import UserError
from drlsl.files import FolderLock, check_text, open_values, seal_text, seal_values, write_atomic
from drlsl.learning import METRICS, RunFolder
from drlsl.study.plan import Run, StudyConfig, Task, dump_study, load_study

STUDY, INPUTS = "study.yaml", "inputs.json"
RUNS, EVALUATIONS, FAILURES, LOGS, REPORT = "runs", "evaluations", "failures", "logs", "report"
LOCK = Path(LOGS) / "study.lock"
"""What the command at work on the study holds."""

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
        _refuse_foreign(root)
        _make_folders(root)
        _write_json(root / INPUTS, inputs)
        write_atomic(root / STUDY, seal_text(dump_study(study)).encode())
        return cls(root, study)

    @classmethod
    def open(cls, root: Path) -> Self:
        """The study in a folder.

        Raises:
            UserError: there is none, or its configuration is not as it was written.
        """
        path = root / STUDY
        if not path.is_file():
            raise UserError(
                f"{root}: no study here (expected {STUDY}); `drlsl study --out {root}` starts one"
            )
        check_text(path, "put it back as it was; `drlsl study --config` begins a study with other settings")
        return cls(root, load_study(path))

    @classmethod
    def at_work(cls, root: Path) -> FolderLock:
        """Keep other commands from working on a study in this folder, which need not be there yet.

        Raises:
            UserError: another command is at work there, or something else is in the folder.
        """
        _refuse_foreign(root)
        _make_folders(root)
        return FolderLock(root, str(LOCK), "study")

    def locked(self, name: str, *, wait_s: float = 0.0) -> FolderLock:
        """A lock on a part of the study.

        Raises:
            UserError: another process holds it, and still does after `wait_s`.
        """
        return FolderLock(self.root, f"{LOGS}/{name}.lock", name, wait_s=wait_s)

    @property
    def inputs(self) -> dict[str, Any]:
        """What the results depend on beside the settings."""
        path, advice = self.root / INPUTS, "put back a copy of it, or choose another --out"
        inputs = _read_json(path, advice)
        # A damaged name of the checksum makes it one input more.
        if inputs.keys() != {"command", "digests"}:
            raise UserError(f"{path}: expected command and digests, found {', '.join(inputs)}; {advice}")
        return inputs

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
            values = _read_json(path)
            found.append(Failure(values["summary"], values["log"]))
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


def _refuse_foreign(root: Path) -> None:
    """Leave alone a folder in which there is something else than a study, or the beginnings of one.

    Raises:
        UserError: it is such a folder.
    """
    if not root.exists() or (root / STUDY).is_file():
        return
    if not root.is_dir() or not all(_is_beginning(path.relative_to(root)) for path in root.rglob("*")):
        raise UserError(f"{root}: not empty, and no study in it; choose another --out")


def _is_beginning(path: Path) -> bool:
    """Whether a command that was killed before it wrote `STUDY` may have left this."""
    name = str(path)
    return name in (RUNS, EVALUATIONS, FAILURES, LOGS, INPUTS, str(LOCK)) or name.startswith(
        (f".{INPUTS}.", f".{STUDY}.")
    )


def _make_folders(root: Path) -> None:
    try:
        for name in (RUNS, EVALUATIONS, FAILURES, LOGS):
            (root / name).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{root}: cannot make the study's folder: {error.strerror or error}") from error


def _write_json(path: Path, values: Mapping[str, Any]) -> None:
    write_atomic(path, seal_values(values).encode())


def _read_json(path: Path, advice: str = "delete it to have it made again") -> dict[str, Any]:
    try:
        return open_values(path.read_text("utf-8"))
    except (OSError, ValueError) as error:
        raise UserError(f"{path}: cannot be read ({error}); {advice}") from error
