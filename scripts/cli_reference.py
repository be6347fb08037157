"""Write docs/cli.md, the help of every command; run it after changing a command."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer

from drlsl.cli.program import app

TARGET = Path(__file__).parents[1] / "docs" / "cli.md"


def reference() -> str:
    """Return the text of docs/cli.md."""
    parts = [
        "# Commands",
        "",
        "Made by `python scripts/cli_reference.py`; a test fails when it is out of date.",
    ]
    for path, text in helps(typer.main.get_command(app), "drlsl"):
        parts += ["", f"## `{path}`", "", "```", text.strip(), "```"]
    return "\n".join(parts) + "\n"


def helps(command: Any, path: str) -> Iterator[tuple[str, str]]:
    """Yield the path and help of `command` and of every command below it."""
    context = command.context_class(command, info_name=path, terminal_width=100, max_content_width=100)
    yield path, command.get_help(context)
    for name, below in getattr(command, "commands", {}).items():
        yield from helps(below, f"{path} {name}")


if __name__ == "__main__":
    TARGET.write_text(reference(), encoding="utf-8")
    print(f"wrote {TARGET}")
