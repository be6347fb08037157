"""`drlsl eval`: judge a trained policy, with the shield and without it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from drlsl.cli.options import Direction

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from drlsl.learning import RunFolder, ShieldState, VectorHighway

ROWS: Sequence[tuple[str, str, str]] = (
    ("lane changes", "lane_changes", "d"),
    ("contacts, ego at fault", "contacts_at_fault", "d"),
    ("contacts, ego not at fault", "contacts_not_at_fault", "d"),
    ("off-road", "off_road", "d"),
    ("completed", "completed", "d"),
    ("steps, mean", "mean_steps", ".1f"),
    ("steps of completed, mean", "mean_steps_completed", ".1f"),
    ("speed, mean [m/s]", "mean_speed", ".2f"),
    ("return, mean", "mean_return", ".1f"),
    ("interventions", "interventions", ".2%"),
    ("fail-safe steps", "fail_safe", "d"),
)
"""Label, key in the totals and format of each row of the table."""


def evaluate(
    run: Annotated[Path, typer.Argument(help="Run folder that `drlsl train` made.")],
    episodes: Annotated[
        int | None, typer.Option(min=1, help="Episodes; default: evaluation.episodes of the run.")
    ] = None,
    shield: Annotated[
        Literal["on", "off", "both"],
        typer.Option(help="Offer only safe actions, or all of them, or compare both."),
    ] = "both",
    recording: Annotated[
        str | None, typer.Option(help="Recording to drive in; default: that of the training.")
    ] = None,
    direction: Annotated[
        Direction | None,
        typer.Option(help="Carriageway to drive on; default: that of the training."),
    ] = None,
    rules: Annotated[
        list[Path] | None,
        typer.Option(help="Rule file to consult instead of the training's; may be repeated."),
    ] = None,
    track_length: Annotated[
        float | None, typer.Option(help="Metres of an episode; default: that of the training.")
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, help="Seed of the episodes; default: that of the run.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")] = False,
) -> None:
    """Drive greedily with a trained policy and count what happens.

    The same episodes are driven with the shield on and off. An intervention is a step in which the rules did
    not derive the action of highest value to be safe. The result is also kept in the run's evaluation.json.
    """
    from rich.console import Console

    from drlsl.learning import RunFolder, make_config, make_evaluation_env, merged

    folder = RunFolder.open(run)
    flags = {
        "recording": recording,
        "direction": direction,
        "rules": [str(path) for path in rules] if rules else None,
        "track_length": track_length,
    }
    given = {"env": {key: value for key, value in flags.items() if value is not None}}
    config = make_config(merged(folder.config.model_dump(), given), "command line")
    records = evaluate_run(
        folder,
        make_evaluation_env(config.env),
        shields=("on", "off") if shield == "both" else (shield,),
        episodes=episodes or config.evaluation.episodes,
        seed=config.seed if seed is None else seed,
        env_config=config.env.model_dump(mode="json"),
        console=Console(stderr=True),
    )
    if as_json:
        typer.echo(json.dumps({"run": str(run), "evaluations": records}, indent=1, allow_nan=False))
    else:
        Console().print(evaluation_table(records))


def evaluate_run(
    folder: RunFolder,
    env: VectorHighway,
    *,
    shields: Sequence[ShieldState],
    episodes: int,
    seed: int,
    console: Console,
    env_config: Mapping[str, Any] | None = None,
) -> list[dict[str, Any]]:
    """Evaluate a run's policy in `env`, show progress on a terminal, keep the result in the run folder."""
    from rich.progress import Progress

    from drlsl.learning import EVALUATION_KEY, as_record, drive, load_policy

    place = env_config or folder.config.env.model_dump(mode="json")
    policy = load_policy(folder, env)
    records = []
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        for shield in shields:
            drives = drive(env, policy, shield=shield, episodes=episodes, seed=seed)
            shown = progress.track(drives, total=episodes, description=f"shield {shield}")
            records.append(as_record(list(shown), env=place, shield=shield, seed=seed))
    folder.save_evaluations(records, EVALUATION_KEY)
    return records


def evaluation_table(records: Sequence[Mapping[str, Any]]) -> Table:
    """Return the totals of evaluations in the same place as a table, one column for each."""
    from rich.table import Table
    from rich.text import Text

    first = records[0]
    env = first["env"]
    # Text throughout: Rich would take [m/s], or a bracket in a path, for markup.
    table = Table(title=Text(f"{first['episodes']} episodes, {env['recording']}, {env['direction']}"))
    table.add_column("")
    for record in records:
        table.add_column(f"shield {record['shield']}", justify="right")
    for label, key, form in ROWS:
        values = (record["totals"][key] for record in records)
        table.add_row(Text(label), *("-" if value is None else format(value, form) for value in values))
    return table
