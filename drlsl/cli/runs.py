"""`drlsl runs`: what trainings have come to, beside each other."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from drlsl.cli.options import AsJson
from drlsl.errors import UserError

if TYPE_CHECKING:
    from rich.table import Table

    from drlsl.learning import RunFolder, RunOverview

app = typer.Typer(help="List and compare trainings, and print their metrics.", no_args_is_help=True)

HERE = Path("runs")
"""Where `drlsl train` puts runs."""

Places = Annotated[
    list[Path] | None,
    typer.Argument(
        metavar="[FOLDER]...", help="Run folders, or folders with runs anywhere below; default: runs/."
    ),
]


@app.command("list")
def list_runs(places: Places = None, as_json: AsJson = False) -> None:
    """List runs: how far each has come, its latest returns, contacts, and the time it saved when tested.

    The preset is the one from which the run's settings differ least, with the number of those that differ.
    The return is the mean over the last 20 episodes; contacts and off-road count the whole training. The test
    is the last evaluation behind the shield. A run that cannot be read is named on stderr; the exit status is
    then 1.
    """
    from dataclasses import asdict

    from drlsl.learning import RunFolder, find_runs, overview_of

    overviews, problems = [], []
    for root in find_runs(places or [HERE]):
        try:
            overviews.append(overview_of(RunFolder.open(root)))
        except UserError as error:
            problems.append(str(error))
    if as_json:
        typer.echo(json.dumps([asdict(one) for one in overviews], indent=1))
    else:
        _print(_list_table(overviews))
    for problem in problems:
        typer.echo(f"drlsl: {problem}", err=True)
    if problems:
        raise typer.Exit(1)


@app.command()
def compare(places: Places = None, as_json: AsJson = False) -> None:
    """Show runs side by side: the settings in which they differ, and the results."""
    from dataclasses import asdict

    from drlsl.learning import differing_settings, overview_of

    folders = _open(places)
    overviews = [overview_of(folder) for folder in folders]
    settings = differing_settings([folder.config for folder in folders])
    if as_json:
        typer.echo(json.dumps({"settings": settings, "runs": [asdict(one) for one in overviews]}, indent=1))
        return
    from rich.table import Table
    from rich.text import Text

    table = Table("")
    for one in overviews:
        table.add_column(Text(one.run), overflow="fold")
    for key, values in settings.items():
        table.add_row(key, *(Text(_shown(value)) for value in values))
    table.add_section()
    results = [_results(one) for one in overviews]
    for label in results[0]:
        table.add_row(label, *(one[label] for one in results))
    _print(table)


@app.command()
def metrics(places: Places = None) -> None:
    """Print a JSON line for every episode of the training: the columns of metrics.csv, and its run."""
    for folder in _open(places):
        for row in folder.episodes():
            typer.echo(json.dumps({"run": str(folder.root), **row}, allow_nan=False))


def _open(places: Sequence[Path] | None) -> list[RunFolder]:
    from drlsl.learning import RunFolder, find_runs

    return [RunFolder.open(root) for root in find_runs(places or [HERE])]


def _list_table(overviews: Iterable[RunOverview]) -> Table:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    table = Table(
        box=SIMPLE_HEAD, caption="at fault, excused: contacts in training; time saved: in the last test"
    )
    table.add_column("run", overflow="fold")
    table.add_column("preset", no_wrap=True)
    for heading in ("seed", *_LISTED):
        table.add_column(heading.removeprefix("test, ").replace(" ", "\n"), justify="right", no_wrap=True)
    for one in overviews:
        changed = f" +{len(one.changed)}" if one.changed else ""
        results = _results(one)
        shown = (results[heading] for heading in _LISTED)
        table.add_row(Text(one.run), f"{one.preset}{changed}", str(one.seed), *shown)
    return table


_LISTED = ("episodes", "return", "at fault", "excused", "off road", "test, time saved")
"""The results in a list of runs."""


def _results(one: RunOverview) -> dict[str, str]:
    """Return the results of a run as text, by their headings."""
    test = one.test
    saved = None if test is None else test.time_saved
    return {
        "episodes": f"{one.done}/{one.episodes}",
        "return": "-" if one.mean_return is None else f"{one.mean_return:.1f}",
        "at fault": str(one.contacts_at_fault),
        "excused": str(one.contacts_not_at_fault),
        "off road": str(one.off_road),
        "test, recording": "-" if test is None else _shown(test.recording),
        "test, episodes": "-" if test is None else str(test.episodes),
        "test, time saved": "-" if saved is None else f"{saved:.1%}",
        "test, return": "-" if test is None else f"{test.mean_return:.1f}",
        "test, at fault": "-" if test is None else str(test.contacts_at_fault),
        "test, off road": "-" if test is None else str(test.off_road),
    }


def _shown(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value)


def _print(table: Table) -> None:
    from rich.console import Console

    Console().print(table)
