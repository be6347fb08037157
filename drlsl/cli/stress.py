"""`drlsl stress`: drive many episodes with a policy that looks for trouble, and count what happens."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

if TYPE_CHECKING:
    from drlsl.driving.stress import StressReport


def stress(
    recording: Annotated[
        list[str], typer.Argument(help="Bundled recordings' names, highD folders or NGSIM files to drive in.")
    ],
    policy: Annotated[
        Literal["random", "always-change"], typer.Option(help="How to choose among the offered actions.")
    ] = "random",
    episodes: Annotated[int, typer.Option(min=1, help="How many episodes.")] = 2000,
    rules: Annotated[
        list[Path] | None,
        typer.Option(
            "--rules", metavar="FILE", help="A rule file instead of highway.pl; give it again for more."
        ),
    ] = None,
    direction: Annotated[
        Literal["both", "left_to_right", "right_to_left"], typer.Option(help="Which way the ego drives.")
    ] = "both",
    tier: Annotated[
        Literal["auto", "interpreter", "scalar", "numpy"], typer.Option(help="What runs the rules.")
    ] = "auto",
    seed: Annotated[int, typer.Option(min=0, help="Everything random follows from it.")] = 0,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write the worst contacts here, as scenes for drlsl query."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Drive episodes with random or always-changing choices among what is offered, and count contacts."""
    from rich.console import Console
    from rich.progress import Progress

    from drlsl.driving.config import EnvConfig
    from drlsl.driving.shield import Shield
    from drlsl.driving.stress import POLICIES, StressReport
    from drlsl.driving.stress import stress as run
    from drlsl.errors import UserError
    from drlsl.traffic.load import load_recording

    if out is not None and out.exists():
        raise UserError(f"{out} exists; name a new folder for the scenes")
    config = EnvConfig(recording=recording[0], direction=direction, tier=tier)
    shield = Shield.from_files(rules or (), tier=config.tier)
    recordings = [load_recording(name) for name in recording]
    report = StressReport()
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task(f"{policy} policy, {shield.tier} rules", total=episodes)
        for report in run(config, recordings, shield, POLICIES[policy], episodes=episodes, seed=seed):
            progress.update(task, completed=report.episodes)
    if out is not None:
        _write_worst(report, out)
    print(json.dumps(report.as_json(), indent=2) if as_json else _report(report))


def _report(report: StressReport) -> str:
    """What a person reads."""
    excused = ", ".join(f"{count} {name}" for name, count in report.contacts.items() if name != "at_fault")
    lines = [
        f"episodes                {report.episodes} ({report.steps} steps, {report.distance / 1000:.0f} km)",
        f"lane changes            {report.lane_changes}",
        f"off the road            {report.off_road}",
        f"contacts at fault       {report.contacts_at_fault}",
        f"contacts not at fault   {report.contacts_not_at_fault}" + (f" ({excused})" if excused else ""),
        f"fail-safe steps         {report.fail_safe}",
    ]
    return "\n".join(lines)


def _write_worst(report: StressReport, out: Path) -> None:
    """A scene file for each of the worst contacts."""
    from drlsl.driving.scene_file import scene_json

    out.mkdir(parents=True)
    for record in report.worst:
        name = f"episode-{record.episode}-{record.verdict}-v{record.vehicle}.json"
        (out / name).write_text(scene_json(record.scene), encoding="utf-8")
