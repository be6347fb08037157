"""`drlsl export`: a trained policy as a file for other programs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal

import typer

from drlsl.cli.options import AsJson


def export(
    run: Annotated[Path, typer.Argument(help="Run folder that `drlsl train` made.")],
    out: Annotated[Path, typer.Option(metavar="FILE", help="The file to write.")],
    to: Annotated[Literal["onnx"], typer.Option(help="Format of the file.")] = "onnx",
    as_json: AsJson = False,
) -> None:
    """Write a trained policy as an ONNX model: observations in, Q-values out.

    Before it is written, the model is compared with the policy on 1,000 observations of driving. Its metadata
    has the names and bounds of the observation, the actions and the digests of the rules.
    """
    from drlsl.learning import RunFolder, export_onnx

    metadata = export_onnx(RunFolder.open(run), out)
    if as_json:
        typer.echo(json.dumps({"run": str(run), "file": str(out), "to": to, "metadata": metadata}, indent=1))
    else:
        typer.echo(f"wrote {out}: the Q-values of {metadata['actions']}")
