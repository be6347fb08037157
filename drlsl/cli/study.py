"""`drlsl study`: train every method over several seeds, test it, and report."""

from __future__ import annotations

import contextlib
import shlex
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from drlsl.cli.options import Jobs, Ray, crew_of
from drlsl.cli.stopping import stop_on_signal
from drlsl.errors import UserError

if TYPE_CHECKING:
    from rich.console import Console

    from drlsl.study import Progress, StudyConfig, StudyFolder
    from drlsl.workers import Crew

PRESET = "smoke"
"""What a study without --preset and --config is."""

FAILED = 1
"""Exit status of a study with runs that were given up."""


def study(
    preset: Annotated[
        str | None,
        typer.Option(
            help="Study that ships with DRLSL: smoke (default), benchmark, benchmark-beside, paper, "
            "paper-code, full."
        ),
    ] = None,
    config: Annotated[Path | None, typer.Option(help="YAML file with a study of your own.")] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="The study's folder; default: runs/study-PRESET. An existing study is resumed."),
    ] = None,
    seeds: Annotated[int | None, typer.Option(min=1, help="Trainings of each method.")] = None,
    episodes: Annotated[int | None, typer.Option(min=1, help="Episodes of each training.")] = None,
    methods: Annotated[
        list[str] | None, typer.Option(help="Method of the study to keep, by name; may be repeated.")
    ] = None,
    test: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PATH", help="Recording, or folder of NGSIM files, to test in too; may be repeated."
        ),
    ] = None,
    jobs: Jobs = None,
    ray: Ray = None,
    report_only: Annotated[
        bool, typer.Option("--report-only", help="Write the report of the finished runs, and run nothing.")
    ] = False,
    print_config: Annotated[
        bool, typer.Option("--print-config", help="Print the study that would be run, and stop.")
    ] = False,
) -> None:
    """Train every method over several seeds, test each policy with the shield and without, and report.

    The folder records all finished work: after Ctrl-C, a crash or kill -9 the same command resumes the study.
    A run that fails is tried once more, and then reported. The report is in the folder's report/.
    """
    from drlsl.study import StudyFolder, dump_study

    root = out or Path("runs") / f"study-{preset or (config.stem if config else PRESET)}"
    if report_only:
        _report(StudyFolder.open(root))
        return
    chosen = _chosen(root, preset, config, seeds, episodes, methods, test)
    if print_config:
        typer.echo(dump_study(chosen), nl=False)
        return
    crew = crew_of(jobs, ray)
    inputs = _inputs(chosen)
    with StudyFolder.at_work(root):
        _run(StudyFolder.prepare(root, chosen, inputs), crew)


def _chosen(
    root: Path,
    preset: str | None,
    config: Path | None,
    seeds: int | None,
    episodes: int | None,
    methods: list[str] | None,
    test: list[str] | None,
) -> StudyConfig:
    """Return the study that the flags mean; without any, the one in the folder."""
    from drlsl.study import STUDY, StudyFolder, load_study, preset_study, with_changes

    if preset and config:
        raise UserError("--preset and --config: expected one of them, not both")
    if not (preset or config) and (root / STUDY).is_file():
        base = StudyFolder.open(root).study
    else:
        base = load_study(config) if config else preset_study(preset or PRESET)
    return with_changes(base, seeds=seeds, episodes=episodes, methods=methods, tests=test)


def _inputs(chosen: StudyConfig) -> dict[str, Any]:
    """Return the command, and all else besides the settings that the results depend on."""
    from drlsl.study import inputs_of

    return {"command": shlex.join(["drlsl", *sys.argv[1:]]), **inputs_of(chosen)}


def _run(folder: StudyFolder, crew: Crew) -> None:
    from rich.console import Console

    from drlsl.study import work, workers_of

    console = Console(stderr=True)
    with stop_on_signal(console.print) as stop:
        with _display(folder, console) as show:
            for progress in work(folder, workers_of(folder, crew), stop.requested):
                show(progress)
        if stop.requested():
            console.print(f"saved in {folder.root}; run the same command to resume")
            raise typer.Exit(stop.status)
        _report(folder)
        if progress.given_up:
            raise typer.Exit(FAILED)


def _report(folder: StudyFolder) -> None:
    from drlsl.study import write_report

    out = write_report(folder)
    typer.echo(f"report in {out}: report.md, report.html, tables/*.csv, figures/*.png")


@contextlib.contextmanager
def _display(folder: StudyFolder, console: Console) -> Iterator[Callable[[Progress], None]]:
    """Show bars on a terminal, otherwise a line for each task that ends."""
    if not console.is_terminal:
        yield lambda progress: _print_end(folder, console, progress)
        return
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bars

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Bars(*columns, console=console) as bars:
        yield _Bars(folder, bars).show


class _Bars:
    """A bar for the whole study, and one for each run in progress."""

    def __init__(self, folder: StudyFolder, bars: Any) -> None:
        self._folder = folder
        self._bars = bars
        self._whole = bars.add_task("study", total=len(folder.study.tasks))
        self._of: dict[str, Any] = {}

    def show(self, progress: Progress) -> None:
        """Update the bars."""
        _print_end(self._folder, self._bars.console, progress)
        self._bars.update(self._whole, completed=progress.done + progress.given_up)
        busy = {task.name: task for task in progress.busy}
        for name in set(self._of) - set(busy):
            self._bars.remove_task(self._of.pop(name))
        for name, task in busy.items():
            episodes = self._folder.study.training(task.run).episodes if task.test is None else None
            if name not in self._of:
                self._of[name] = self._bars.add_task(name, total=episodes)
            if episodes:
                self._bars.update(self._of[name], completed=self._folder.episodes_done(task.run))


def _print_end(folder: StudyFolder, console: Console, progress: Progress) -> None:
    if progress.ended is None:
        return
    name, standing = progress.ended.name, f"{progress.done + progress.given_up}/{progress.total}"
    if progress.failure is None:
        console.print(f"{standing} {name}", highlight=False)
    else:
        again = "given up" if folder.is_given_up(progress.ended) else "trying again"
        console.print(
            f"{standing} {name} failed, {again}: {progress.failure.summary}", highlight=False, markup=False
        )
