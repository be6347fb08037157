"""The folder of a training run: its files, written whole and kept consistent."""

from __future__ import annotations

import csv
import dataclasses
import hashlib
import io
import json
import os
import shutil
import tempfile
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from drlsl.errors import UserError
from drlsl.files import (
    DamagedError,
    FolderLock,
    check_text,
    open_values,
    seal_text,
    seal_values,
    write_atomic,
)
from drlsl.learning.config import TrainConfig, dump_yaml, load_config
from drlsl.learning.episode import EpisodeSummary

if TYPE_CHECKING:
    import pandas as pd

    from drlsl.learning.trainer import EpisodeEvent

CONFIG, METRICS, CHECKPOINT = "config.yaml", "metrics.csv", "checkpoint.pt"
POLICY, EVALUATION, FIGURES = "policy.pt", "evaluation.json", "figures"
TENSORBOARD = "tensorboard"

MODEL = "model.zip"
"""The model of a training with sb3-contrib."""

LOCK, EVALUATION_LOCK = ".lock", ".evaluation.lock"

LOCK_S = 10.0
"""Time limit for another process to finish writing an evaluation."""

_COLUMN_OF = {"total_return": "return"}
"""Columns named differently from their field."""
METRIC_COLUMNS = [
    "episode",
    "total_steps",
    *(
        _COLUMN_OF.get(field.name, field.name)
        for field in dataclasses.fields(EpisodeSummary)
        if field.default is dataclasses.MISSING
    ),
    "epsilon",
    "learning_rate",
    "loss",
    "wall_s",
]
"""The columns of metrics.csv with the paper's reward."""

_TRUTHS = ("contact", "at_fault", "off_road")
"""Columns that hold 0 or 1 and mean false or true."""

TRAINING = "training"
"""Purpose of the lock on a run folder, for its error."""

START_AGAIN = "put back a copy of it, or start again with --force"
"""Advice if the rows that a run resumes from are missing."""


def metric_columns(config: TrainConfig) -> list[str]:
    """Return the columns of metrics.csv: one more for each term of the reward beyond the paper's."""
    terms = [f"reward_{term}" for term in config.env.reward.single_terms]
    return [*METRIC_COLUMNS, *(name for name in terms if name not in METRIC_COLUMNS)]


class RunFolder:
    """One run on disk: config.yaml, metrics.csv, checkpoint.pt, policy.pt, evaluation.json and figures/."""

    def __init__(self, root: Path, config: TrainConfig) -> None:
        self.root = root
        self.config = config
        self.columns = metric_columns(config)
        """The columns of metrics.csv."""
        self.checkpoint = root / CHECKPOINT
        """The file of the learner's state."""
        self.policy = root / POLICY
        """The file of the network's weights."""
        self.figures = root / FIGURES
        """The folder of the training figures."""
        self.tensorboard = root / TENSORBOARD
        """The folder of the event files for TensorBoard."""

    @classmethod
    def create(cls, root: Path, config: TrainConfig, *, force: bool = False) -> Self:
        """Make the folder, whole or not at all; `force` replaces an earlier run.

        Raises:
            UserError: the folder exists and is not empty, or `force` would delete files not written by a run.
        """
        refuse_occupied(root, force=force)
        if root.exists():
            # A run training there would lose its folder. Not held: Windows cannot move an open file.
            FolderLock(root, LOCK, TRAINING).release()
        cls._make(root, config)
        return cls(root, config)

    @staticmethod
    def _make(root: Path, config: TrainConfig) -> None:
        """Make the folder aside and move it to its place."""
        try:
            root.parent.mkdir(parents=True, exist_ok=True)
            made = Path(tempfile.mkdtemp(prefix=f".{root.name}.", dir=root.parent))
            try:
                made.chmod(0o755)
                write_atomic(made / CONFIG, seal_text(dump_yaml(config)).encode())
                write_atomic(made / METRICS, _header(metric_columns(config)).encode())
                _put_in_place(made, root)
            except BaseException:
                shutil.rmtree(made, ignore_errors=True)
                raise
        except OSError as error:
            raise UserError(f"{root}: cannot make the run folder: {error.strerror or error}") from error

    @classmethod
    def open(cls, root: Path) -> Self:
        """Open an existing run.

        Raises:
            UserError: there is no run in the folder, or its configuration was changed.
        """
        path = root / CONFIG
        if not path.is_file():
            raise UserError(f"{root}: no run here (expected {CONFIG}); `drlsl train --out {root}` starts one")
        check_text(path, "put it back as it was; `drlsl train --config` trains with other settings")
        return cls(root, load_config(path))

    def lock(self) -> FolderLock:
        """Lock the folder against other processes that would train in it.

        Raises:
            UserError: another process is training in it.
        """
        return FolderLock(self.root, LOCK, TRAINING)

    def append_metrics(self, event: EpisodeEvent) -> dict[str, Any]:
        """Add an episode's row, and return it; floats are written so that they read back bit for bit.

        Raises:
            UserError: the file cannot be written.
        """
        row = {_COLUMN_OF.get(name, name): value for name, value in dataclasses.asdict(event.summary).items()}
        row = {name: row[name] if name in row else getattr(event, name) for name in self.columns}
        path = self.root / METRICS
        try:
            with path.open("a", newline="", encoding="utf-8") as file:
                csv.writer(file, lineterminator="\n").writerow(map(_cell, row.values()))
        except OSError as error:
            raise UserError(f"{path}: cannot write: {error.strerror or error}") from error
        return row

    def sync_metrics(self) -> str:
        """Force the rows to the disk, so that no checkpoint is ever ahead of them; return their SHA-256."""
        with (self.root / METRICS).open("rb+") as file:
            os.fsync(file.fileno())
            return hashlib.file_digest(file, "sha256").hexdigest()

    def keep_metrics(self, episodes: Collection[int], sha256: str | None = None) -> None:
        """Keep one row for each of these episodes; the state behind all others was lost.

        Rows that were written twice, or half, are dropped, too. `sha256`: the value of `sync_metrics` when
        the file held exactly these rows.

        Raises:
            UserError: the file is missing or damaged, or lacks the row of an episode.
        """
        path = self.root / METRICS
        try:
            lines = path.read_bytes().decode().splitlines(keepends=True)
        except OSError as error:
            raise UserError(f"{path}: cannot read the metrics: {error.strerror or error}") from error
        except UnicodeDecodeError as error:
            raise UserError(f"{path}: damaged: {error}; {START_AGAIN}") from error
        if not lines or lines[0] != _header(self.columns):
            raise UserError(f"{path}: damaged: its first line names other columns; {START_AGAIN}")
        rows: dict[int, str] = {}
        for line in lines[1:]:
            episode = _episode_of(line, len(self.columns))
            if episode is not None and episode in episodes and episode not in rows:
                rows[episode] = line
        missing = sorted(set(episodes) - set(rows))
        if missing:
            raise UserError(f"{path}: no row of the finished episode {missing[0]}; {START_AGAIN}")
        kept = "".join([_header(self.columns), *rows.values()]).encode()
        if sha256 not in (None, hashlib.sha256(kept).hexdigest()):
            raise UserError(f"{path}: damaged: not the rows of the checkpoint; {START_AGAIN}")
        write_atomic(path, kept)

    def metrics(self, sha256: str | None = None) -> pd.DataFrame:
        """Return the rows so far, one per episode; `sha256`, if given, must be that of the file.

        A last row that is not whole, of a run that was killed or is being written to, is left out.

        Raises:
            UserError: the file is missing, or is not the metrics of a run, or not those of that checksum.
        """
        import pandas as pd  # training begins without it

        path = self.root / METRICS
        try:
            content = path.read_bytes()
            whole = io.BytesIO(content[: content.rfind(b"\n") + 1])
            frame = pd.read_csv(whole, keep_default_na=False, na_values={"loss": [""]})
        except (OSError, ValueError) as error:
            raise UserError(f"{path}: cannot read the metrics: {str(error).strip()}") from error
        if sha256 not in (None, hashlib.sha256(content).hexdigest()):
            raise UserError(f"{path}: damaged: not the rows that the training wrote; put back a copy of it")
        missing = [name for name in self.columns if name not in frame.columns]
        if missing:
            raise UserError(f"{path}: expected the column{'s'[: len(missing) > 1]} {', '.join(missing)}")
        return frame

    def episodes(self) -> list[dict[str, Any]]:
        """Return the rows so far as `append_metrics` returned them; a last row that is not whole is left out.

        Raises:
            UserError: the file is missing, or is not the metrics of a run.
        """
        path = self.root / METRICS
        try:
            lines = path.read_text("utf-8").splitlines(keepends=True)
            rows = csv.DictReader(line for line in lines if line.endswith("\n"))
            return [{name: _value(name, row[name]) for name in self.columns} for row in rows]
        except OSError as error:
            raise UserError(f"{path}: cannot read the metrics: {error.strerror or error}") from error
        except (KeyError, TypeError, ValueError) as error:
            raise UserError(f"{path}: damaged: {error!r}; `drlsl train --resume` mends it") from error

    def save_evaluations(self, evaluations: Iterable[dict[str, Any]], key: Iterable[str]) -> Path:
        """Put evaluations into evaluation.json; each replaces an earlier one equal in all of `key`.

        Raises:
            UserError: the existing file is not one of ours, or is damaged.
        """
        path = self.root / EVALUATION
        names = list(key)
        kept: dict[str, dict[str, Any]] = {}
        with FolderLock(self.root, EVALUATION_LOCK, "evaluation", wait_s=LOCK_S):
            for item in [*self.evaluations(), *evaluations]:
                kept[json.dumps([item[name] for name in names], sort_keys=True)] = item
            write_atomic(path, seal_values({"evaluations": list(kept.values())}).encode())
        return path

    def evaluations(self) -> list[dict[str, Any]]:
        """Return the contents of evaluation.json; empty before the first evaluation.

        Raises:
            UserError: the file is not one of ours, or is damaged.
        """
        path = self.root / EVALUATION
        if not path.exists():
            return []
        try:
            found = open_values(path.read_text("utf-8"))["evaluations"]
        except DamagedError as error:
            raise UserError(f"{path}: damaged: {error}; move it away and evaluate again") from error
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise UserError(f"{path}: not a run's evaluations; move it away and evaluate again") from error
        result: list[dict[str, Any]] = found
        return result


def next_free_folder(parent: Path, stem: str) -> Path:
    """Return the first of stem, stem-2, stem-3, … that does not exist in `parent`."""
    number, path = 1, parent / stem
    while path.exists():
        number += 1
        path = parent / f"{stem}-{number}"
    return path


def _header(columns: Sequence[str]) -> str:
    return ",".join(columns) + "\n"


def refuse_occupied(root: Path, *, force: bool) -> None:
    """Check that a run can be made in a folder.

    Raises:
        UserError: the folder is not empty, or `force` would delete files that were not written by a run.
    """
    if not root.exists():
        return
    if not root.is_dir():
        raise UserError(f"{root}: a file is in the way of the run folder")
    found = {item.name for item in root.iterdir()}
    if not found:
        return
    if not force:
        hint = "--resume resumes it, --force replaces it" if CONFIG in found else "choose another --out"
        raise UserError(f"{root}: the folder exists; {hint}")
    foreign = sorted(name for name in found if not _is_ours(name))
    if foreign or CONFIG not in found:
        what = f"holds {foreign[0]}" if foreign else f"holds no {CONFIG}"
        raise UserError(f"{root}: not replaced: it {what}, so it is not only a run; choose another --out")


def _is_ours(name: str) -> bool:
    """Return whether a run writes a file of this name, or leaves one when it is killed."""
    known = (
        CONFIG,
        METRICS,
        CHECKPOINT,
        POLICY,
        MODEL,
        EVALUATION,
        FIGURES,
        TENSORBOARD,
        LOCK,
        EVALUATION_LOCK,
    )
    return name in known or name.startswith(tuple(f".{item}." for item in known))


def _put_in_place(made: Path, root: Path) -> None:
    """Rename a finished folder to its place; what was there is deleted only afterwards."""
    if not root.exists():
        made.rename(root)
        return
    aside = made.with_name(f"{made.name}.old")
    root.rename(aside)
    made.rename(root)
    shutil.rmtree(aside)


def _episode_of(line: str, columns: int) -> int | None:
    """Return the episode's number in a row of the metrics; None if the row is incomplete."""
    cells = line.split(",")
    whole = line.endswith("\n") and len(cells) == columns
    return int(cells[0]) if whole and cells[0].isdecimal() else None


def _cell(value: object) -> object:
    if value is None:
        return ""
    return int(value) if isinstance(value, bool) else repr(value) if isinstance(value, float) else value


def _value(name: str, text: str) -> object:
    """Return the value of a cell, as `_cell` wrote it."""
    if name == "contact_reason":
        return text
    if name in _TRUTHS:
        return bool(int(text))
    return None if not text else int(text) if text.isdecimal() else float(text)
