"""`drlsl stress`: drive many episodes with policies that look for trouble, and count what happens."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, TypeAlias

import typer

from drlsl.cli.drivers import loaded_driver, trained_env
from drlsl.cli.options import AsJson, Direction, Jobs, Ray, Rules, check_new, crew_of, given_settings, several

if TYPE_CHECKING:
    from drlsl.driving import Counts, EnvConfig, StressReport
    from drlsl.driving.drivers import Driver
    from drlsl.driving.shield import Shield
    from drlsl.traffic import Recording
    from drlsl.workers import Crew, Function, Stop

Offers: TypeAlias = Literal["rules", "prediction", "all"]


Recordings = Annotated[
    list[str] | None,
    typer.Argument(
        help="Bundled recordings' names, highD folders or NGSIM files to drive in; none: all bundled."
    ),
]
Policy = Annotated[
    Literal["all", "random", "always-change", "adversarial"],
    typer.Option(help="How to choose among the offered actions; all: the episodes take turns."),
]
Offered = Annotated[
    Offers | None,
    typer.Option(
        help="Who says which actions are offered: rules, a linear prediction, or nobody. The rules say "
        "how fast to go in any case.",
        show_default="rules",
    ),
]
OldOffers = Annotated[
    Literal["rules", "prediction", "none"] | None,
    typer.Option(hidden=True, help="The name of --offers until 0.2; its none is all."),
]
SceneFolder = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        help="Write the worst contacts here: scenes for drlsl query, episodes, and a page, worst.html.",
    ),
]

WORST: Final = "worst.html"
"""The page of the worst contacts."""


Who = Annotated[
    str | None,
    typer.Option(
        metavar="DRIVER",
        help="Drive with this driver in place of the policies: keep, always-change, mobil, oracle, "
        "FILE.py:NAME, MODULE:NAME, a run folder or a model of Stable-Baselines3 (.zip).",
    ),
]
Parameters = Annotated[
    list[str] | None,
    several("--set", "driver.KEY=VALUE", "A parameter of the driver; may be repeated."),
]
Period = Annotated[
    float | None,
    typer.Option(help="Seconds for which an action is held; default: a frame, or as the run was trained."),
]
Horizon = Annotated[float | None, typer.Option(help="Seconds that the prediction looks ahead; default: 3.")]
Traffic = Annotated[
    Literal["auto", "recorded", "reactive"],
    typer.Option(
        help="Whether recorded vehicles drive through the ego or brake for it; auto: as recordings say."
    ),
]
Tier = Annotated[
    Literal["auto", "interpreter", "scalar", "numpy", "numba", "torch"],
    typer.Option(help="Tier that runs the rules."),
]


def stress(
    recording: Recordings = None,
    policy: Policy = "all",
    driver: Who = None,
    settings: Parameters = None,
    decision_period: Period = None,
    offers: Offered = None,
    shield: OldOffers = None,
    episodes: Annotated[int, typer.Option(min=1, help="How many episodes.")] = 2000,
    rules: Rules = None,
    horizon: Horizon = None,
    traffic: Traffic = "auto",
    position_noise: Annotated[float, typer.Option(help="Metres by which places seen are wrong.")] = 0.0,
    speed_noise: Annotated[float, typer.Option(help="Metres a second by which speeds seen are wrong.")] = 0.0,
    drop_rate: Annotated[float, typer.Option(help="Share of the vehicles that are not seen.")] = 0.0,
    latency: Annotated[float, typer.Option(help="Age of the sensed state in seconds.")] = 0.0,
    direction: Annotated[Direction, typer.Option(help="Which way the ego drives.")] = "both",
    tier: Tier = "auto",
    seed: Annotated[int, typer.Option(min=0, help="Everything random follows from it.")] = 0,
    jobs: Jobs = None,
    ray: Ray = None,
    out: SceneFolder = None,
    as_json: AsJson = False,
) -> None:
    """Drive episodes with policies that look for trouble among the offered actions, and count contacts."""
    from drlsl.driving import POLICIES
    from drlsl.driving.scene import write_scenes
    from drlsl.traffic import bundled_recordings

    check_new(out)
    crew = crew_of(jobs, ray)
    arguments = _parameters(driver, settings, policy)
    trained = trained_env(driver)
    config = _config(
        recording=tuple(recording or bundled_recordings()),
        direction=direction,
        rules=tuple(map(str, rules or ())) or (() if trained is None else trained.rules),
        decision_period=decision_period or (None if trained is None else trained.decision_period),
        tier=tier,
        offers=_offers(offers, shield),
        traffic=traffic,
        sensing={
            "position_noise": position_noise,
            "speed_noise": speed_noise,
            "drop_rate": drop_rate,
            "latency": latency,
        },
        **({} if horizon is None else {"prediction_horizon": horizon}),
    )
    policies: list[str] = [] if driver else [*POLICIES] if policy == "all" else [policy]
    job = _Job(config, policies, driver, arguments, seed)
    report = job.run(episodes, crew)
    if out is not None:
        write_scenes(out, {record.name: record.scene for record in report.worst})
        job.record(out, report)
    print(json.dumps(report.as_json(), indent=2) if as_json else _report(report))


def _offers(offers: Offers | None, shield: str | None) -> str:
    """Return who offers the actions, from the flag or the one that it replaces.

    Raises:
        UserError: both flags are given.
    """
    if shield is None:
        return offers or "rules"
    from drlsl.errors import UserError

    if offers is not None:
        raise UserError("--shield is the old name of --offers; give --offers alone")
    value = "all" if shield == "none" else shield
    typer.echo(f"drlsl: --shield {shield} is now --offers {value}; --shield goes with 0.3", err=True)
    return value


def _config(**settings: Any) -> EnvConfig:
    """Return the configuration that the flags make.

    Raises:
        UserError: a number is out of range.
    """
    from pydantic import ValidationError

    from drlsl.driving import EnvConfig
    from drlsl.errors import UserError
    from drlsl.files import reason_of

    try:
        return EnvConfig(**settings)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        flag = {"prediction_horizon": "horizon"}.get(str(first["loc"][-1]), str(first["loc"][-1]))
        raise UserError(f"--{flag.replace('_', '-')}: {reason_of(first)}, got {first['input']!r}") from error


def _parameters(driver: str | None, settings: list[str] | None, policy: str) -> dict[str, Any]:
    """Return the parameters of the driver.

    Raises:
        UserError: there is no driver, or anything but its parameters is set; or a policy is given besides.
    """
    from drlsl.errors import UserError

    if driver is not None and policy != "all":
        raise UserError("--driver and --policy: expected one of them, not both")
    given = given_settings(settings or [], {}, "driver.politeness=0.2")
    arguments = given.pop("driver", {})
    if given or not isinstance(arguments, dict) or (arguments and driver is None):
        raise UserError("--set: expected parameters of --driver, such as driver.politeness=0.2")
    return arguments


@dataclass(frozen=True)
class _Job:
    """All that the episodes depend on but their numbers, and the drivers who take turns."""

    config: EnvConfig
    policies: list[str]
    driver: str | None
    arguments: dict[str, Any]
    seed: int

    @cached_property
    def shield(self) -> Shield:
        """The shield of the rules."""
        from drlsl.driving.shield import Shield

        return Shield.from_files(self.config.rules, tier=self.config.tier, seconds=self.config.rule_seconds)

    @cached_property
    def drivers(self) -> dict[str, Driver]:
        """The driver by its name, if there is one."""
        if self.driver is None:
            return {}
        return {self.driver: loaded_driver(self.driver, self.arguments, self.shield)}

    @cached_property
    def recordings(self) -> list[Recording]:
        """The recordings."""
        from drlsl.traffic import load_recordings

        return [one for name in self.config.recordings for one in load_recordings(name)]

    def __reduce__(self) -> tuple[Any, ...]:
        """Go to another process without what is loaded."""
        return _Job, tuple(getattr(self, one.name) for one in fields(self))

    def files(self) -> list[Path]:
        """Return the files that do not ship with the package."""
        from drlsl.shield import own_files
        from drlsl.traffic import bundled_recordings

        others = set(self.config.recordings) - set(bundled_recordings())
        return own_files(self.shield.engine) + _driver_files(self.driver) + _recording_files(sorted(others))

    def driving(self) -> Function[range, StressReport]:
        """Return the function that drives a range of episodes."""
        from drlsl.driving import stress

        def drive(episodes: range, _stop: Stop) -> StressReport:
            *_, report = stress(
                self.config,
                self.recordings,
                self.shield,
                self.policies,
                episodes=len(episodes),
                first=episodes.start,
                seed=self.seed,
                drivers=self.drivers,
            )
            return report

        return drive

    def run(self, episodes: int, crew: Crew) -> StressReport:
        """Drive episodes, with a progress bar on a terminal."""
        from rich.console import Console
        from rich.progress import Progress

        from drlsl.driving import StressReport, spread_stress

        report = StressReport()
        console = Console(stderr=True)
        with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
            names = ", ".join([*self.policies, *self.drivers])
            task = progress.add_task(f"{names}; {self.shield.tier} rules", total=episodes)
            for report in spread_stress(crew, self.driving, episodes, files=self.files()):
                progress.update(task, completed=report.total.episodes)
        return report

    def record(self, folder: Path, report: StressReport) -> None:
        """Write the episodes of the worst contacts to a folder, and a page that shows how they came about."""
        from drlsl.driving import record
        from drlsl.driving.episodes import SUFFIX, save_episode
        from drlsl.driving.page import write_page

        episodes = record(
            self.config,
            self.recordings,
            self.shield,
            self.policies,
            report.worst,
            seed=self.seed,
            drivers=self.drivers,
        )
        for contact, episode in zip(report.worst, episodes, strict=True):
            save_episode(folder / f"{contact.name}{SUFFIX}", episode)
        if episodes:
            write_page(folder / WORST, episodes, title="The worst contacts")


def _driver_files(driver: str | None) -> list[Path]:
    """Return the files of a driver: those of a run folder, or the one that holds it."""
    path = Path("" if driver is None else driver.rpartition(":")[0] or driver)
    if driver is not None and path.is_dir():
        return sorted(one for one in path.iterdir() if one.is_file())
    return [path] if path.is_file() else []


def _recording_files(names: Iterable[str]) -> list[Path]:
    """Return the files of recordings; of those in an archive, the archive."""
    from drlsl.traffic import find_sources

    archives = {name: Path(name.partition("#")[0]) for name in names}
    found = []
    for name, path in archives.items():
        is_archive = path.suffix == ".zip" and path.is_file()
        found += [path] if is_archive else [file for one in find_sources(name) for file in one.files]
    return found


def _report(report: StressReport) -> str:
    """Return the text output: a column of counts for each policy, and the worst contacts."""
    columns = [*report.policies.items()]
    if len(columns) > 1:
        columns.append(("all", report.total))
    lines = ["".join([" " * 22, *(f"{name:>15}" for name, _ in columns)])]
    for title, text in _ROWS.items():
        lines.append("".join([f"{title:<22}", *(f"{text(counts):>15}" for _, counts in columns)]))
    excused = {name: count for name, count in report.total.contacts.items() if name != "at_fault" and count}
    if excused:
        lines.append("excused: " + ", ".join(f"{count} {name}" for name, count in sorted(excused.items())))
    if report.worst:
        lines.append("worst contacts:")
    for record in report.worst:
        speed = f"{record.closing_speed:5.1f} m/s apart"
        lines.append(f"  {record.name:<45} {speed}  {record.policy}")
    return "\n".join(lines)


_ROWS: Final[dict[str, Callable[[Counts], str]]] = {
    "episodes": lambda counts: str(counts.episodes),
    "steps": lambda counts: str(counts.steps),
    "kilometres": lambda counts: f"{float(counts.distance) / 1000:.0f}",
    "lane changes": lambda counts: str(counts.lane_changes),
    "off the road": lambda counts: str(counts.off_road),
    "contacts at fault": lambda counts: str(counts.contacts_at_fault),
    "contacts not at fault": lambda counts: str(counts.contacts_not_at_fault),
    "fail-safe steps": lambda counts: str(counts.fail_safe),
}
