"""`drlsl eval`: judge a trained policy or another driver, with the shield and without it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import typer

from drlsl.cli.episode_folder import EpisodeFolder, EpisodesAs, EpisodesOut
from drlsl.cli.options import (
    Direction,
    DriveSettings,
    EpisodeSeed,
    check_new,
    config_and_arguments,
    env_flags,
    recordings,
)
from drlsl.errors import UserError

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from drlsl.driving import HighwayVectorEnv
    from drlsl.driving.drivers import Driver
    from drlsl.learning import ShieldState

ROWS: Sequence[tuple[str, str, str]] = (
    ("time saved", "time_saved", ".1%"),
    ("contacts at fault", "contacts_at_fault", "d"),
    ("contacts not at fault", "contacts_not_at_fault", "d"),
    ("off-road", "off_road", "d"),
    ("completed", "completed", "d"),
    ("time, mean [s]", "mean_time_completed", ".2f"),
    ("lane changes", "lane_changes", "d"),
    ("lane changes per km", "lane_changes_per_km", ".2f"),
    ("steps, mean", "mean_steps", ".1f"),
    ("steps of completed", "mean_steps_completed", ".1f"),
    ("speed, mean [m/s]", "mean_speed", ".2f"),
    ("return, mean", "mean_return", ".1f"),
    ("interventions", "interventions", ".2%"),
    ("steps not offered", "not_offered", "d"),
    ("fail-safe steps", "fail_safe", "d"),
    ("headway, 5 % below [s]", "headway_5", ".2f"),
    ("headway, median [s]", "headway_50", ".2f"),
    ("collision in under 4 s", "short_ttc", ".2%"),
    ("braking over 3 m/s²", "hard_braking", ".2%"),
    ("jerk, rms [m/s³]", "jerk_rms", ".2f"),
    ("imposed braking [m/s²]", "imposed_braking", ".2f"),
)
"""Label, key in the totals and format of each row of the table."""

POLICY = "policy"
"""Name of a run's own driver."""


Who = Annotated[
    str,
    typer.Argument(
        metavar="RUN|DRIVER",
        help="Run folder that `drlsl train` made; or a driver: keep, always-change, mobil, oracle, "
        "FILE.py:NAME, "
        "PACKAGE.MODULE:NAME, or a model that Stable-Baselines3 saved (.zip).",
    ),
]
Episodes = Annotated[
    int | None, typer.Option(min=1, help="Episodes; default: evaluation.episodes of the run.")
]
Shields = Annotated[
    Literal["on", "off", "both"],
    typer.Option(help="Offer only safe actions, or all of them, or compare both."),
]
Recordings = Annotated[
    list[str] | None,
    typer.Option(
        help="Recording to drive in, may be repeated; default: those of the training.",
        autocompletion=recordings,
    ),
]
Carriageway = Annotated[
    Direction | None, typer.Option(help="Carriageway to drive on; default: that of the training.")
]
OtherRules = Annotated[
    list[Path] | None,
    typer.Option(help="Rule file to consult instead of the training's; may be repeated."),
]
TrackLength = Annotated[
    float | None, typer.Option(help="Metres of an episode; default: that of the training.")
]
Result = Annotated[Path | None, typer.Option(metavar="FILE", help="Write the result here too, as JSON.")]


def evaluate(
    who: Who,
    episodes: Episodes = None,
    shield: Shields = "both",
    recording: Recordings = None,
    direction: Carriageway = None,
    rules: OtherRules = None,
    track_length: TrackLength = None,
    seed: EpisodeSeed = None,
    settings: DriveSettings = None,
    out: Result = None,
    episodes_out: EpisodesOut = None,
    episodes_as: EpisodesAs = "npz",
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")] = False,
) -> None:
    """Drive with a trained policy, or another driver, and count what happens.

    The same episodes are driven with the shield on and off. An intervention is a step in which the rules did
    not derive the preferred action to be safe. Time saved is the share of the time of keeping the lane behind
    the shield, over the episodes that both completed. The result for a run is also kept in its
    evaluation.json. A driver without a run drives where `drlsl train` does by default.
    """
    from rich.console import Console

    from drlsl.learning import EVALUATION_KEY, RunFolder, changed_rules, load_driver, make_evaluation_env

    run = None if _is_driver(who) else RunFolder.open(Path(who))
    check_new(episodes_out, "episodes")
    config, arguments = config_and_arguments(
        run, settings, env_flags(recording, direction, rules, track_length)
    )
    env = make_evaluation_env(config.env)
    driver = load_driver(who, env, arguments)
    # Other rules may be named by --set, too.
    unnamed = run is not None and rules is None and config.env.rules == run.config.env.rules
    if run is not None and unnamed and (changed := changed_rules(run, env)):
        typer.echo(f"drlsl: the rules were changed after the training: {', '.join(changed)}", err=True)
    name, wants = (who, "preferences") if run is None else (POLICY, "Q-values")
    recorded = None
    if episodes_out is not None:
        recorded = EpisodeFolder(episodes_out, config.env, who, wants, f".{episodes_as}")
    shields: Sequence[ShieldState] = ("on", "off") if shield == "both" else (shield,)
    records = judge(
        [Trial(name, driver, one) for one in shields],
        env,
        episodes=episodes or config.evaluation.episodes,
        seed=config.seed if seed is None else seed,
        env_config=config.env.model_dump(mode="json"),
        console=Console(stderr=True),
        recorded=recorded,
    )
    if run is not None:
        run.save_evaluations(records, EVALUATION_KEY)
    if recorded is not None:
        typer.echo(recorded.write_page(), err=True)
    _tell({"driver" if run is None else "run": who, "evaluations": records}, out, as_json=as_json)


def _tell(result: Mapping[str, Any], out: Path | None, *, as_json: bool) -> None:
    """Print the result of a command, and write it to a file, too, if one is named."""
    from rich.console import Console

    from drlsl.files import write_atomic

    text = json.dumps(result, indent=1, allow_nan=False)
    if out is not None:
        write_atomic(out, f"{text}\n".encode())
    if as_json:
        typer.echo(text)
    else:
        Console().print(evaluation_table(result["evaluations"]))


def _is_driver(who: str) -> bool:
    """Return whether a name means a driver, and not a run folder.

    Raises:
        UserError: it means neither.
    """
    from drlsl.driving.drivers import DRIVERS, is_driver

    if is_driver(who) or who.endswith(".zip"):
        return True
    if not Path(who).exists():
        known = ", ".join(DRIVERS)
        raise UserError(f"{who}: expected a run folder, {known}, FILE.py:NAME, MODULE:NAME or MODEL.zip")
    return False


class Trial(NamedTuple):
    """A driver to judge, with the shield or without it."""

    name: str
    driver: Driver
    shield: ShieldState


def judge(
    trials: Sequence[Trial],
    env: HighwayVectorEnv,
    *,
    episodes: int,
    seed: int,
    env_config: Mapping[str, Any],
    console: Console,
    recorded: EpisodeFolder | None = None,
) -> list[dict[str, Any]]:
    """Drive the same episodes in each trial and return a record of each; show progress on a terminal.

    They are driven by keeping the lane behind the shield first, for the time that the others save. The
    episodes of the trials are `recorded`, if there is a folder for them.
    """
    from rich.progress import Progress

    from drlsl.driving.drivers import KEEP, make_driver
    from drlsl.learning import as_record, drive, times_of

    keep = Trial(KEEP, make_driver(KEEP), "on")
    kept: list[float | None] | None = None
    records = []
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        for trial in (keep, *(one for one in trials if one[::2] != keep[::2])):
            recorder = None
            if recorded is not None and any(trial[::2] == one[::2] for one in trials):
                driver = recorded.who if trial.name == POLICY else trial.name
                recorder = recorded.recorder(env, driver, enforced=trial.shield == "on", seed=seed)
            drives = drive(
                env, trial.driver, shield=trial.shield, episodes=episodes, seed=seed, recorder=recorder
            )
            shown = progress.track(drives, total=episodes, description=f"{trial.name}, shield {trial.shield}")
            summaries = list(shown)
            kept = times_of(summaries) if kept is None else kept
            record = as_record(summaries, env=env_config, shield=trial.shield, seed=seed, kept=kept)
            records.append({"driver": trial.name, **record})
    return records if any(one[::2] == keep[::2] for one in trials) else records[1:]


def _heading(driver: str, shield: str) -> str:
    return f"{driver}\nshield {shield}"


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
        table.add_column(_heading(record["driver"], record["shield"]), justify="right")
    for label, key, form in ROWS:
        values = (record["totals"][key] for record in records)
        table.add_row(Text(label), *("-" if value is None else format(value, form) for value in values))
    return table
