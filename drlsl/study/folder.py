"""The folder of a study: a task is done when its result is here, so a resumed study does what is missing."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Self

from drlsl.driving.episodes import SUFFIX, Episode, save_episode
from drlsl.errors import UserError
from drlsl.files import FolderLock, check_text, open_values, seal_text, seal_values, write_atomic
from drlsl.learning import METRICS, RunFolder
from drlsl.study.plan import Run, StudyConfig, Task, dump_study, load_study
from drlsl.workers import Failure

STUDY, INPUTS = "study.yaml", "inputs.json"
RUNS, EVALUATIONS, FAILURES, LOGS, REPORT = "runs", "evaluations", "failures", "logs", "report"
CONTACTS = "contacts"
"""The folder of episodes that ended in a contact at fault."""

LOCK = Path(LOGS) / "study.lock"
"""What the command at work on the study holds."""

DONE = "trained.json"
"""The last file that a training writes into its run folder."""

ATTEMPTS = 2
"""Attempts at a task."""


class StudyFolder:
    """One study on disk."""

    def __init__(self, root: Path, study: StudyConfig) -> None:
        self.root = root
        self.study = study

    @classmethod
    def prepare(cls, root: Path, study: StudyConfig, inputs: Mapping[str, Any]) -> Self:
        """Make the folder, or resume the study in it, perhaps with more seeds, methods, tests or sweeps.

        `inputs` holds the command, and digests of all else besides the settings that the results depend on;
        the digests must not have changed.

        Raises:
            UserError: the folder holds another study or other files, or the inputs have changed since.
        """
        if (root / STUDY).is_file():
            inputs = _inputs_to_resume_with(root, study, inputs)
        _refuse_foreign(root)
        _make_folders(root)
        _write_json(root / INPUTS, inputs)
        write_atomic(root / STUDY, seal_text(dump_study(study)).encode())
        return cls(root, study)

    @classmethod
    def open(cls, root: Path) -> Self:
        """Return the study in a folder.

        Raises:
            UserError: the folder has no study, or its configuration was changed.
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
        """Lock the folder, which need not exist yet, against other commands.

        Raises:
            UserError: another command is using the folder, or it holds something else.
        """
        _refuse_foreign(root)
        _make_folders(root)
        return FolderLock(root, str(LOCK), "study")

    def locked(self, name: str, *, wait_s: float = 0.0) -> FolderLock:
        """Return a lock on a part of the study.

        Raises:
            UserError: another process holds it, and still does after `wait_s`.
        """
        return FolderLock(self.root, f"{LOGS}/{name}.lock", name, wait_s=wait_s)

    @property
    def inputs(self) -> dict[str, Any]:
        """All that the results depend on besides the settings."""
        path, advice = self.root / INPUTS, "put back a copy of it, or choose another --out"
        inputs = _read_json(path, advice)
        # A damaged name of the checksum makes it one input more.
        if inputs.keys() != {"command", "digests"}:
            raise UserError(f"{path}: expected command and digests, found {', '.join(inputs)}; {advice}")
        return inputs

    @property
    def report(self) -> Path:
        """The folder of the report."""
        return self.root / REPORT

    def run_path(self, run: Run) -> Path:
        """Return the run folder of a training."""
        return self.root / RUNS / run.name

    def run(self, run: Run) -> RunFolder:
        """Return a training that has begun.

        Raises:
            UserError: it has not begun, or its settings differ from the study's.
        """
        folder = RunFolder.open(self.run_path(run))
        if folder.config != self.study.training(run):
            raise UserError(
                f"{folder.root}: trained with other settings than {self.root / STUDY} has for it; "
                "delete that folder to train again"
            )
        return folder

    def episodes_done(self, run: Run) -> int:
        """Return the number of finished episodes of a training."""
        path = self.run_path(run) / METRICS
        return max(0, path.read_bytes().count(b"\n") - 1) if path.is_file() else 0

    def is_done(self, task: Task) -> bool:
        """Return whether a task has a result."""
        return self._result(task).is_file()

    def finish(self, task: Task, result: Mapping[str, Any]) -> None:
        """Record that a task is done."""
        _write_json(self._result(task), result)

    def result(self, task: Task) -> dict[str, Any]:
        """Return the recorded result of a task.

        Raises:
            UserError: the file is damaged.
        """
        return _read_json(self._result(task))

    def add_contact(self, task: Task, shield: str, episode: Episode) -> None:
        """Keep an episode of a test that ended in a contact."""
        name = f"{task.name}-shield-{shield}-{episode.origin.number:04}{SUFFIX}"
        try:
            (self.root / CONTACTS).mkdir(exist_ok=True)
        except OSError as error:
            raise UserError(f"{self.root / CONTACTS}: cannot be made: {error.strerror}") from error
        save_episode(self.root / CONTACTS / name, episode)

    def contacts(self) -> list[Path]:
        """Return the files of the episodes that were kept."""
        return sorted((self.root / CONTACTS).glob(f"*{SUFFIX}"))

    def log(self, task: Task) -> Path:
        """Return the file for the output of the process that performs a task."""
        return self.root / LOGS / f"{task.name}.log"

    def add_failure(self, task: Task, failure: Failure) -> None:
        """Record a failed attempt."""
        number = len(self.failures(task)) + 1
        _write_json(self.root / FAILURES / f"{task.name}.{number}.json", asdict(failure))

    def failures(self, task: Task) -> list[Failure]:
        """Return the failed attempts at a task, in order."""
        found: list[Failure] = []
        while (path := self.root / FAILURES / f"{task.name}.{len(found) + 1}.json").is_file():
            values = _read_json(path)
            found.append(Failure(values["summary"], values["log"]))
        return found

    def is_given_up(self, task: Task) -> bool:
        """Return whether all attempts at a task, or at the one that it needs, have failed."""
        if self.is_done(task):
            return False
        before = self.study.needs(task)
        return len(self.failures(task)) >= ATTEMPTS or (before is not None and self.is_given_up(before))

    def _result(self, task: Task) -> Path:
        if task.test is None:
            return self.run_path(task.run) / DONE
        return self.root / EVALUATIONS / f"{task.name}.json"


def _inputs_to_resume_with(root: Path, study: StudyConfig, inputs: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the inputs of the existing study, or the new ones if the study was extended."""
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
    """Check that a folder holds a study, the beginnings of one, or nothing.

    Raises:
        UserError: it holds something else.
    """
    if not root.exists() or (root / STUDY).is_file():
        return
    if not root.is_dir() or not all(_is_beginning(path.relative_to(root)) for path in root.rglob("*")):
        raise UserError(f"{root}: not empty, and no study in it; choose another --out")


def _is_beginning(path: Path) -> bool:
    """Return whether a command killed before it wrote `STUDY` may have left this file."""
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
