"""The progress of a training: a bar on a terminal, otherwise a few lines."""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Iterator
from time import perf_counter
from typing import TYPE_CHECKING, Protocol

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from drlsl.learning import StepEvent

SMOOTHED = 20
"""Episodes of the moving average of the return that is shown."""

PLAIN_LINES = 20
"""About how many progress lines are printed where there is no terminal."""


class Extent(Protocol):
    """The progress of a training, or of those of several seeds together."""

    @property
    def episodes(self) -> int:
        """Number of episodes from the first to the last."""

    @property
    def finished(self) -> int:
        """Number of finished episodes."""

    @property
    def total_steps(self) -> int:
        """Number of steps so far."""


class Display(Protocol):
    """A display of the progress."""

    def step(self, event: StepEvent) -> None:
        """Show a step."""


@contextlib.contextmanager
def display(training: Extent, console: Console) -> Iterator[Display]:
    """Yield what shows the progress of a training as long as it is entered."""
    if console.is_terminal:
        shown = _LiveDisplay(training, console)
        with shown.live:
            yield shown
    else:
        yield _PlainDisplay(training)


class _Totals:
    """Running figures of the steps and episodes that this process has seen."""

    def __init__(self, training: Extent) -> None:
        self._returns: deque[float] = deque(maxlen=SMOOTHED)
        self._at_fault = self._not_at_fault = self._off_road = 0
        self._started = perf_counter()
        self._steps = self._steps_before = training.total_steps

    def add(self, event: StepEvent) -> None:
        self._steps = event.total_steps
        for episode in event.ended:
            summary = episode.summary
            self._returns.append(summary.total_return)
            self._at_fault += summary.contact and summary.at_fault
            self._not_at_fault += summary.contact and not summary.at_fault
            self._off_road += summary.off_road

    def text(self) -> str:
        rate = (self._steps - self._steps_before) / max(perf_counter() - self._started, 1e-9)
        mean = sum(self._returns) / len(self._returns)
        contacts = f"{self._at_fault} at fault, {self._not_at_fault} not"
        return f"{rate:.0f} steps/s  return {mean:.1f}  contacts {contacts}  off-road {self._off_road}"


class _PlainDisplay:
    """Progress as a few plain lines."""

    def __init__(self, training: Extent) -> None:
        self._last = training.episodes
        self._every = max(1, self._last // PLAIN_LINES)
        self._totals = _Totals(training)

    def step(self, event: StepEvent) -> None:
        self._totals.add(event)
        for episode in event.ended:
            if episode.finished % self._every == 0 or episode.finished == self._last:
                typer.echo(f"episode {episode.finished}/{self._last}  {self._totals.text()}")


class _LiveDisplay:
    """Progress as a bar and a line below it that stay in place."""

    def __init__(self, training: Extent, console: Console) -> None:
        from rich.console import Group
        from rich.live import Live
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
        from rich.text import Text

        self._progress = Progress(
            TextColumn("episode"),
            MofNCompleteColumn(),
            BarColumn(),
            TimeRemainingColumn(),
            TextColumn("left"),
        )
        self._task = self._progress.add_task("", total=training.episodes, completed=training.finished)
        self._totals = _Totals(training)
        self._line = Text()
        self.live = Live(Group(self._progress, self._line), console=console)

    def step(self, event: StepEvent) -> None:
        self._totals.add(event)
        if event.ended:
            self._line.plain = self._totals.text()
            self._progress.update(self._task, completed=event.ended[-1].finished)
