"""The files of a rule program, and the programs that ship with the package."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from drlsl.errors import UserError
from drlsl.logic import Engine, Limits
from drlsl.logic.loading import shipped_folder

LOADING: Final = Limits(inferences=20_000_000, seconds=60.0)
"""The limits of loading a rule file, its directives included."""


def default_rules() -> tuple[Path, ...]:
    """Return the files of the default program.

    Raises:
        UserError: the package has no rules.
    """
    return (rules_folder() / "highway.pl",)


def rules_folder() -> Path:
    """Return the folder of the programs that ship.

    Raises:
        UserError: neither place has them.
    """
    folder = shipped_folder()
    if folder is None:
        raise UserError("the package has no rules/highway.pl; install drlsl again")
    return folder


def consult_rules(engine: Engine, path: str | Path) -> None:
    """Consult a rule file, or the program of this name that ships with the package.

    Files that it names are searched beside it, then among the programs that ship.

    Raises:
        UserError: the file cannot be read.
        PrologError: it is not a valid program, or loading it goes beyond `LOADING`.
    """
    try:
        engine.consult(rule_file(path), limits=LOADING)
    except OSError as error:
        raise UserError(f"cannot read the rule file {path}: {error.strerror}") from error


def rule_file(path: str | Path) -> Path:
    """Return a rule file, or the program of this name that ships with the package."""
    if Path(path).exists() or len(Path(path).parts) > 1:
        return Path(path)
    shipped = rules_folder() / path
    return shipped if shipped.is_file() else Path(path)
