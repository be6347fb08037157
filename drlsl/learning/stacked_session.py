"""The runs of several seeds that are trained in lockstep, each in a folder of its own."""

import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, Self

from drlsl.errors import UserError
from drlsl.files import open_values, seal_values, write_atomic
from drlsl.learning.config import TrainConfig, make_config, merged
from drlsl.learning.rundir import CONFIG, RunFolder, refuse_occupied
from drlsl.learning.session import Session, make_training_env
from drlsl.learning.stacked_trainer import StackedTrainer, check_stackable
from drlsl.learning.tensorboard import require_tensorboard
from drlsl.learning.trainer import StepEvent, Trainer

SEEDS: Final = "seeds.json"
"""The file that names the seeds, written first."""

AGAIN: Final = "start again with --force"


class StackedSession(AbstractContextManager["StackedSession"]):
    """Trainings that differ in their seed alone, made together; `ROOT/seedN` is the run of seed N.

    Each is a run like any other, with a checkpoint of its own, and on a processor its files are, to the bit,
    those of the same training alone. As a context manager it is closed at the end.
    """

    def __init__(self, root: Path, runs: tuple[Session, ...]) -> None:
        self.root = root
        self.runs = runs
        """The run of each seed, in order."""
        self._trainer = StackedTrainer([run.trainer for run in runs], self.config)

    @classmethod
    def start(
        cls, root: Path, config: TrainConfig, seeds: int, *, force: bool = False, tensorboard: bool = False
    ) -> Self:
        """Begin the trainings of so many seeds, from that of `config` on.

        Raises:
            UserError: as `Session.start` and `check_stackable`, or the folder holds anything else than runs
                of these seeds.
        """
        check_stackable(config)
        configs = [
            make_config(merged(config.model_dump(), {"seed": config.seed + number}), "--seeds")
            for number in range(seeds)
        ]
        folders = {_folder(root, one.seed): one for one in configs}
        _refuse_others(root, [path.name for path in folders])
        if root.exists() and not force and any(root.iterdir()):
            raise UserError(f"{root}: the folder exists; --resume resumes it, --force replaces it")
        for path in folders:
            refuse_occupied(path, force=force)
        if tensorboard:
            require_tensorboard()
        trainers = {path: Trainer(make_training_env(one), one) for path, one in folders.items()}
        _write_seeds(root, [one.seed for one in configs])

        def begin(path: Path) -> Session:
            return Session.begin(path, trainers[path], folders[path], force=force, tensorboard=tensorboard)

        return cls._of(root, list(folders), begin)

    @classmethod
    def resume(cls, root: Path, *, tensorboard: bool = False) -> Self:
        """Resume the trainings in a folder, each from its last checkpoint.

        Raises:
            UserError: as `Session.resume`, or the trainings differ in more than their seeds.
        """
        folders = cls.folders(root)
        for path in folders:
            if not (path / CONFIG).is_file():
                raise UserError(f"{root}: the run of {path.name} is missing; {AGAIN}")
        first, *others = [RunFolder.open(path).config for path in folders]
        if any(one.model_copy(update={"seed": first.seed}) != first for one in others):
            raise UserError(f"{root}: its runs differ in more than their seeds; resume each by itself")
        return cls._of(root, folders, lambda path: Session.resume(path, tensorboard=tensorboard))

    @classmethod
    def _of(cls, root: Path, folders: list[Path], make: Callable[[Path], Session]) -> Self:
        """Return the stack of the runs that `make` opens; if one cannot be opened, none stays locked."""
        with ExitStack() as opened:
            stack = cls(root, tuple(opened.enter_context(make(path)) for path in folders))
            opened.pop_all()
        return stack

    @staticmethod
    def folders(root: Path) -> list[Path]:
        """Return the folders of the trainings that were begun in a folder together; none if there are none.

        Raises:
            UserError: the file that names them is damaged.
        """
        return [_folder(root, seed) for seed in _read_seeds(root)] if (root / SEEDS).is_file() else []

    @property
    def config(self) -> TrainConfig:
        """The settings of the first seed's training."""
        return self.runs[0].config

    @property
    def episodes(self) -> int:
        """Number of episodes of all trainings."""
        return sum(run.episodes for run in self.runs)

    @property
    def finished(self) -> int:
        """Number of finished episodes."""
        return sum(run.finished for run in self.runs)

    @property
    def total_steps(self) -> int:
        """Number of steps so far."""
        return sum(run.total_steps for run in self.runs)

    @property
    def saved_steps(self) -> int:
        """Number of steps that the last checkpoints hold."""
        return sum(run.saved_steps for run in self.runs)

    def run(self, stop: Callable[[], bool] = lambda: False) -> Iterator[StepEvent]:
        """Train, as `Session.run` does; an event is a step of all seeds that are not done yet.

        Its episodes are numbered as finished among those of all seeds.
        """
        finished = self.finished
        for step in self._trainer.run():
            stopping = stop()
            for place, event in step.items():
                self.runs[place].record(event, save=stopping)
            yield self._together(step, finished)
            finished = self.finished
            if stopping:
                return

    def _together(self, step: Mapping[int, StepEvent], finished: int) -> StepEvent:
        ended = [episode for event in step.values() for episode in event.ended]
        return StepEvent(
            self.total_steps,
            [loss for event in step.values() for loss in event.losses],
            [replace(episode, finished=finished + number) for number, episode in enumerate(ended, start=1)],
        )

    def close(self) -> None:
        """Write what is left, and unlock the folders."""
        for run in self.runs:
            run.close()

    def __exit__(self, *exception: object) -> None:
        self.close()


def _folder(root: Path, seed: int) -> Path:
    return root / f"seed{seed}"


def _refuse_others(root: Path, names: list[str]) -> None:
    """Check that a folder is new, or holds nothing but runs of some seeds.

    Raises:
        UserError: it holds something else.
    """
    if not root.exists():
        return
    if not root.is_dir():
        raise UserError(f"{root}: a file is in the way of the folder")
    for path in sorted(root.iterdir()):
        if path.name not in (SEEDS, *names) and not path.name.startswith(f".{SEEDS}."):
            other = "the run of another seed" if re.fullmatch(r"seed\d+", path.name) else "something else"
            raise UserError(f"{root}: holds {other}, {path.name}; choose another --out")


def _write_seeds(root: Path, seeds: list[int]) -> None:
    try:
        root.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{root}: cannot make the folder: {error.strerror or error}") from error
    write_atomic(root / SEEDS, seal_values({"seeds": seeds}).encode())


def _read_seeds(root: Path) -> list[int]:
    path = root / SEEDS
    try:
        found: Any = open_values(path.read_text("utf-8"))["seeds"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise UserError(f"{path}: cannot be read ({error}); put back a copy of it, or {AGAIN}") from error
    return [int(seed) for seed in found]
