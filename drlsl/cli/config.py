"""`drlsl config`: settings in full, and the schema that describes them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from drlsl.cli.options import presets
from drlsl.errors import UserError

if TYPE_CHECKING:
    from drlsl.learning import TrainConfig

app = typer.Typer(help="Show settings in full, and their JSON schema.", no_args_is_help=True)


@app.command()
def show(
    source: Annotated[
        str,
        typer.Argument(
            metavar="PRESET|RUN|FILE",
            help="A preset, a run folder or a YAML file.",
            autocompletion=presets,
        ),
    ] = "quick",
) -> None:
    """Print every setting of a preset, a run or a file as YAML; settings not in a file have their defaults.

    The output is a file for `drlsl train --config`.
    """
    from drlsl.learning import dump_yaml

    typer.echo(dump_yaml(_config_of(source)), nl=False)


def _config_of(source: str) -> TrainConfig:
    """Return the configuration that a name means; a preset comes before a file of its name.

    Raises:
        UserError: it means none, or what it means cannot be read.
    """
    from drlsl.learning import RunFolder, load_config, make_config, preset_names, preset_values

    if source in preset_names():
        return make_config(preset_values(source), f"preset {source}")
    path = Path(source)
    if path.is_dir():
        return RunFolder.open(path).config
    if not path.exists():
        raise UserError(f"{source}: expected a preset ({', '.join(preset_names())}), a run folder or a file")
    return load_config(path)


@app.command()
def schema(
    of: Annotated[
        Literal["train", "study"], typer.Argument(help="Files of `drlsl train --config` or of a study.")
    ] = "train",
) -> None:
    """Print the JSON schema of configuration files, for editors and checks.

    With the YAML language server, the first line `# yaml-language-server: $schema=FILE` of a file makes
    an editor complete and check its settings.
    """
    from drlsl.learning import TrainConfig

    if of == "train":
        values = TrainConfig.model_json_schema()
    else:
        from drlsl.study import StudyConfig

        values = StudyConfig.model_json_schema()
    values = {"$schema": "https://json-schema.org/draft/2020-12/schema", **values}
    typer.echo(json.dumps(values, indent=1))
