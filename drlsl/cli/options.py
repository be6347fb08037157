"""Options that several commands have, declared once."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

import typer
from typer.models import OptionInfo

from drlsl.errors import UserError

if TYPE_CHECKING:
    from drlsl.learning import RunFolder, TrainConfig
    from drlsl.workers import Crew

Direction: TypeAlias = Literal["both", "left_to_right", "right_to_left"]


def recordings(incomplete: str) -> list[str]:
    """Return what may follow in a shell where a recording is named."""
    from drlsl.traffic import bundled_recordings

    return [name for name in bundled_recordings() if name.startswith(incomplete)]


def env_flags(
    recordings: list[str] | None, direction: str | None, rules: list[Path] | None, track_length: float | None
) -> dict[str, object]:
    """Return what options say of an environment, by the keys of its settings; None if one is not given."""
    return {
        "env.recording": recordings[0] if recordings and len(recordings) == 1 else recordings or None,
        "env.direction": direction,
        "env.rules": [str(path) for path in rules] if rules else None,
        "env.track_length": track_length,
    }


def presets(incomplete: str) -> list[str]:
    """Return what may follow in a shell where a preset of `drlsl train` is named."""
    from drlsl.learning import preset_names

    return [name for name in preset_names() if name.startswith(incomplete)]


def several(
    name: str, metavar: str, words: str, complete: Callable[[str], list[str]] | None = None
) -> OptionInfo:
    """Return an option that may be given several times, explained by `words`."""
    option: OptionInfo = typer.Option(name, metavar=metavar, help=words, autocompletion=complete)
    return option


Jobs = Annotated[
    int | None, typer.Option(min=1, help="Processes of this machine; default: one for each processor.")
]
Ray = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="Ray cluster to spread the work over, HOST:PORT or auto."),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Rules = Annotated[
    list[Path] | None,
    typer.Option(metavar="FILE", help="A rule file instead of highway.pl; give it again for more."),
]
RuleFiles = Annotated[
    list[Path] | None, typer.Argument(metavar="[FILE]...", help="Rule files; default: highway.pl.")
]
Properties = Annotated[
    list[Path] | None,
    several("--property", "FILE", "A file of properties instead of properties.pl; give it again for more."),
]
DriveSettings = Annotated[
    list[str] | None,
    several(
        "--set",
        "KEY=VALUE",
        "Any other setting of env, such as env.traffic=reactive, or of the driver, such as "
        "driver.politeness=0.2; may be repeated.",
    ),
]
EpisodeSeed = Annotated[
    int | None, typer.Option(min=0, help="Seed of the episodes; default: that of the run.")
]


def crew_of(jobs: int | None, ray: str | None) -> Crew:
    """Return who performs the tasks of a command.

    Raises:
        UserError: both are given.
    """
    from drlsl.workers import Crew, cores

    if jobs is not None and ray is not None:
        raise UserError("--jobs is for this machine; with --ray the cluster's processors decide")
    return Crew(jobs or cores(), ray)


def check_new(folder: Path | None, what: str = "scenes") -> None:
    """Refuse a folder that exists; `what` is to be written to it.

    Raises:
        UserError: it does.
    """
    if folder is not None and folder.exists():
        raise UserError(f"{folder} exists; name a new folder for the {what}")


def given_settings(settings: list[str], flags: Mapping[str, object], example: str) -> dict[str, Any]:
    """Return the nested values of --set KEY=VALUE and of the flags that were given, by dotted keys.

    Raises:
        UserError: a --set is not of the form of the `example`.
    """
    import yaml

    from drlsl.learning import with_value

    values: dict[str, Any] = {}
    for text in settings:
        key, sign, value = text.partition("=")
        if not (sign and key):
            raise UserError(f"--set {text}: expected KEY=VALUE, such as {example}")
        try:
            values = with_value(values, key.strip(), yaml.safe_load(value))
        except yaml.YAMLError as error:
            raise UserError(f"--set {text}: the value is not valid YAML") from error
    for key, given in flags.items():
        if given is not None:
            values = with_value(values, key, given)
    return values


def config_and_arguments(
    run: RunFolder | None, settings: list[str] | None, flags: Mapping[str, object]
) -> tuple[TrainConfig, dict[str, Any]]:
    """Return the configuration of a run, or the default one, with what is set; and the driver's arguments.

    Raises:
        UserError: a setting is neither of env nor of the driver, or it is wrong.
    """
    from drlsl.learning import make_config, merged, preset_values

    base = preset_values("quick") if run is None else run.config.model_dump()
    given = given_settings(settings or [], flags, "env.traffic=reactive")
    arguments = given.pop("driver", {})
    if given.keys() - {"env"} or not isinstance(arguments, dict):
        raise UserError("--set: expected settings of env or of the driver, such as env.traffic=reactive")
    return make_config(merged(base, given), "command line"), arguments
