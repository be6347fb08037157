"""Options that several commands have, declared once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, TypeAlias

import typer

from drlsl.errors import UserError

Direction: TypeAlias = Literal["both", "left_to_right", "right_to_left"]

AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Rules = Annotated[
    list[Path] | None,
    typer.Option(metavar="FILE", help="A rule file instead of highway.pl; give it again for more."),
]
RuleFiles = Annotated[
    list[Path] | None, typer.Argument(metavar="[FILE]...", help="Rule files; default: highway.pl.")
]


def check_new(folder: Path | None) -> None:
    """Refuse a folder for scenes that exists.

    Raises:
        UserError: it does.
    """
    if folder is not None and folder.exists():
        raise UserError(f"{folder} exists; name a new folder for the scenes")
