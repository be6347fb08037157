"""The episodes of a run as event files for TensorBoard, made from the rows of its metrics."""

from collections.abc import Mapping
from typing import Any, Final

from drlsl.errors import UserError
from drlsl.learning.config import dump_yaml
from drlsl.learning.rundir import RunFolder

LEARNING: Final = ("epsilon", "learning_rate", "loss", "wall_s")
"""Columns shown as `learning/...`; terms of the reward are `reward/...`, all others `episode/...`."""

NOT_SHOWN: Final = ("total_steps", "contact_reason")
"""The step that all is shown over, and the column that is text."""

FLUSH_S: Final = 10
"""Longest time in seconds for which a value is not yet on the disk."""


def require_tensorboard() -> None:
    """Check that event files can be written.

    Raises:
        UserError: TensorBoard is not installed.
    """
    try:
        import torch.utils.tensorboard  # noqa: F401  # asks whether tensorboard is there
    except ModuleNotFoundError as error:
        raise UserError(
            "--tensorboard needs tensorboard, which is missing: pip install 'drlsl[tensorboard]'"
        ) from error


class TensorBoardLog:
    """Scalars of every episode over the environment steps, in the run's folder `tensorboard`."""

    def __init__(self, folder: RunFolder) -> None:
        """Write the configuration and the episodes so far anew: the metrics alone say what was kept.

        Raises:
            UserError: the metrics cannot be read.
        """
        from torch.utils.tensorboard import SummaryWriter

        for earlier in folder.tensorboard.glob("events.out.tfevents.*"):
            earlier.unlink()
        self._writer = SummaryWriter(str(folder.tensorboard), flush_secs=FLUSH_S)
        self._writer.add_text("config", f"```yaml\n{dump_yaml(folder.config)}```")
        for row in folder.episodes():
            self.add(row)

    def add(self, row: Mapping[str, Any]) -> None:
        """Add an episode, given as its row of the metrics; a value that is None is left out."""
        for name, value in row.items():
            if name not in NOT_SHOWN and value is not None:
                self._writer.add_scalar(tag_of(name), float(value), row["total_steps"])

    def close(self) -> None:
        """Write what is left."""
        self._writer.close()


def tag_of(column: str) -> str:
    """Return the name under which TensorBoard shows a column of the metrics."""
    if column in LEARNING:
        return f"learning/{column}"
    return f"reward/{column.removeprefix('reward_')}" if column.startswith("reward_") else f"episode/{column}"
