"""The default rule program of driving."""

from __future__ import annotations

from pathlib import Path

from drlsl.shield import rules_folder


def default_rules() -> tuple[Path, ...]:
    """Return the files of the default program.

    Raises:
        UserError: the package has no rules.
    """
    return (rules_folder() / "highway.pl",)
