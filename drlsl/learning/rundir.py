"""The folder of a training run: its files, made whole and kept consistent."""

import csv
import dataclasses
import json
import os
import shutil
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Self

import pandas as pd

from drlsl.config import TrainConfig, dump_yaml, load_config
from drlsl.errors import UserError
from drlsl.learning.checkpoint import write_atomic
from drlsl.learning.episode import EpisodeSummary
from drlsl.learning.trainer import EpisodeEvent

CONFIG, METRICS, CHECKPOINT = "config.yaml", "metrics.csv", "checkpoint.pt"
POLICY, EVALUATION, FIGURES = "policy.pt", "evaluation.json", "figures"

_COLUMN_OF = {"total_return": "return"}
"""Columns whose name is not that of the field behind them."""
METRIC_COLUMNS = [
    "episode",
    "total_steps",
    *(_COLUMN_OF.get(field.name, field.name) for field in dataclasses.fields(EpisodeSummary)),
    "epsilon",
    "learning_rate",
    "loss",
    "wall_s",
]


class RunFolder:
    """One run on disk: config.yaml, metrics.csv, checkpoint.pt, policy.pt, evaluation.json and figures/."""

    def __init__(self, root: Path, config: TrainConfig) -> None:
        self.root = root
        self.config = config

    @classmethod
    def create(cls, root: Path, config: TrainConfig, *, force: bool = False) -> Self:
        """Make the folder, whole or not at all; `force` replaces an earlier run.

        Raises:
            UserError: the folder exists and is not empty, or `force` would delete what no run has written.
        """
        _refuse_occupied(root, force)
        try:
            root.parent.mkdir(parents=True, exist_ok=True)
            made = Path(tempfile.mkdtemp(prefix=f".{root.name}.", dir=root.parent))
            try:
                made.chmod(0o755)
                write_atomic(made / CONFIG, dump_yaml(config).encode())
                write_atomic(made / METRICS, (",".join(METRIC_COLUMNS) + "\n").encode())
                _put_in_place(made, root)
            except BaseException:
                shutil.rmtree(made, ignore_errors=True)
                raise
        except OSError as error:
            raise UserError(f"{root}: cannot make the run folder: {error.strerror or error}") from error
        return cls(root, config)

    @classmethod
    def open(cls, root: Path) -> Self:
        """Open an existing run.

        Raises:
            UserError: there is no run in the folder, or its configuration is not valid.
        """
        if not (root / CONFIG).is_file():
            raise UserError(f"{root}: no run here (expected {CONFIG}); `drlsl train --out {root}` starts one")
        return cls(root, load_config(root / CONFIG))

    @property
    def checkpoint(self) -> Path:
        """Where the learner's state is kept."""
        return self.root / CHECKPOINT

    @property
    def policy(self) -> Path:
        """Where the network's weights are kept."""
        return self.root / POLICY

    @property
    def figures(self) -> Path:
        """Where the training figures are kept."""
        return self.root / FIGURES

    def append_metrics(self, event: EpisodeEvent) -> None:
        """Add an episode's row; floats are written so that they read back bit for bit.

        Raises:
            UserError: the file cannot be written.
        """
        row = {_COLUMN_OF.get(name, name): value for name, value in dataclasses.asdict(event.summary).items()}
        row |= {name: getattr(event, name) for name in METRIC_COLUMNS if name not in row}
        path = self.root / METRICS
        try:
            with path.open("a", newline="", encoding="utf-8") as file:
                csv.writer(file, lineterminator="\n").writerow(_cell(row[name]) for name in METRIC_COLUMNS)
        except OSError as error:
            raise UserError(f"{path}: cannot write: {error.strerror or error}") from error

    def sync_metrics(self) -> None:
        """Force the rows to the disk, so that no checkpoint is ever ahead of them."""
        with (self.root / METRICS).open("rb+") as file:
            os.fsync(file.fileno())

    def truncate_metrics(self, episodes: int) -> None:
        """Keep the rows of the first `episodes` episodes: later ones were lost with the state behind them.

        Raises:
            UserError: the file is missing or holds fewer rows than that.
        """
        path = self.root / METRICS
        try:
            lines = path.read_text("utf-8").splitlines(keepends=True)
        except OSError as error:
            raise UserError(f"{path}: cannot read the metrics: {error.strerror or error}") from error
        kept = lines[: episodes + 1]
        if len(kept) <= episodes or not kept[-1].endswith("\n"):
            raise UserError(
                f"{path}: fewer rows than the checkpoint's {episodes} episodes; --force starts again"
            )
        write_atomic(path, "".join(kept).encode())

    def metrics(self) -> pd.DataFrame:
        """The rows so far, one per episode.

        Raises:
            UserError: the file is missing, or is not the metrics of a run.
        """
        path = self.root / METRICS
        try:
            frame = pd.read_csv(path, keep_default_na=False, na_values={"loss": [""]})
        except (OSError, ValueError) as error:
            raise UserError(f"{path}: cannot read the metrics: {error}") from error
        missing = [name for name in METRIC_COLUMNS if name not in frame.columns]
        if missing:
            raise UserError(f"{path}: expected the column{'s'[: len(missing) > 1]} {', '.join(missing)}")
        return frame

    def save_evaluations(self, evaluations: Iterable[dict[str, Any]], key: Iterable[str]) -> Path:
        """Put evaluations into evaluation.json, each in place of an earlier one equal in all of `key`.

        Raises:
            UserError: the file that is there is not one of ours.
        """
        path = self.root / EVALUATION
        names = list(key)
        kept: dict[str, dict[str, Any]] = {}
        for item in [*self.evaluations(), *evaluations]:
            kept[json.dumps([item[name] for name in names], sort_keys=True)] = item
        text = json.dumps({"evaluations": list(kept.values())}, indent=1, allow_nan=False)
        write_atomic(path, f"{text}\n".encode())
        return path

    def evaluations(self) -> list[dict[str, Any]]:
        """What evaluation.json holds; empty before the first evaluation.

        Raises:
            UserError: the file is not one of ours.
        """
        path = self.root / EVALUATION
        if not path.exists():
            return []
        try:
            found = json.loads(path.read_text("utf-8"))["evaluations"]
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise UserError(f"{path}: not a run's evaluations; move it away and evaluate again") from error
        result: list[dict[str, Any]] = found
        return result


def next_free_folder(parent: Path, stem: str) -> Path:
    """The first of stem, stem-2, stem-3, … that does not exist in `parent`."""
    number, path = 1, parent / stem
    while path.exists():
        number += 1
        path = parent / f"{stem}-{number}"
    return path


def _refuse_occupied(root: Path, force: bool) -> None:
    if not root.exists():
        return
    if not root.is_dir():
        raise UserError(f"{root}: a file is in the way of the run folder")
    found = {item.name for item in root.iterdir()}
    if not found:
        return
    if not force:
        hint = "--resume goes on with it, --force replaces it" if CONFIG in found else "choose another --out"
        raise UserError(f"{root}: the folder exists; {hint}")
    foreign = sorted(name for name in found if not _is_ours(name))
    if foreign or CONFIG not in found:
        what = f"holds {foreign[0]}" if foreign else f"holds no {CONFIG}"
        raise UserError(f"{root}: not replaced, for it {what} and so is not only a run; choose another --out")


def _is_ours(name: str) -> bool:
    """Whether a run writes a file of this name, or had begun to when it was killed."""
    known = (CONFIG, METRICS, CHECKPOINT, POLICY, EVALUATION, FIGURES)
    return name in known or name.startswith(tuple(f".{item}." for item in known))


def _put_in_place(made: Path, root: Path) -> None:
    """Rename a finished folder to its place; what stood there is deleted only after that."""
    if not root.exists():
        made.rename(root)
        return
    aside = made.with_name(f"{made.name}.old")
    root.rename(aside)
    made.rename(root)
    shutil.rmtree(aside)


def _cell(value: object) -> object:
    if value is None:
        return ""
    return int(value) if isinstance(value, bool) else repr(value) if isinstance(value, float) else value
