"""The folder of the rule programs that ship with the package."""

from __future__ import annotations

from pathlib import Path


def shipped_folder() -> Path | None:
    """Return the folder of the programs that ship: in the package, or in a checkout beside it; None without.

    Source: pyproject.toml, which puts the folder into the wheel.
    """
    package = Path(__file__).parents[2]
    for folder in (package / "rules", package.parent / "rules"):
        if (folder / "highway.pl").is_file():
            return folder
    return None
