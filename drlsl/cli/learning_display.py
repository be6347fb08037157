"""The progress of learning rules: bars on a terminal, below a line for each step."""

from __future__ import annotations

import contextlib
from typing import Any

import typer


class LearningDisplay(contextlib.AbstractContextManager["LearningDisplay"]):
    """A line for each step, and as long as it is entered, on a terminal, a bar for what takes long."""

    def __init__(self) -> None:
        """Begin without bars."""
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

        self._console = Console(stderr=True)
        # What is printed meanwhile is not for the console of the bars, which is stderr.
        self._bars = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            console=self._console,
            transient=True,
            redirect_stdout=False,
            disable=not self._console.is_terminal,
        )
        self._of: dict[str, Any] = {}

    def __enter__(self) -> LearningDisplay:
        self._bars.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._bars.stop()

    def tell(self, line: str) -> None:
        """Print the line of a step that begins or ends; what took long before it is over."""
        for task in self._of.values():
            self._bars.remove_task(task)
        self._of.clear()
        if self._console.is_terminal:
            self._console.print(line, highlight=False, markup=False, soft_wrap=True)
        else:
            typer.echo(line, err=True)

    def progress(self, what: str, done: int, total: int) -> None:
        """Show how much of something is done, of how much; without a terminal, nothing."""
        if what not in self._of:
            self._of[what] = self._bars.add_task(what, total=total)
        self._bars.update(self._of[what], completed=done, total=total)
